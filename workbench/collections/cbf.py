"""Conic programs in the conic benchmark format (``.cbf``, versions 1 to 3), without integers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from os import PathLike

import numpy as np

from workbench.certify.cones.form import ConeFactor, ConeKind
from workbench.collections.lines import Entries, Lines
from workbench.conic import ConicProgram

KINDS = {
    "L=": ConeKind.ZERO,
    "L+": ConeKind.NONNEGATIVE,
    "L-": ConeKind.NONNEGATIVE,
    "Q": ConeKind.SECOND_ORDER,
    "QR": ConeKind.SEMIDEFINITE,
}
"""Kinds of cones by their keyword. A rotated cone is rewritten exactly as the arrow matrix (2 s_1,
v'; v, s_2 I).
"""
FREE = "F"
SIZES = ("VAR", "CON")
MATRICES = ("PSDVAR", "PSDCON")


@dataclass
class _Part:
    """Scalars (variables or constraints) by cone: keyword, size and first scalar of each."""

    cones: list[tuple[str, int, int]] = field(default_factory=list)
    count: int = 0


@dataclass
class _File:
    """Everything that has been read from a file so far."""

    lines: Lines
    maximise: bool = False
    parts: dict[str, _Part] = field(default_factory=lambda: {name: _Part() for name in SIZES})
    orders: dict[str, list[int]] = field(default_factory=lambda: {name: [] for name in MATRICES})
    numbers: dict[str, list[tuple[list[int], float, int]]] = field(default_factory=dict)
    """Coordinates by keyword: indices, value and line number of each."""
    constant: float = 0.0

    def entries(self, keyword: str) -> Iterator[tuple[list[int], float]]:
        """Indices and values of a keyword, each checked; an error names the line."""
        orders = {"matrix": self.orders["PSDVAR"], "matrix constraint": self.orders["PSDCON"]}
        counts = {"variable": self.parts["VAR"].count, "constraint": self.parts["CON"].count}
        known = set()
        for where, value, number in self.numbers.get(keyword, []):
            self.lines.number = number
            for what, place in zip(_PLACES[keyword], where, strict=True):
                if what in orders:
                    counts |= {what: len(orders[what])}
                    if place < len(orders[what]):
                        counts |= dict.fromkeys("ij", orders[what][place])
                if place >= counts[what]:
                    raise self.lines.error(f"{what} {place}, there are {counts[what]}")
            free = where[:-2] if "i" in _PLACES[keyword] else where
            entry = (*free, *sorted(where[len(free) :]))
            if entry in known:
                raise self.lines.error("this entry was given before")
            known.add(entry)
            yield where, value


def read_cbf(file: str | PathLike[str]) -> ConicProgram:
    r"""Read a program with linear, second-order, rotated and semidefinite cones.

    Parameters
    ----------
    file
        A file in the conic benchmark format (H. A. Friberg, CBLIB 2014, Mathematical Programming
        Computation 8, 2016).

    Returns
    -------
    ConicProgram
        ``x`` holds the scalar variables, then the upper triangles of the matrix variables, column
        by column. If the file maximises, the program minimises the negated objective; the metric
        ``value`` is the objective of the file.

    Raises
    ------
    InputError
        The file is missing or malformed, or has integer variables, or exponential or power cones;
        the message names the line.

    Examples
    --------
    >>> from pathlib import Path
    >>> import workbench as wb
    >>> from workbench.collections import read_cbf
    >>> file = Path("least.cbf")  # the least x of x >= 3
    >>> head = ["VER", "1", "OBJSENSE", "MIN", "VAR", "1 1", "F 1", "CON", "1 1", "L+ 1"]
    >>> body = ["OBJACOORD", "1", "0 1.0", "ACOORD", "1", "0 0 1.0", "BCOORD", "1", "0 -3.0"]
    >>> _ = file.write_text("\n".join(head + body))
    >>> round(wb.solve(read_cbf(file), method="clarabel").metrics["value"], 5)
    3.0
    """
    lines = Lines(file, "#")
    found = _File(lines)
    keyword = lines.needed("VER")
    if keyword != "VER":
        raise lines.error(f"a file begins with VER, not with {keyword!r}")
    if (version := lines.whole(lines.needed("the version"), "the version", 1)) > 3:
        raise lines.error(f"version {version}; 1, 2 and 3 are read")
    while (keyword := lines.following() or "") != "":
        reader = _READERS.get(keyword)
        if reader is None:
            raise lines.error(
                f"{keyword[:40]!r} is not read; keywords are {', '.join(sorted(_READERS))}"
            )
        reader(found, keyword)
    return _program(found)


# --- keywords -----------------------------------------------------------------------------------


def _sense(found: _File, keyword: str) -> None:
    sense = found.lines.needed("MIN or MAX")
    if sense not in ("MIN", "MAX"):
        raise found.lines.error(f"the sense is MIN or MAX, not {sense!r}")
    found.maximise = sense == "MAX"


def _cones(found: _File, keyword: str) -> None:
    lines, part = found.lines, found.parts[keyword]
    cells = lines.needed("numbers of scalars and of cones").split()
    if len(cells) != 2:
        raise lines.error(f"{len(cells)} numbers; needed are those of scalars and of cones")
    count = lines.whole(cells[0], "the number of scalars")
    for _ in range(lines.whole(cells[1], "the number of cones")):
        name, *size = lines.needed("a cone").split()
        if name not in KINDS and name != FREE:
            raise lines.error(f"cone {name!r}; {', '.join([FREE, *KINDS])} are read")
        least = {"Q": 1, "QR": 2}.get(name, 0)
        if len(size) != 1:
            raise lines.error(f"cone {name} needs one size, not {size}")
        part.cones.append((name, lines.whole(size[0], f"the size of {name}", least), part.count))
        part.count += part.cones[-1][1]
    if part.count != count:
        raise lines.error(f"the cones of {keyword} have {part.count} scalars, not {count}")


def _matrices(found: _File, keyword: str) -> None:
    lines = found.lines
    count = lines.whole(lines.needed("the number of matrices"), "the number of matrices")
    for _ in range(count):
        found.orders[keyword].append(lines.whole(lines.needed("an order"), "the order", 1))


def _coordinates(found: _File, keyword: str) -> None:
    lines, places = found.lines, _PLACES[keyword]
    known = found.numbers.setdefault(keyword, [])
    for _ in range(lines.whole(lines.needed("a number of entries"), "the number of entries")):
        cells = lines.needed("an entry").split()
        if len(cells) != len(places) + 1:
            raise lines.error(f"{len(cells)} numbers; {', '.join(places)} and value are needed")
        where = [lines.whole(cell, what) for cell, what in zip(cells, places, strict=False)]
        known.append((where, lines.real(cells[-1], "the value"), lines.number))


def _constant(found: _File, keyword: str) -> None:
    found.constant = found.lines.real(found.lines.needed("a number"), "the constant")


_PLACES = {
    "OBJFCOORD": ("matrix", "i", "j"),
    "OBJACOORD": ("variable",),
    "FCOORD": ("constraint", "matrix", "i", "j"),
    "ACOORD": ("constraint", "variable"),
    "BCOORD": ("constraint",),
    "HCOORD": ("matrix constraint", "variable", "i", "j"),
    "DCOORD": ("matrix constraint", "i", "j"),
}
_READERS: dict[str, Callable[[_File, str], None]] = {
    "OBJSENSE": _sense,
    **dict.fromkeys(SIZES, _cones),
    **dict.fromkeys(MATRICES, _matrices),
    **dict.fromkeys(_PLACES, _coordinates),
    "OBJBCOORD": _constant,
}


# --- the program --------------------------------------------------------------------------------


def _program(found: _File) -> ConicProgram:
    lines, scalars = found.lines, found.parts["VAR"].count
    variables = _starts(found.orders["PSDVAR"], scalars)
    constraints = _starts(found.orders["PSDCON"], found.parts["CON"].count)
    # scalar constraints, then matrix constraints, before they are assigned to cones
    rows = Entries(lines)
    c = np.zeros(variables[-1])

    for (j,), value in found.entries("OBJACOORD"):
        c[j] = value
    for (m, i, j), value in found.entries("OBJFCOORD"):
        c[variables[m] + _place(i, j)] = value if i == j else 2 * value
    for (row, column), value in found.entries("ACOORD"):
        rows.put(row, column, value)
    for (row, m, i, j), value in found.entries("FCOORD"):
        rows.put(row, variables[m] + _place(i, j), value if i == j else 2 * value)
    for (row,), value in found.entries("BCOORD"):
        rows.put(row, None, value)
    for (m, column, i, j), value in found.entries("HCOORD"):
        rows.put(constraints[m] + _place(i, j), column, value)
    for (m, i, j), value in found.entries("DCOORD"):
        rows.put(constraints[m] + _place(i, j), None, value)
    slack = _Slack(lines, rows)
    for name, size, start in found.parts["CON"].cones:
        slack.put(name, [_Row(start + k, None) for k in range(size)])
    for m, order in enumerate(found.orders["PSDCON"]):
        slack.matrix(order, [_Row(constraints[m] + k, None) for k in range(_triangle(order))])
    for name, size, start in found.parts["VAR"].cones:
        slack.put(name, [_Row(None, start + k) for k in range(size)])
    for m, order in enumerate(found.orders["PSDVAR"]):
        slack.matrix(order, [_Row(None, variables[m] + k) for k in range(_triangle(order))])
    sign = -1.0 if found.maximise else 1.0
    return ConicProgram(
        slack.found.form(sign * c, slack.cones), constant=found.constant, maximise=found.maximise
    )


@dataclass(frozen=True)
class _Row:
    """A constraint of the file, or a variable itself, as an affine row."""

    row: int | None
    variable: int | None


@dataclass
class _Slack:
    """The slack of the conic form, built cone by cone from rows of the file."""

    lines: Lines
    rows: Entries
    cones: list[ConeFactor] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.found = Entries(self.lines)
        self.count = 0
        self.by_row: dict[int, list[tuple[int, float]]] = {}
        for (row, column), value in self.rows.rows.items():
            self.by_row.setdefault(row, []).append((column, value))

    def put(self, name: str, rows: Sequence[_Row]) -> None:
        """Add scalars that lie in a cone of the file."""
        if name == FREE or not rows:
            return
        if name == "QR":
            self._arrow(rows)
            return
        self.cones.append(ConeFactor(KINDS[name], len(rows)))
        for row in rows:
            self._add(row, -1.0 if name == "L-" else 1.0)

    def matrix(self, order: int, triangle: Sequence[_Row]) -> None:
        """Add the upper triangle of a positive semidefinite matrix."""
        self.cones.append(ConeFactor(ConeKind.SEMIDEFINITE, order))
        for row in triangle:
            self._add(row, 1.0)

    def _arrow(self, rows: Sequence[_Row]) -> None:
        """Add 2 s_1 s_2 >= |v|^2 with s_1, s_2 >= 0, as the matrix (2 s_1, v'; v, s_2 I)."""
        first, second, *v = rows
        order = 1 + max(len(v), 1)
        self.cones.append(ConeFactor(ConeKind.SEMIDEFINITE, order))
        for j in range(order):
            for i in range(j + 1):
                if i == j:
                    self._add(first if i == 0 else second, 2.0 if i == 0 else 1.0)
                else:
                    self._add(v[j - 1] if i == 0 and v else None, 1.0)

    def _add(self, row: _Row | None, factor: float) -> None:
        if row is not None and row.variable is not None:
            self.found.put(self.count, row.variable, factor)
        elif row is not None and row.row is not None:
            for column, value in self.by_row.get(row.row, []):
                self.found.put(self.count, column, factor * value)
            if row.row in self.rows.constant:
                self.found.put(self.count, None, factor * self.rows.constant[row.row])
        self.count += 1


def _place(i: int, j: int) -> int:
    """Index of an entry in the upper triangle, column by column."""
    i, j = sorted((i, j))
    return j * (j + 1) // 2 + i


def _triangle(order: int) -> int:
    return order * (order + 1) // 2


def _starts(orders: Sequence[int], first: int) -> list[int]:
    """First index of each triangle, and the index after the last one."""
    return [first, *(first + np.cumsum([_triangle(n) for n in orders], dtype=int)).tolist()]
