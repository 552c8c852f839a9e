"""Tables of the public types that have a meaning of their own, by room, with what gives them."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Collection, Iterator
from functools import cache
from importlib import import_module
from inspect import isclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
HEAD = """## All other public types

Each has a meaning of its own. The last column has the functions and methods that return it; a type
without one is made by its own name.
"""
STORAGE = ("from_dataset", "restored_answer", "witnessed")
"""Methods that give back a stored answer; users do not call them."""
COLUMNS = ("| type | what it is | returned by |", "| --- | --- | --- |")


def other_types(named: Collection[str]) -> str:
    """A table for each room of its public types that are not named yet."""
    from api_pages import ROOMS, public_names

    sections, seen = [HEAD], set(named)
    for room in ROOMS:
        module = import_module(room)
        here = [name for name in public_names(module) if isclass(getattr(module, name, None))]
        new = [name for name in here if name not in seen and name in _classes()]
        seen.update(new)
        if new:
            rows = [f"| `{name}` | {_first_sentence(name)} | {_givers(name)} |" for name in new]
            sections.append("\n".join([f"### In `{room}`\n", *COLUMNS, *rows]) + "\n")
    return "\n".join(sections)


def _first_sentence(name: str) -> str:
    """The first paragraph of a class's docstring, for a cell of a table."""
    doc = ast.get_docstring(_classes()[name]) or ""
    return " ".join(doc.split("\n\n")[0].split()).replace("|", r"\|")


def _givers(name: str) -> str:
    return ", ".join(f"`{one}`" for one in sorted(_returning()[name]))


@cache
def _classes() -> dict[str, ast.ClassDef]:
    """Every class of the library by its name, which no other class has."""
    return {node.name: node for node in _nodes() if isinstance(node, ast.ClassDef)}


@cache
def _returning() -> dict[str, set[str]]:
    """Public functions, and public methods of other classes, by the types that they return."""
    from api_pages import ROOMS, public_names

    public = {name for room in ROOMS for name in public_names(import_module(room))}
    found = defaultdict(set)
    for node in _nodes():
        if node.name in public:
            for path, function in _functions(node):
                text = ast.unparse(function.returns) if function.returns else ""
                for word in set(re.findall(r"\w+", text)) - {node.name}:
                    found[word].add(path)
    return found


def _functions(node: ast.stmt) -> Iterator[tuple[str, ast.FunctionDef]]:
    if isinstance(node, ast.FunctionDef):
        yield node.name, node
    elif isinstance(node, ast.ClassDef):
        for each in node.body:
            if isinstance(each, ast.FunctionDef) and not each.name.startswith(("_", *STORAGE)):
                yield f"{node.name}.{each.name}", each


@cache
def _nodes() -> list[ast.ClassDef | ast.FunctionDef]:
    """Every class and function at the top level of a module of the library."""
    files = sorted((ROOT / "workbench").rglob("*.py"))
    bodies = (ast.parse(path.read_bytes()).body for path in files)
    return [
        node for body in bodies for node in body if isinstance(node, ast.ClassDef | ast.FunctionDef)
    ]
