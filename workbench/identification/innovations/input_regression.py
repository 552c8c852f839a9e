"""Regressions of outputs on inputs through a given A and C, with equality constraints."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.identification.innovations.recursions import driven_rows
from workbench.identification.innovations.regression import triangle_of_blocks

ROWS_AT_ONCE = 512
"""Samples whose regression rows are computed at a time."""
RANK_ROUNDING = 1e-12
"""A singular value below this, relative to the largest, counts as rounding."""

Pieces = Iterable[tuple[RealArray, RealArray]]


@dataclass(frozen=True, eq=False)
class InputRegression:
    """Regression of outputs on inputs through x+ = M x + B u, y = C x + D u + level.

    The unknowns are B column by column, D of the inputs that act at once, column by column, and the
    level.
    """

    M: RealArray
    C: RealArray
    at_once: tuple[bool, ...]

    @property
    def columns(self) -> int:
        """Number of unknowns."""
        ny, n = self.C.shape
        return n * len(self.at_once) + ny * sum(self.at_once) + ny

    def row(self, B: Any, D: Any) -> Any:
        """Coefficients with which B (n, m) and D (ny, m) enter, in the order of the unknowns."""
        ny = len(self.C)
        acting = D[:, np.flatnonzero(self.at_once)]
        return np.concatenate([B.T.ravel(), acting.T.ravel(), np.zeros(ny)])

    def parts(self, theta: RealArray) -> tuple[RealArray, RealArray, RealArray]:
        """B (n, m), D (ny, m) and level (ny,) of unknowns."""
        ny, n = self.C.shape
        m = len(self.at_once)
        D = np.zeros((ny, m))
        D[:, np.flatnonzero(self.at_once)] = theta[n * m : -ny].reshape(-1, ny).T
        return theta[: n * m].reshape(m, n).T, D, theta[-ny:]

    def factor(self, pieces: Pieces) -> tuple[RealArray, RealArray]:
        """Triangular factor of the rows of unknowns and outputs, with initial states eliminated.

        Also returned are the norms of the columns before the elimination: the remainder may be
        rounding.
        """
        n, count = len(self.M), self.columns + 1
        found, squares = np.zeros((0, count)), np.zeros(count)
        for u, y in pieces:
            whole = triangle_of_blocks(self._blocks(u, y), n + count)
            found = np.asarray(np.linalg.qr(np.vstack([found, whole[n:, n:]]), mode="r"))
            squares += (whole[:, n:] ** 2).sum(axis=0)
        return found, np.sqrt(squares)

    def _blocks(self, u: RealArray, y: RealArray) -> Iterator[RealArray]:
        ny, n = self.C.shape
        m, now = len(self.at_once), np.flatnonzero(self.at_once)
        driven, free = np.zeros((n, m * n)), np.eye(n)
        M, C = np.ascontiguousarray(self.M), np.ascontiguousarray(self.C)
        for first in range(0, len(u), ROWS_AT_ONCE):
            inputs = np.ascontiguousarray(u[first : first + ROWS_AT_ONCE])
            outputs = y[first : first + ROWS_AT_ONCE]
            rows = np.zeros((len(inputs), ny, n + self.columns + 1))
            driven_rows(M, C, driven, free, inputs, rows)
            at = n + m * n
            for k, j in enumerate(now):
                for o in range(ny):
                    rows[:, o, at + k * ny + o] = inputs[:, j]
            for o in range(ny):
                rows[:, o, n + self.columns - ny + o] = 1.0
                rows[:, o, -1] = outputs[:, o]
            flat = rows.reshape(-1, rows.shape[2])
            yield flat[np.isfinite(flat[:, -1])]


def constrained_least_squares(
    factor: RealArray, norms: RealArray, equations: RealArray, goals: RealArray
) -> RealArray | None:
    """Unknowns with least errors subject to equations @ unknowns = goals; None if overflow."""
    if not (np.isfinite(factor).all() and np.isfinite(equations).all()):
        return None
    scale = np.where(norms[:-1] == 0, 1.0, norms[:-1])
    R, E = factor[:, :-1] / scale, equations / scale
    size = np.linalg.norm(E, axis=1)
    size[size == 0] = 1.0
    E, goals = E / size[:, None], goals / size
    if not len(E):
        return np.asarray(np.linalg.lstsq(R, factor[:, -1], rcond=RANK_ROUNDING)[0] / scale)
    left, singular, right = np.linalg.svd(E)
    rank = int(np.sum(singular > RANK_ROUNDING * singular[0]))
    begun = right[:rank].T @ ((left.T @ goals)[:rank] / singular[:rank])
    along = right[rank:].T
    moved = np.linalg.lstsq(R @ along, factor[:, -1] - R @ begun, rcond=RANK_ROUNDING)[0]
    return np.asarray((begun + along @ moved) / scale)
