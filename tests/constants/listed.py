"""The numeric constants of rooms, and the same constants halved and doubled."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOMS = ("certify", "mu", "uncertainty/covers", "uncertainty/matrix_covers")
FACTORS = {"half": 0.5, "double": 2.0}


@dataclass(frozen=True)
class Constant:
    """A constant of a module or a class: ``file`` below the root, ``old`` is its assignment.

    Numbers that are assigned together are one constant, and ``name`` names all of them.
    """

    file: str
    owner: str
    name: str
    value: float | tuple[float, ...]
    old: str

    def __str__(self) -> str:
        return f"{self.file}: {self.owner}{self.name}"

    @property
    def node(self) -> tuple[str, str]:
        """What holds it in the graph of sources."""
        return self.file, self.owner.rstrip(".") or self.name.partition(",")[0]

    def times(self, factor: float) -> str:
        """The assignment with each number changed by a factor."""
        kept = self.old.partition("=")[0]
        if isinstance(self.value, tuple):
            return f"{kept}= {tuple(changed(one, factor) for one in self.value)!r}"
        return f"{kept}= {changed(self.value, factor)!r}"


def changed(value: float, factor: float) -> float:
    """A number times a factor; near 1 it is its distance from 1 that counts, as of a share.

    A count stays a count, and becomes another one.
    """
    if isinstance(value, int):
        return round(value * factor)
    return 1.0 + (value - 1.0) * factor if 0.5 < value < 2.0 and value != 1.0 else value * factor


def constants(root: Path, rooms: tuple[str, ...] = ROOMS) -> list[Constant]:
    """The numbers and tuples of numbers that rooms name, except 0 and infinity, which have no
    half.

    Fields of a class are left out: they are options of a user, and its docstring tells them.
    """
    files = [file for room in rooms for file in sorted((root / "workbench" / room).rglob("*.py"))]
    return [one for file in files for one in _of_file(root, file)]


def _of_file(root: Path, file: Path) -> Iterator[Constant]:
    text = file.read_text(encoding="utf-8")
    tree = ast.parse(text)
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    for owner, body in (("", tree.body), *((f"{one.name}.", one.body) for one in classes)):
        for node in body:
            if isinstance(node, ast.Assign):
                target = node.targets[0]
            elif isinstance(node, ast.AnnAssign) and not (owner and _is_field(node)):
                target = node.target
            else:
                continue
            value = None if node.value is None else _number(node.value)
            names = target.elts if isinstance(target, ast.Tuple) else [target]
            if value is not None and all(isinstance(one, ast.Name) for one in names):
                old = ast.get_source_segment(text, node)
                assert old is not None
                name = str(file.relative_to(root))
                yield Constant(name, owner, ", ".join(map(ast.unparse, names)), value, old)


def _is_field(node: ast.AnnAssign) -> bool:
    """Whether an assignment in a class makes a field of its instances."""
    return not ast.unparse(node.annotation).startswith("ClassVar")


def _number(node: ast.expr) -> float | tuple[float, ...] | None:
    """The value of an expression of numbers alone; None for any other."""
    allowed = (ast.Constant, ast.BinOp, ast.UnaryOp, ast.Tuple, ast.operator, ast.unaryop, ast.Load)
    if not all(isinstance(part, allowed) for part in ast.walk(node)):
        return None
    value = eval(compile(ast.Expression(node), "constant", "eval"), {})
    each = value if isinstance(value, tuple) else (value,)
    if not each or any(isinstance(one, bool) or not isinstance(one, int | float) for one in each):
        return None
    return value if all(one and math.isfinite(one) for one in each) else None
