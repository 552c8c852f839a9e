"""Data of a conic program in standard form, and its cones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.input_checks import as_array, as_list, need_kind


class ConeKind(StrEnum):
    """The self-dual cones that conic solvers share, and the zero cone, whose dual is the space.

    Examples
    --------
    >>> from workbench.conic import ConeKind
    >>> ConeKind.SECOND_ORDER.name
    'SECOND_ORDER'
    """

    ZERO = "zero"
    NONNEGATIVE = "nonnegative"
    SECOND_ORDER = "second order"
    SEMIDEFINITE = "semidefinite"


@dataclass(frozen=True)
class ConeFactor:
    """A cone and its size: number of rows, or for semidefinite matrices their order.

    A second-order cone is |(s_2, ..., s_n)| <= s_1. A symmetric matrix is given by its upper
    triangle, column by column: S_11, S_12, S_22, S_13, ..., without factors.

    Examples
    --------
    >>> from workbench.conic import ConeFactor, ConeKind
    >>> ConeFactor(ConeKind.SEMIDEFINITE, 3).rows  # the upper triangle of a 3 by 3 matrix
    6
    """

    kind: ConeKind
    size: int

    @property
    def rows(self) -> int:
        """Number of rows of the form that belong to the cone."""
        triangle = self.kind is ConeKind.SEMIDEFINITE
        return self.size * (self.size + 1) // 2 if triangle else self.size


def triangle(order: int) -> list[tuple[int, int]]:
    """Places (i, j), i <= j, of the upper triangle of a matrix of an order, column by column."""
    return [(i, j) for j in range(order) for i in range(j + 1)]


@dataclass(frozen=True, eq=False)
class ConicForm:
    """The conic program

        minimise c'x subject to b - A x in K,

    where K is a product of cones, in the order of the rows. Its doubles are taken as exact.

    Parameters
    ----------
    c, A, b
        Finite, of shapes (n,), (m, n) and (m,); A may be a sparse array.
    cones
        The factors of K; their rows add up to m.

    Raises
    ------
    InputError
        A shape that does not fit, a number that is not finite, or a cone of no size.

    Examples
    --------
    >>> from workbench.conic import ConeFactor, ConeKind, ConicForm
    >>> cones = (ConeFactor(ConeKind.NONNEGATIVE, 2),)
    >>> form = ConicForm([1.0], [[-1.0], [1.0]], [-2.0, 5.0], cones)
    >>> form.A.shape  # x >= 2 and x <= 5
    (2, 1)
    """

    c: RealArray
    A: Any
    b: RealArray
    cones: tuple[ConeFactor, ...]

    def __post_init__(self) -> None:
        from scipy.sparse import csr_array, issparse

        for name in ("c", "b"):
            given = as_array(getattr(self, name), name)
            object.__setattr__(self, name, np.atleast_1d(given))
        A = self.A if issparse(self.A) else np.atleast_2d(as_array(self.A, "A"))
        if A.ndim != 2:
            raise InputError(f"A has shape {A.shape}; (m, n) is needed")
        object.__setattr__(self, "A", csr_array(A, dtype=float))
        object.__setattr__(self, "cones", tuple(as_list(self.cones, "cones")))
        for cone in self.cones:
            need_kind(cone, ConeFactor, "each of cones")
        shapes = self.c.shape, self.A.shape, self.b.shape
        if shapes != ((self.c.size,), (self.b.size, self.c.size), (self.b.size,)):
            raise InputError(f"c, A and b have shapes {shapes}; (n,), (m, n) and (m,) are needed")
        if not all(np.isfinite(part).all() for part in (self.c, self.A.data, self.b)):
            raise InputError("c, A and b must be finite")
        if any(cone.size < 1 for cone in self.cones):
            raise InputError("every cone must have a size of 1 or more")
        rows = sum(cone.rows for cone in self.cones)
        if rows != self.b.size:
            raise InputError(f"the cones have {rows} rows, A has {self.b.size}")

    @property
    def blocks(self) -> Iterator[tuple[ConeFactor, slice]]:
        """The cones with their rows."""
        start = 0
        for cone in self.cones:
            yield cone, slice(start, start + cone.rows)
            start += cone.rows
