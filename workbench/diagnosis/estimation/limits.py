"""Thousands of limits on a filter with few coefficients; the few active ones are found by exchange.

A program with the limits at some frequencies is solved, and the others are checked. Neighbouring
violated limits form a run; the worst of each run joins the program, until none is violated. A
program with fewer limits is a relaxation: if it has no solution, neither has the whole; and if its
solution meets the other limits too, it is optimal for all. Source of the idea: the exchange
algorithms of semi-infinite programs; R. Hettich and K. O. Kortanek, SIAM Review 35(3), 1993.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray

STRIDE = 12
"""The first program takes every 12th of the neighbouring limits."""
SLACK = 1e-7
"""Relative violation that is ignored: the accuracy of a conic solver."""
ROUNDS = 60
"""Largest number of programs with some of the limits; the next one takes them all."""


class Limits(NamedTuple):
    """|c - A x| <= b + d E along the frequencies; of a half-plane, Re(c - A x) >= b + d / E."""

    A: ComplexArray
    c: ComplexArray
    b: RealArray
    d: RealArray | float = 0.0
    half_plane: bool = False

    def excess(self, x: RealArray, E: float) -> RealArray:
        """Violation (F,) relative to the size of the limit; negative if it is met."""
        rest = self.c - self.A @ x
        size = self.b + (self.d / max(E, 1e-300) if self.half_plane else self.d * E)
        over = size - rest.real if self.half_plane else np.abs(rest) - size
        return np.asarray(over / np.maximum(np.abs(size), 1e-300))

    def rows(self, chosen: RealArray) -> Limits:
        """The limits at some of the frequencies."""
        d = self.d[chosen] if isinstance(self.d, np.ndarray) else self.d
        return self._replace(A=self.A[chosen], c=self.c[chosen], b=self.b[chosen], d=d)


def exchanged(
    solve: Callable[[Sequence[Limits]], tuple[RealArray, float] | None], every: Sequence[Limits]
) -> tuple[RealArray, float] | None:
    """The optimum (x, E) over all limits, by programs with some of them; None without solution.

    ``solve`` solves the program with the limits that it is given, or returns None.
    """
    held = [np.arange(len(one.c)) % STRIDE == 0 for one in every]
    for _ in range(ROUNDS):
        found = solve([one.rows(rows) for one, rows in zip(every, held, strict=True)])
        if found is None:
            return None
        worst = [_worst_of_runs(one.excess(*found)) for one in every]
        more = [rows & ~old for rows, old in zip(worst, held, strict=True)]
        if not any(rows.any() for rows in more):
            return found
        held = [old | rows for old, rows in zip(held, more, strict=True)]
    return solve(every)


def _worst_of_runs(excess: RealArray) -> RealArray:
    """Mask of the largest violation in each run of neighbours."""
    around = np.concatenate([[-np.inf], excess, [-np.inf]])
    peak = (excess >= around[:-2]) & (excess > around[2:])
    return np.asarray(peak & (excess > SLACK))
