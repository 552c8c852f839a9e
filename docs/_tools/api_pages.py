"""A page of the reference for each room of the library: its examples, then every public name."""

from __future__ import annotations

import ast
import importlib
import inspect
from pathlib import Path
from types import ModuleType
from typing import Any, get_origin

from gallery import write_page

ROOMS = (
    "workbench",
    "workbench.geometry",
    "workbench.fitting",
    "workbench.identification",
    "workbench.uncertainty",
    "workbench.mu",
    "workbench.synthesis",
    "workbench.diagnosis",
    "workbench.realisations",
    "workbench.simulation",
    "workbench.systems",
    "workbench.optics",
    "workbench.conic",
    "workbench.collections",
    "workbench.program",
    "workbench.study",
    "workbench.starter",
    "workbench.executor",
    "workbench.structure",
    "workbench.certificate",
    "workbench.certify",
    "workbench.solvers",
    "workbench.errors",
    "workbench.figures",
    "workbench.types",
    "workbench.bench.comparison",
)
"""Rooms with a public face, in the order of the reference."""
KINDS = {
    "function": "Functions",
    "class": "Classes",
    "data": "Constants and types",
    "module": "Methods",
}
MODULES_ARE = (
    "Modules whose import registers methods. Each method is asked by its name, as in "
    '`wb.solve(program, method="name")`.'
)


def public_names(room: ModuleType) -> list[str]:
    """What a room offers: its ``__all__``, or the names that it defines without an underscore."""
    if hasattr(room, "__all__"):
        return [name for name in room.__all__ if not name.startswith("__")]
    tree = ast.parse(Path(room.__file__ or "").read_text(encoding="utf-8"))
    defined = (n for n in tree.body if isinstance(n, ast.ClassDef | ast.FunctionDef))
    return [node.name for node in defined if not node.name.startswith("_")]


def kind_of(found: Any) -> str:
    """Which directive documents an object."""
    if inspect.ismodule(found):
        return "module"
    # the name of a type, such as Callable[[int], None], or of one from a library not yet imported
    if get_origin(found) is not None or found is Any:
        return "data"
    if inspect.isclass(found):
        return "class"
    return "function" if callable(found) else "data"


def page(name: str, examples: str) -> str:
    """The page of a room in Markdown."""
    room = importlib.import_module(name)
    words = inspect.getdoc(room) or ""
    lines = [f"# `{name}`", words]
    if examples:
        lines += [examples.strip()]
    found = [(one, getattr(room, one)) for one in public_names(room)]
    for kind, title in KINDS.items():
        chosen = [one for one, thing in found if kind_of(thing) == kind]
        if not chosen:
            continue
        lines.append(f"## {title}")
        if kind == "module":
            lines.append(MODULES_ARE)
        directives = [directive(name, one, kind) for one in sorted(chosen, key=str.lower)]
        lines.append("```{eval-rst}\n" + "\n".join(directives) + "```")
    return "\n\n".join(lines) + "\n"


def directive(room: str, name: str, kind: str) -> str:
    """The directive of autodoc for a public name; one that the top offers too is indexed there."""
    if kind == "module":
        module = getattr(importlib.import_module(room), name)
        return f"``{name}``\n    {(inspect.getdoc(module) or '').splitlines()[0]}\n"
    twice = room != "workbench" and name in public_names(importlib.import_module("workbench"))
    return f".. auto{kind}:: {room}.{name}\n" + ("   :no-index:\n" if twice else "")


def make(app: Any) -> None:
    """Write the pages and their list."""
    folder = Path(app.srcdir) / "reference" / "api"
    folder.mkdir(exist_ok=True)
    for room in ROOMS:
        file = Path(app.srcdir) / "reference" / "examples" / f"{room}.md"
        examples = file.read_text(encoding="utf-8") if file.exists() else ""
        write_page(folder / f"{room}.md", page(room, examples))
    heads = []
    for room in ROOMS:
        words = (inspect.getdoc(importlib.import_module(room)) or "").splitlines()[0]
        heads.append(f"| [`{room}`]({room}.md) | {words} |")
    tree = "\n".join(ROOMS)
    write_page(
        folder / "index.md",
        "# Functions and classes\n\nEvery public name of the library, with its docstring. A page "
        "begins with examples, which run in the tests.\n\n| room | what it holds |\n| --- | --- |\n"
        + "\n".join(heads)
        + f"\n\n```{{toctree}}\n:hidden:\n:maxdepth: 1\n\n{tree}\n```\n",
    )


def setup(app: Any) -> dict[str, bool]:
    app.connect("builder-inited", make)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
