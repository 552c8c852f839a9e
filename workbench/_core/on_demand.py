"""Names that a package imports only when they are used, and messages for names that it lacks.

So somebody who uses one function of a room does not wait for all its modules to be imported.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NoReturn


def on_demand(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """``__getattr__`` and ``__dir__`` of a package whose imports only type checkers execute.

    The package imports its names under ``if TYPE_CHECKING:``, so that editors, type checkers and
    readers see ordinary imports. The statement that imports a name is executed when the name is
    first used. Rooms that the package imports from itself are found in the same way.
    """
    module = sys.modules[package]

    @cache
    def statements() -> dict[str, ast.ImportFrom]:
        tree = ast.parse(Path(str(module.__file__)).read_bytes())
        return {
            alias.asname or alias.name: statement
            for block in tree.body
            if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
            for statement in block.body
            if isinstance(statement, ast.ImportFrom)
            for alias in statement.names
        }

    def imported(name: str) -> Any:
        if name.startswith("__") or name not in statements():
            _refuse(package, name)
        # A room: executing the statement would call this function again.
        if statements()[name].module == package:
            from importlib import import_module

            return import_module(f"{package}.{name}")
        statement = ast.Module([statements()[name]], type_ignores=[])
        exec(compile(statement, str(module.__file__), "exec"), vars(module))
        return vars(module)[name]

    return imported, lambda: [*{*module.__all__, *statements()}]


def no_more_names(room: str) -> Callable[[str], NoReturn]:
    """``__getattr__`` of a room that has no names left to import."""
    return lambda name: _refuse(room, name)


def _refuse(room: str, name: str) -> NoReturn:
    """Report that a room lacks a name and, if another tool uses that name, what it is called here.

    ``from room import name`` hides the text of an AttributeError. Its first step, Python's function
    `_handle_fromlist`, passes an ImportError on, so the text is put there; that function also looks
    for modules of the room, which must raise an AttributeError. So must any other access, since
    ``hasattr`` has to answer False.
    """
    told = ""
    imported = sys._getframe(2).f_code.co_name == "_handle_fromlist"
    if not (name.startswith("_") or (imported and _is_module(f"{room}.{name}"))):
        from workbench._core.coming_from import guidance

        told = guidance(name)
    if told and imported:
        raise ImportError(f"cannot import name {name!r} from {room!r}; {told}", name=room)
    raise AttributeError(f"module {room!r} has no attribute {name!r}{told and f'; {told}'}")


def _is_module(name: str) -> bool:
    from importlib.util import find_spec

    return find_spec(name) is not None
