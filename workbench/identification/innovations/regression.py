"""Triangular factors of long regressions, built in blocks, so that little memory is used.

A regression on lagged samples needs only the triangular factor of its rows, never their squares; so
no accuracy is lost with coloured inputs or different units.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import RealArray

BLOCK = 4096
"""Number of rows that are factored at a time."""
LEAST_NOISE = 1e-12
"""A noise variance below this, relative to that of the output, counts as rounding."""


def triangle_of_blocks(blocks: Iterable[RealArray], columns: int) -> RealArray:
    """Upper triangular factor (columns, columns) of rows that come in blocks (T, columns)."""
    found = np.zeros((0, columns))
    for block in blocks:
        found = np.asarray(np.linalg.qr(np.vstack([found, block]), mode="r"))
    if len(found) < columns:
        found = np.vstack([found, np.zeros((columns - len(found), columns))])
    return np.asarray(found)


@dataclass(frozen=True, eq=False)
class LaggedTriangle:
    """Triangular factor of rows (1, lag 1, ..., lag p, now) of signals, now = (u, y).

    ``channels`` is nu + ny, ``rows`` the number of rows that were factored.
    """

    factor: RealArray
    past: int
    channels: int
    rows: int

    @property
    def history(self) -> slice:
        """Number of columns with lagged samples, the latest first."""
        return slice(1, 1 + self.past * self.channels)

    def shorter(self, past: int) -> LaggedTriangle:
        """The factor with fewer lags."""
        end = 1 + past * self.channels
        kept = np.r_[0:end, self.factor.shape[1] - self.channels : self.factor.shape[1]]
        return LaggedTriangle(
            np.asarray(np.linalg.qr(self.factor[:, kept], mode="r")), past, self.channels, self.rows
        )


def lagged_triangle(
    pieces: Iterable[tuple[RealArray, RealArray]], past: int, channels: int
) -> LaggedTriangle:
    """Factor of the lagged samples of experiments u (N, nu), y (N, ny); see `LaggedTriangle`.

    Rows with a missing sample are left out.
    """
    columns, rows = 1 + (past + 1) * channels, 0

    def blocks() -> Iterable[RealArray]:
        nonlocal rows
        for u, y in pieces:
            joint = np.hstack([u, y])
            for first in range(0, len(joint) - past, BLOCK):
                end = min(first + BLOCK, len(joint) - past)
                block = np.empty((end - first, columns))
                block[:, 0] = 1.0
                for lag in range(1, past + 1):
                    place = 1 + (lag - 1) * channels
                    block[:, place : place + channels] = joint[
                        first + past - lag : end + past - lag
                    ]
                block[:, -channels:] = joint[first + past : end + past]
                known = np.isfinite(block).all(axis=1)
                rows += int(known.sum())
                yield block[known]

    factor = triangle_of_blocks(blocks(), columns)
    return LaggedTriangle(factor, past, channels, rows)


def least_squares(regressors: RealArray, targets: RealArray) -> RealArray:
    """Matrix X (targets, regressors) that minimises |targets - regressors X^T|.

    Columns are scaled first; directions without information get zero.
    """
    scale = np.linalg.norm(regressors, axis=0)
    scale[scale == 0] = 1.0
    found = np.linalg.lstsq(regressors / scale, targets, rcond=None)[0]
    return np.asarray((found / scale[:, None]).T)
