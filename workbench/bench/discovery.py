"""Find named problems in source files: names, axes and help are read without importing them.

A file is imported only if a function gives the values of an axis.
"""

from __future__ import annotations

import ast
import itertools
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from workbench.errors import RegistryError

DECORATOR = "problem"
SETTINGS = frozenset({"needs", "data", "slow", "method", "added"})
"""Keywords of the decorator that are not axes of the name."""


RESERVED = ("cells", "compare", "reference", "report", "sweep")
"""First parts of names that are reserved for the results folder."""
_PART = re.compile(r"\w(?:[\w.-]*[\w-])?")
_ADDS_METHODS = re.compile(
    rb"^(?:@(?:\w+\.)*(?:conic_)?method|(?:\w+\.)*(?:add_)?conic_solver)\(", re.MULTILINE
)


@dataclass(frozen=True)
class Entry:
    """One registered name, as its source file declares it."""

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
        """The first paragraph of the help, in one line."""
        return " ".join(self.help.partition("\n\n")[0].split())

    @property
    def place(self) -> str:
        return f"{self.file}:{self.function}"

    @property
    def folder(self) -> Path:
        """The plant's folder; paths of data files are relative to it."""
        return plant_folder(self.root, self.file)


def plant_folder(root: Path, file: Path) -> Path:
    """The first folder below a problem folder on the way to a file, or the problem folder."""
    first = root / file.relative_to(root).parts[0]
    return first if first.is_dir() else root


@dataclass(frozen=True)
class AxisFunction:
    """A function without arguments, in a problem's file, that returns the values of an axis."""

    root: Path
    file: Path
    name: str


Call = Callable[[AxisFunction], Any]
"""Calls the function of an axis, for which its file is imported."""


@dataclass(frozen=True)
class _Declared:
    """A ``@problem`` in the source: a name template over axes from texts, files, or functions."""

    template: str
    axes: tuple[tuple[str, Any], ...]
    help: str
    slow: bool
    root: Path
    file: Path
    line: int
    function: str
    where: str

    def entries(self, call: Call) -> Iterator[Entry]:
        """An entry for each combination of the axes' values."""
        values = [self._values(axis, given, call) for axis, given in self.axes]
        for chosen in itertools.product(*values):
            place = dict(zip((axis for axis, _ in self.axes), chosen, strict=True))
            name = self.name(place)
            yield Entry(
                name, place, self.help, self.slow, self.root, self.file, self.line, self.function
            )

    def _values(self, axis: str, given: Any, call: Call) -> Sequence[str]:
        if isinstance(given, str):
            return self.files(given)
        if not isinstance(given, AxisFunction):
            return tuple(given)
        values = call(given)
        return _texts(list(values) if isinstance(values, Iterable) else values, axis, self.where)

    def files(self, pattern: str) -> list[str]:
        """The texts that the star of a pattern matches in existing files."""
        before, after = pattern.split("*")
        folder = plant_folder(self.root, self.file)
        found = (file.relative_to(folder).as_posix() for file in folder.glob(pattern))
        return sorted(one[len(before) : len(one) - len(after)] for one in found)

    def name(self, place: dict[str, str]) -> str:
        try:
            name = self.template.format(**place)
        except (KeyError, IndexError) as error:
            raise RegistryError(
                f"{self.where}: the name {self.template!r} needs an axis for {error}"
            ) from None
        parts = name.split("/")
        if not all(map(_PART.fullmatch, parts)) or parts[0] in RESERVED:
            raise RegistryError(
                f"{self.where}: {name!r} is no problem name; needed are words of letters, digits, "
                f"'_', '-', '.' with '/' between, the first none of {', '.join(RESERVED)}"
            )
        return name


def scan(root: Path, call: Call) -> Iterator[Entry | RegistryError]:
    """Entries of every ``@problem`` function in the Python files below a folder.

    If a file cannot be parsed, its names are no literals, or its axes cannot be found, an error
    takes the place of its entries; other files are not affected. ``call`` as in `Call`.

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
                for one in _parsed(source, root, file):
                    yield from one.entries(call)
        except RegistryError as error:
            yield error
        except OSError as error:
            yield RegistryError(f"problem file {file} cannot be read: {error.strerror}")


def method_files(root: Path) -> list[Path]:
    """The Python files below a folder that register methods or solvers when imported."""
    return [file for file in sorted(root.rglob("*.py")) if _adds_methods(file)]


def _adds_methods(file: Path) -> bool:
    try:
        return _ADDS_METHODS.search(file.read_bytes()) is not None
    except OSError:  # `scan` reports the error
        return False


@lru_cache(maxsize=256)
def _parsed(source: bytes, root: Path, file: Path) -> tuple[_Declared, ...]:
    """Declarations of a file; cached, since parsing all files takes longer than a small problem."""
    try:
        tree = ast.parse(source.decode(), filename=str(file))
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        line = getattr(error, "lineno", None) or 1
        raise RegistryError(f"problem file {file}:{line}: {error}") from None
    functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    values = {
        target.id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
    }

    def axis_of(node: ast.expr, where: str, what: str) -> Any:
        """A literal, or the value of a name or of a function in the file."""
        if isinstance(node, ast.Name) and node.id in functions:
            return AxisFunction(root, file, node.id)
        named = values.get(node.id, node) if isinstance(node, ast.Name) else node
        return _literal(named, where, what)

    return tuple(
        found for one in functions.values() for found in _declared(one, root, file, axis_of)
    )


def _declared(
    function: ast.FunctionDef, root: Path, file: Path, axis_of: Callable[..., Any]
) -> Iterator[_Declared]:
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
            axis: axis_of(value, where, f"axis {axis}")
            for axis, value in keywords.items()
            if axis not in SETTINGS
        }
        for axis, values in axes.items():
            pattern = isinstance(values, str) and values.count("*") == 1
            if not (pattern or isinstance(values, AxisFunction)):
                _texts(values, axis, where)
        text = ast.get_docstring(function) or ""
        one = _Declared(
            template,
            tuple(axes.items()),
            text,
            slow,
            root,
            file,
            function.lineno,
            function.name,
            where,
        )
        # A wrong name affects its own file only.
        told = {axis: v[0] if isinstance(v, list | tuple) else "x" for axis, v in axes.items() if v}
        one.name(told)
        yield one


def _texts(values: Any, axis: str, where: str) -> Sequence[str]:
    """The values of an axis, checked."""
    if not (isinstance(values, tuple | list) and all(isinstance(v, str) for v in values)):
        raise RegistryError(
            f"{where}: axis {axis} must be a tuple of texts, a pattern of files with one star, or "
            f"a function that returns texts, not {values!r}"
        )
    return values


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
