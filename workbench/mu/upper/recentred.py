"""Recentring: continuing a lost central path in coordinates where its multipliers are simple.

The least bound may need a D whose eigenvalues differ by more than floating-point numbers resolve.
This happens near a matrix that is nearly reducible, or whose real eigenvalues leave the real axis.
With D = L^H L at the end of the path, the transformed data

    M' = L_c M L_r^-1,   D' = I,   G' = L_r^-H G L_c^-1

state the same problem, and the path can be followed farther in these coordinates.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import solve_triangular

from workbench._core.arrays import ComplexArray
from workbench.certify.mu_bound import certified_bound, said_bound
from workbench.mu.upper.balance import balanced_batch
from workbench.mu.upper.path import follow
from workbench.mu.upper.pattern import IM, Pattern, expanded_multipliers, fill
from workbench.structure import Structure

DIAGONAL_SHARES = np.array([0.0, 1e-15, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-6, 1e-4])
"""Shares of a nearly singular D's own diagonal that are added to D; the best one is kept."""
INWARD_SHARES = (0.0, 1e-8, 1e-4, 1e-1)
"""Shares of D's own diagonal that are added to D, tried in turn until a good path starts."""
MOST_RECENTRINGS = 8
"""Largest number of rounds of recentring. Rounds also end when they gain nothing. With half of them
a bound may be looser; double costs time only.
"""
ROUND_ITERATIONS = 60
"""Largest number of iterations along the path of one round. A path ends earlier at its accuracy.
With half of them hard rounds end before their gap; double costs time only.
"""
START_RISES = (1.05, 1.5, 4.0)
"""Factors on the square of the bound at which a path may start, tried in turn. The first is near
the border, the last far from it. Half or double of the distances from 1: rounds start nearer or
farther away, and take fewer or more iterations.
"""
WORTHWHILE_RATIO = 0.999
"""If a round does not lower the bound to this share, the next inward share is tried. A round costs
as much as a whole path. Half or double of the distance from 1 changes the time, and bounds by as
little.
"""
NEGLIGIBLE_SHARE = 1e-4
"""Bounds below this share of the balanced norm are not improved further. mu there is of no use
beside the norm, and rounding of the norm is near. Half or double changes which small bounds stay
loose.
"""

CompactMultipliers = tuple[ComplexArray, ComplexArray]
"""Compact D and G."""


def recentred(
    M: ComplexArray,
    structure: Structure,
    pattern: Pattern,
    start: CompactMultipliers,
    gap: float,
    accuracy: float,
) -> tuple[ComplexArray, ComplexArray, float]:
    """Compact D and G (N, N) of one matrix; their bound is no larger than that of the start.

    Parameters
    ----------
    M
        Complex (c, r), finite.
    start
        Compact D and G at the end of the path; D may be singular up to rounding.
    gap, accuracy
        Relative duality gap reached and accuracy wanted, as in `follow`.

    Returns
    -------
    D, G, and the relative duality gap of the square of the bound, which includes rounding. The gap
    is infinite where it is not known.
    """
    D, G, value = _proper(M, structure, pattern, start)
    gap, from_edge = gap if np.array_equal(D, start[0]) else np.inf, 0
    nothing = NEGLIGIBLE_SHARE * _balanced(M, pattern)[1]
    for _ in range(MOST_RECENTRINGS):
        if not value > nothing:
            break
        again = _followed(M, structure, pattern, (D, G), value, accuracy, INWARD_SHARES[from_edge])
        if again is not None:
            next_D, next_G, next_value, next_gap = again
            if next_value <= value * (1 + accuracy):
                gap = min(gap, next_gap)
            worth = next_value < WORTHWHILE_RATIO * value
            if next_value < value:
                D, G, value = next_D, next_G, next_value
            if gap <= accuracy:
                break
            if worth:
                continue
        from_edge += 1
        if from_edge == len(INWARD_SHARES):
            break
    return D, G, gap


def _proper(
    M: ComplexArray, structure: Structure, pattern: Pattern, given: CompactMultipliers
) -> tuple[ComplexArray, ComplexArray, float]:
    """The multipliers with the least bound, and this bound.

    The candidates are D with some share of its diagonal added, Osborne's scaling, and D = I.
    """
    D, G = given
    own = np.diagonal(D).real
    balancing, _ = _balanced(M, pattern)
    # multipliers that are not finite prove nothing and are left out
    with np.errstate(invalid="ignore"):
        shared = D + DIAGONAL_SHARES[:, None, None] * np.diag(own)
    trials_D = np.concatenate(
        [
            shared,
            [np.diag(balancing**2)],
            [np.eye(pattern.size)],
        ]
    )
    trials_G = np.concatenate(
        [np.tile(G, (len(DIAGONAL_SHARES), 1, 1)), np.zeros((2, *G.shape), complex)]
    )
    trials_D[~np.isfinite(trials_D)] = 0.0
    trials_G[~np.isfinite(trials_G)] = 0.0
    tiled = np.broadcast_to(M, (len(trials_D), *M.shape))
    multipliers = expanded_multipliers(pattern, trials_D, trials_G)
    values = said_bound(tiled, structure, *multipliers)
    best = int(np.argmin(values))
    return trials_D[best], trials_G[best], float(values[best])


def _balanced(M: ComplexArray, pattern: Pattern) -> tuple[np.ndarray, float]:
    """Osborne's scaling (N,), and the Frobenius norm of the scaled M."""
    scaled, (scaling,), (scale,) = balanced_batch(M[None], pattern)
    return scaling, float(scale * np.linalg.norm(scaled[0]))


def _followed(
    M: ComplexArray,
    structure: Structure,
    pattern: Pattern,
    given: CompactMultipliers,
    value: float,
    accuracy: float,
    inward: float,
) -> tuple[ComplexArray, ComplexArray, float, float] | None:
    """D, G, their bound and its gap, from the path in the coordinates where the given D is 1.

    A share ``inward`` of its diagonal is first added to D. None where no path starts.
    """
    D, G = given
    D = D + inward * np.diag(np.diagonal(D).real)
    if inward:
        value = float(certified_bound(M, structure, *expanded_multipliers(pattern, D, G)))
    root = np.sqrt(np.diagonal(D).real)
    try:
        R: Any = np.linalg.cholesky(D / root / root[:, None]).conj().T * root
    except np.linalg.LinAlgError:
        return None
    back: Any = solve_triangular(R, np.eye(pattern.size))
    left, _, _ = expanded_multipliers(pattern, R, G)
    _, right, _ = expanded_multipliers(pattern, back, G)
    framed = np.ascontiguousarray(left @ (M / value) @ right)
    twist: Any = back.conj().T @ (G / value) @ back
    if not (np.isfinite(framed).all() and np.isfinite(twist).all()):
        return None
    start = _unknowns(pattern, np.eye(pattern.size), (twist + twist.conj().T) / 2)
    for rise in START_RISES:
        x, early = start.copy(), np.zeros_like(start)
        _, gap, iterations = follow(framed, pattern, rise, x, early, accuracy, ROUND_ITERATIONS)
        if iterations:
            new_D, new_G = np.zeros_like(D), np.zeros_like(G)
            fill(pattern, x, new_D, new_G)
            there = (
                float(
                    certified_bound(framed, structure, *expanded_multipliers(pattern, new_D, new_G))
                )
                * value
            )
            after: CompactMultipliers = (
                R.conj().T @ new_D @ R,
                R.conj().T @ new_G @ R * value + 0j,
            )
            new_D, new_G, proved = _proper(M, structure, pattern, after)
            # The path's gap does not include the rounding of the transformation back.
            with np.errstate(all="ignore"):
                lost = max((proved / there) ** 2 - 1, 0.0) if there > 0 else np.inf
            return new_D, new_G, proved, gap + (lost if np.isfinite(there) else np.inf)
    return None


def _unknowns(pattern: Pattern, D: Any, G: Any) -> np.ndarray:
    """The unknowns from which `fill` makes the given D and G."""
    entries = np.where(pattern.skew, G[pattern.row, pattern.column], D[pattern.row, pattern.column])
    return np.where(pattern.kind == IM, entries.imag, entries.real)
