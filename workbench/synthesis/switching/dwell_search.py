"""Search for the shortest dwell time, common to all methods that prove one dwell time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import matrix_balance, solve_discrete_lyapunov

from workbench._core.arrays import RealArray
from workbench.executor import Context
from workbench.synthesis.switching.program import FALL_MARGIN, Dwell, SwitchedStability

MOST_CUTS = 12
"""Largest number of rounds that add stays with violated inequalities."""
FIRST_STAYS = 5
"""Number of stays of each mode whose inequalities are stated in the first round."""


def shortest_proven(
    program: SwitchedStability, proven: Callable[[int], Dwell | None], context: Context
) -> Dwell | None:
    """The shortest dwell time that `proven` proves; None where it proves none.

    Dwell times that a periodic switching makes unstable are not tried. The step is doubled until a
    dwell time is proven; then the interval is halved again and again.
    """
    failed, step = program.destabilising[0], 1

    def tried(samples: int) -> Dwell | None:
        found = None
        for _ in context.track([samples], "dwell time"):
            found = proven(samples)
        return found

    best = None
    while best is None and failed < program.limit_samples:
        trial = min(failed + step, program.limit_samples)
        best = tried(trial)
        if best is None:
            failed, step = trial, 2 * step
    while best is not None and best.samples - failed > 1:
        middle = (failed + best.samples) // 2
        found = tried(middle)
        if found is None:
            failed = middle
        else:
            best = found
    return best


def coordinates(program: SwitchedStability) -> RealArray:
    """L (n, n) of coordinates L' x in which all states have similar sizes.

    L L' is the sum, over modes and plants, of the values of V = x' Q x during a stay,

        sum (A^k)' Q A^k,    k = 0, 1, ..., longest,

    where Q holds the squares of the units that balance sum |A|. One mode alone would not fix the
    scale of states that only another mode uses.
    """
    every = np.concatenate([mode.A for mode in program.modes])
    _, (units, _) = matrix_balance(abs(every).sum(axis=0), permute=False, separate=True)
    sums = [
        _sum_of_powers(A / units[:, None] * units, mode.longest_samples)
        for mode in program.modes
        for A in (mode.A if mode.longest_samples else mode.decaying)
    ]
    root = np.linalg.cholesky(symmetric(np.sum(sums, axis=0)))
    return np.asarray(root / units[:, None], dtype=float)


def _sum_of_powers(A: RealArray, longest: int | None) -> RealArray:
    """Sum of (A^k)' A^k for k = 0, ..., longest; for a stable A without a longest stay, all k."""
    if longest is None:
        return np.asarray(solve_discrete_lyapunov(A.T, np.eye(len(A))))
    total = power = np.eye(len(A))
    for _ in range(longest):
        power = A @ power
        total = total + power.T @ power
    return total


def first_stays(stays: range) -> list[int]:
    """A few of the stays to start with, including the first and the last."""
    places = np.unique(np.geomspace(1, len(stays), FIRST_STAYS).round().astype(int)) - 1
    return [stays[int(place)] for place in places]


def added_stays(
    program: SwitchedStability, samples: int, stays: list[list[int]], ratios: list[RealArray]
) -> bool:
    """Add to each mode the stay whose inequality is violated most. True if a stay was added."""
    added = False
    for mode, own, ratio in zip(program.modes, stays, ratios, strict=True):
        worst = program.stays(mode, samples)[int(np.argmax(ratio))]
        if ratio.max() > 1.0 - FALL_MARGIN and worst not in own:
            own.append(worst)
            added = True
    return added


def congruent(A: RealArray, L: RealArray) -> RealArray:
    """A (V, n, n) transformed to coordinates L' x."""
    return np.asarray(np.linalg.solve(L, (L.T @ A).mT).mT, dtype=float)


def symmetric(P: RealArray) -> RealArray:
    """The symmetric part."""
    both: RealArray = (P + P.T) / 2
    return both
