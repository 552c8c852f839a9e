"""The page of types: for each meaning the one public type, and why each other type differs.

python docs/_tools/type_tables.py    # writes docs/reference/types.md
"""

from __future__ import annotations

import ast
import re
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from public_types import other_types

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reference" / "types.md"
HEAD = """# Types

One meaning has one public type: functions take it and give it. The tables have the other types of
the same meaning. Each says in the first lines of its docstring why it differs; the tables repeat
this sentence and name the functions that convert it, make it, or use it in place of another. A
*public* type is imported from its room, an *inner* one stays inside the library.

A Solution, a Run, an answer, or any object with an attribute `lti` is taken wherever a linear
system, a set of plants or a controller is.

This page is made by `python docs/_tools/type_tables.py` from `docs/_tools/types.toml` and the
docstrings. A test fails for a class that has one of these meanings by its name or by its fields,
and no row here. The last tables have all other public types.
"""
COLUMNS = ("| type | where | why it differs | functions |", "| --- | --- | --- | --- |")
QUESTIONS = {"Task", "Checker"}
"""Bases of classes that ask or check, and so are no types of data."""


@dataclass(frozen=True)
class Type:
    """A class of the library: its module, bases, fields with their annotations, and docstring."""

    module: str
    bases: tuple[str, ...]
    fields: dict[str, str]
    doc: str

    @property
    def difference(self) -> str:
        """The sentence of the docstring that says how it differs; empty without one."""
        found = re.search(r"Unlike .*?\.(?=\s|$)", self.doc, re.DOTALL)
        return " ".join(found[0].split()) if found else ""


def meanings() -> list[dict[str, Any]]:
    """The meanings with their types, as `types.toml` has them."""
    text = Path(__file__).with_name("types.toml").read_text(encoding="utf-8")
    found: list[dict[str, Any]] = tomllib.loads(text)["meaning"]
    return found


@cache
def types() -> dict[str, Type]:
    """Every class of the library that holds data, by name; private ones stay in their module."""
    found = {}
    for path in sorted((ROOT / "workbench").rglob("*.py")):
        module = ".".join(path.relative_to(ROOT / "workbench").with_suffix("").parts)
        for node in ast.parse(path.read_bytes()).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                bases = tuple(ast.unparse(base).split(".")[-1] for base in node.bases)
                declared = {
                    ast.unparse(each.target): ast.unparse(each.annotation)
                    for each in node.body
                    if isinstance(each, ast.AnnAssign)
                }
                doc = ast.get_docstring(node) or ""
                found[node.name] = Type(module.removesuffix(".__init__"), bases, declared, doc)
    return {name: one for name, one in found.items() if not _asks(name, found)}


def _asks(name: str, known: dict[str, Type]) -> bool:
    bases = known[name].bases if name in known else ()
    return name in QUESTIONS or any(_asks(base, known) for base in bases if base != name)


def named(meaning: dict[str, Any]) -> set[str]:
    """The classes that the table of a meaning names."""
    return {meaning.get("own", ""), *meaning["types"], *meaning["other"]} - {""}


def belongs(name: str, one: Type, meaning: dict[str, Any]) -> bool:
    """Whether a type has a meaning by its name or its fields."""
    if re.search(rf"(^|[a-z0-9])({'|'.join(meaning['words'])})$", name):
        return True
    return any(all(_has(one, field) for field in fields) for fields in meaning["fields"])


def _has(one: Type, field: str) -> bool:
    name, _, annotation = field.partition(": ")
    return name in one.fields and annotation in one.fields[name]


def is_public(name: str) -> bool:
    """Whether a room offers the type."""
    return any(f'    "{name}",' in text for text in _faces())


@cache
def _faces() -> list[str]:
    rooms = (ROOT / "workbench").glob("*/__init__.py")
    return [path.read_text(encoding="utf-8") for path in rooms]


def text() -> str:
    """The page."""
    named_above = set().union(*map(named, meanings()))
    sections = [_section(meaning) for meaning in meanings()]
    return "\n".join([HEAD, *sections, other_types(named_above)])


def _section(meaning: dict[str, Any]) -> str:
    rows = [
        f"| `{name}` | {'public' if is_public(name) else 'inner'}, `{types()[name].module}` "
        f"| {types()[name].difference} | {_named(converters)} |"
        for name, converters in meaning["types"].items()
    ]
    lines = [
        f"## {meaning['name']}",
        f"The public type: **{meaning['public']}**.",
        " ".join(
            f"{said} {_named(meaning[way])}."
            for said, way in (("Taken by", "take"), ("Given by", "give"))
            if meaning[way]
        ),
        "\n".join([*COLUMNS, *rows]),
    ]
    if meaning["other"]:
        others = [f"`{name}` {what}" for name, what in meaning["other"].items()]
        lines.append(f"Other things with such names or fields: {'; '.join(others)}.")
    return "\n\n".join(lines) + "\n"


def _named(names: list[str]) -> str:
    """Names in code, without the path to their module."""
    return ", ".join(f"`{_short(name)}`" for name in names)


def _short(name: str) -> str:
    *path, last = name.split(".")
    return f"{path[-1]}.{last}" if path and path[-1][0].isupper() else last


if __name__ == "__main__":
    PAGE.write_text(text(), encoding="utf-8")
