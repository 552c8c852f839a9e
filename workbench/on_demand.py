"""Names that a package imports when they are first asked for.

A user of one function of a room does not wait for all of its modules.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any


def on_demand(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """``__getattr__`` and ``__dir__`` of a package whose imports stand for type checkers only.

    The package imports its names under ``if TYPE_CHECKING:``, so that editors, type checkers and
    readers see ordinary imports; the statement that binds a name runs when the name is first asked
    for, by Python's own rules.
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
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        statement = ast.Module([statements()[name]], type_ignores=[])
        exec(compile(statement, str(module.__file__), "exec"), vars(module))
        return vars(module)[name]

    return imported, lambda: module.__all__
