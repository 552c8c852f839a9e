"""Where the central path was lost: from its multipliers again, in a frame where they are simple.

Near a matrix with real eigenvalues that leave the axis, or that is nearly reducible, the least
bound needs a D with eigenvalues so far apart that numbers tell them no longer. With D = L^H L of
the path's end,

    M' = L_c M L_r^-1,   D' = I,   G' = L_r^-H G L_c^-1

is the same problem, and its path can be followed farther.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import solve_triangular

from workbench.arrays import ComplexArray
from workbench.certify.mu_bound import certified
from workbench.mu.upper.balance import balance
from workbench.mu.upper.path import follow
from workbench.mu.upper.pattern import IM, Pattern, fill, spread
from workbench.structure import Structure

SHARES = np.array([0.0, 1e-15, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-6, 1e-4])
"""Of its own diagonal, added to a D that is nearly singular."""
INWARD = (0.0, 1e-8, 1e-4, 1e-1)
"""Of its own diagonal, added to a D from which no good path starts, one after the other."""
ROUNDS = 8
ITERATIONS = 60
RISES = (1.05, 1.5, 4.0)
"""Factors on the bound's square, at which a path is taken up again."""
WORTH = 0.999
"""A round that leaves more than this share of the bound is the last one."""
NOTHING = 1e-4
"""Share of the balanced norm at which a bound is nothing that more rounds could improve."""

Multipliers = tuple[ComplexArray, ComplexArray]


def recentred(
    M: ComplexArray,
    structure: Structure,
    pattern: Pattern,
    start: Multipliers,
    gap: float,
    accuracy: float,
) -> tuple[ComplexArray, ComplexArray, float]:
    """Compact D and G (N, N) of one matrix with a bound no larger than what the start proves.

    Parameters
    ----------
    M
        Complex (c, r), finite.
    start
        Compact D and G where the path ended, D perhaps singular up to rounding.
    gap, accuracy
        As `follow` has them.

    Returns
    -------
    D, G, and the duality gap of the bound's square, relative, rounding included; infinite where it
    is not known.
    """
    D, G, value = _proper(M, structure, pattern, start)
    gap, from_edge = gap if np.array_equal(D, start[0]) else np.inf, 0
    nothing = NOTHING * _balanced(M, pattern)[1]
    for _ in range(ROUNDS):
        if not value > nothing:
            break
        again = _followed(M, structure, pattern, (D, G), value, accuracy, INWARD[from_edge])
        if again is not None:
            next_D, next_G, next_value, next_gap = again
            if next_value <= value * (1 + accuracy):
                gap = min(gap, next_gap)
            worth = next_value < WORTH * value
            if next_value < value:
                D, G, value = next_D, next_G, next_value
            if gap <= accuracy:
                break
            if worth:
                continue
        from_edge += 1
        if from_edge == len(INWARD):
            break
    return D, G, gap


def _proper(
    M: ComplexArray, structure: Structure, pattern: Pattern, given: Multipliers
) -> tuple[ComplexArray, ComplexArray, float]:
    """Of D with some of its diagonal added, and of a balancing D, the one with the least bound."""
    D, G = given
    own = np.diagonal(D).real
    balancing, _ = _balanced(M, pattern)
    trials_D = np.concatenate(
        [D + SHARES[:, None, None] * np.diag(own), [np.diag(balancing**2)], [np.eye(pattern.size)]]
    )
    trials_G = np.concatenate([np.tile(G, (len(SHARES), 1, 1)), 0.0 * np.array([G, G])])
    trials_D[~np.isfinite(trials_D)] = 0.0
    trials_G[~np.isfinite(trials_G)] = 0.0
    tiled = np.broadcast_to(M, (len(trials_D), *M.shape))
    values = certified(tiled, structure, *spread(pattern, trials_D, trials_G))
    best = int(np.argmin(values))
    return trials_D[best], trials_G[best], float(values[best])


def _balanced(M: ComplexArray, pattern: Pattern) -> tuple[np.ndarray, float]:
    """Osborne's scaling (N,), and the Frobenius norm of the scaled M."""
    scaling = np.ones(pattern.size)
    if not M.any():
        return scaling, 0.0
    size = float(np.ldexp(1.0, np.frexp(np.abs(M).max())[1]))
    return scaling, size * balance(pattern, M / size, scaling)


def _followed(
    M: ComplexArray,
    structure: Structure,
    pattern: Pattern,
    given: Multipliers,
    value: float,
    accuracy: float,
    inward: float,
) -> tuple[ComplexArray, ComplexArray, float, float] | None:
    """D, G, what they prove and its gap, from the path in the frame where the given D is 1.

    Beforehand a share ``inward`` of its diagonal is added to D. None where no path starts.
    """
    D, G = given
    D = D + inward * np.diag(np.diagonal(D).real)
    if inward:
        value = float(certified(M, structure, *spread(pattern, D, G)))
    root = np.sqrt(np.diagonal(D).real)
    try:
        R: Any = np.linalg.cholesky(D / root / root[:, None]).conj().T * root
    except np.linalg.LinAlgError:
        return None
    back: Any = solve_triangular(R, np.eye(pattern.size))
    left, _, _ = spread(pattern, R, G)
    _, right, _ = spread(pattern, back, G)
    framed = np.ascontiguousarray(left @ (M / value) @ right)
    twist: Any = back.conj().T @ (G / value) @ back
    if not (np.isfinite(framed).all() and np.isfinite(twist).all()):
        return None
    start = _unknowns(pattern, np.eye(pattern.size), (twist + twist.conj().T) / 2)
    for rise in RISES:
        x, early = start.copy(), np.zeros_like(start)
        _, gap, iterations = follow(framed, pattern, rise, x, early, accuracy, ITERATIONS)
        if iterations:
            new_D, new_G = np.zeros_like(D), np.zeros_like(G)
            fill(pattern, x, new_D, new_G)
            there = float(certified(framed, structure, *spread(pattern, new_D, new_G))) * value
            after: Multipliers = (R.conj().T @ new_D @ R, R.conj().T @ new_G @ R * value + 0j)
            new_D, new_G, proved = _proper(M, structure, pattern, after)
            # What rounding adds on the way back is not the path's to know.
            with np.errstate(all="ignore"):
                lost = max((proved / there) ** 2 - 1, 0.0) if there > 0 else np.inf
            return new_D, new_G, proved, gap + (lost if np.isfinite(there) else np.inf)
    return None


def _unknowns(pattern: Pattern, D: Any, G: Any) -> np.ndarray:
    """The unknowns whose `fill` is D and G."""
    entries = np.where(pattern.skew, G[pattern.row, pattern.column], D[pattern.row, pattern.column])
    return np.where(pattern.kind == IM, entries.imag, entries.real)
