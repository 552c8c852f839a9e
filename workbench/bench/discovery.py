"""Find named problems without importing them: names, axes and help are read from the source."""

from __future__ import annotations

import ast
import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from workbench.errors import RegistryError

DECORATOR = "problem"
SETTINGS = frozenset({"needs", "data", "slow"})
"""Keywords of the decorator that are not axes of the name."""


RESERVED = ("cells", "compare", "reference", "report")
"""First parts of names that the results folder keeps for itself."""
_PART = re.compile(r"\w(?:[\w.-]*[\w-])?")


@dataclass(frozen=True)
class Entry:
    """One registered name, as its source file states it."""

    name: str
    axes: dict[str, str]
    help: str
    slow: bool
    root: Path
    file: Path
    line: int
    """Line of the ``def`` in the file."""
    function: str

    @property
    def summary(self) -> str:
        """The first line of the help."""
        return self.help.partition("\n")[0]

    @property
    def place(self) -> str:
        return f"{self.file}:{self.function}"


def scan(root: Path) -> Iterator[Entry | RegistryError]:
    """Entries of every ``@problem`` function in the Python files below a folder.

    In place of those of a file that cannot be parsed, or whose names or axes are no literals, there
    is the error: it costs the file's own names only.

    Raises
    ------
    RegistryError
        The folder does not exist.
    """
    if not root.is_dir():
        raise RegistryError(f"problem folder {root} does not exist")
    for file in sorted(root.rglob("*.py")):
        try:
            source = file.read_bytes()
            if f"{DECORATOR}(".encode() in source:
                yield from _parsed(source, root, file)
        except RegistryError as error:
            yield error
        except OSError as error:
            yield RegistryError(f"problem file {file} cannot be read: {error.strerror}")


@lru_cache(maxsize=256)
def _parsed(source: bytes, root: Path, file: Path) -> tuple[Entry, ...]:
    """Entries of a file; parsing all files takes longer than running a small problem."""
    try:
        tree = ast.parse(source.decode(), filename=str(file))
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        line = getattr(error, "lineno", None) or 1
        raise RegistryError(f"problem file {file}:{line}: {error}") from None
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    return tuple(entry for one in functions for entry in _entries(one, root, file))


def _entries(function: ast.FunctionDef, root: Path, file: Path) -> Iterator[Entry]:
    for call in function.decorator_list:
        if not (isinstance(call, ast.Call) and _name(call.func) == DECORATOR):
            continue
        where = f"{file}:{call.lineno}"
        if len(call.args) != 1:
            raise RegistryError(f"{where}: @problem takes one name, here {len(call.args)}")
        template = _literal(call.args[0], where, "the name")
        if not isinstance(template, str):
            raise RegistryError(f"{where}: the name must be a text, not {template!r}")
        keywords = {word.arg: word.value for word in call.keywords if word.arg}
        slow = _literal(keywords["slow"], where, "slow") if "slow" in keywords else False
        axes = {
            axis: _literal(value, where, f"axis {axis}")
            for axis, value in keywords.items()
            if axis not in SETTINGS
        }
        for axis, values in axes.items():
            if not (isinstance(values, tuple | list) and all(isinstance(v, str) for v in values)):
                raise RegistryError(
                    f"{where}: axis {axis} must be a tuple of texts, not {values!r}"
                )
        text = ast.get_docstring(function) or ""
        for values in itertools.product(*axes.values()):
            place = dict(zip(axes, values, strict=True))
            try:
                name = template.format(**place)
            except (KeyError, IndexError) as error:
                raise RegistryError(
                    f"{where}: the name {template!r} needs an axis for {error}"
                ) from None
            parts = name.split("/")
            if not all(map(_PART.fullmatch, parts)) or parts[0] in RESERVED:
                raise RegistryError(
                    f"{where}: {name!r} is no problem name; needed are words of letters, digits, "
                    f"'_', '-', '.' with '/' between, the first none of {', '.join(RESERVED)}"
                )
            yield Entry(name, place, text, slow, root, file, function.lineno, function.name)


def _name(node: ast.expr) -> str:
    if isinstance(node, ast.Attribute):
        return node.attr
    return node.id if isinstance(node, ast.Name) else ""


def _literal(node: ast.expr, where: str, what: str) -> Any:
    try:
        return ast.literal_eval(node)
    except ValueError:
        raise RegistryError(
            f"{where}: {what} must be a literal, it is read without importing the file"
        ) from None
