"""Periodic switchings of two modes that make a switched system unstable.

With stays n and m, x grows if A^n B^m has a spectral radius above 1. Coordinates are chosen in
which the norm of A is below 1. Pairs with |A^n| |B^m| < 1 cannot be unstable; all others are tried.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import matrix_balance, solve_discrete_lyapunov

from workbench._core.arrays import RealArray
from workbench.synthesis.switching.modes import Mode

GROWTH_MARGIN = 1e-9
"""Smallest excess of a spectral radius over 1 that counts as growth."""
MOST_STAYS = 2000
"""Largest number of stays of a mode that are tried. More stays are thinned out on a logarithmic
scale.
"""
PAIRS_AT_ONCE = 20_000
"""Number of products whose eigenvalues are computed together."""


def longest_unstable(sought: Mode, other: Mode, limit: int) -> tuple[int, int]:
    """Longest dwell time of `sought` with an unstable periodic switching, and the stay in `other`.

    Both are in samples. Where both modes are sought, both stays are at least the dwell time. (0, 0)
    where no pair of stays is unstable.
    """
    plants = zip(sought.A, other.A, strict=True)
    return max(_longest_unstable_of_plant(A, B, other, limit) for A, B in plants)


def _longest_unstable_of_plant(
    A: RealArray, B: RealArray, other: Mode, limit: int
) -> tuple[int, int]:
    A, B = _contracting_coordinates(A, B)
    both = other.shortest_samples is None
    if other.longest_samples is None:
        m = np.arange(other.shortest_samples or 1, _contraction_stay(B, limit) + 1)
    else:
        m = np.arange(other.shortest_samples or 1, other.longest_samples + 1)
    m = _thinned_stays(m)
    second = _powers(B, m)
    sizes = np.linalg.norm(second, 2, axis=(1, 2))
    n = _thinned_stays(np.arange(1, _first_power_below(A, 1.0 / sizes.max(initial=1.0), limit) + 1))
    first = _powers(A, n)
    rows, columns = np.nonzero(np.linalg.norm(first, 2, axis=(1, 2))[:, None] * sizes >= 1.0)
    dwell = np.minimum(n[rows], m[columns]) if both else n[rows]
    order = np.argsort(-dwell, kind="stable")
    for start, end in pairwise([*range(0, len(order), PAIRS_AT_ONCE), len(order)]):
        tried = order[start:end]
        products = first[rows[tried]] @ second[columns[tried]]
        grows = np.abs(np.linalg.eigvals(products)).max(axis=1) > 1.0 + GROWTH_MARGIN
        if grows.any():
            found = tried[np.argmax(grows)]
            return int(dwell[found]), int(m[columns[found]])
    return 0, 0


def _contracting_coordinates(A: RealArray, B: RealArray) -> tuple[RealArray, RealArray]:
    """A stable A and a B, in coordinates in which the norm of A is below 1."""
    _, (units, _) = matrix_balance(abs(A) + abs(B), permute=False, separate=True)
    A, B = (each / units[:, None] * units for each in (A, B))
    R = np.linalg.cholesky(solve_discrete_lyapunov(A.T, np.eye(len(A)))).T
    return tuple(R @ each @ np.linalg.inv(R) for each in (A, B))  # type: ignore[return-value]


def _first_power_below(A: RealArray, level: float, limit: int) -> int:
    """The first n with |A^n| < level, at most `limit`; needs |A| < 1."""
    n, power = 1, A
    while n < limit and np.linalg.norm(power, 2) >= level:
        n, power = n + 1, A @ power
    return n


def _contraction_stay(B: RealArray, limit: int) -> int:
    """A stay k with |B^m| < 1 for all m >= k, at most `limit`.

    If |B^k| times the largest |B^r|, r <= k, is below 1, then |B^m| < 1 for all m >= k.
    """
    power, largest = B, 1.0
    for m in range(1, limit):
        size = float(np.linalg.norm(power, 2))
        largest = max(largest, size)
        if size * largest < 1.0 or not math.isfinite(size):
            return m
        power = B @ power
    return limit


def _thinned_stays(stays: NDArray[np.int64]) -> NDArray[np.int64]:
    """All stays, or about `MOST_STAYS` of them, spread on a logarithmic scale."""
    if len(stays) <= MOST_STAYS:
        return stays
    chosen = np.geomspace(stays[0], stays[-1], MOST_STAYS).round().astype(np.int64)
    return np.asarray(np.unique(chosen))


def _powers(A: RealArray, stays: NDArray[np.int64]) -> RealArray:
    """Powers of A (N, n, n) for stays (N,) in increasing order."""
    found, power, reached = np.empty((len(stays), *A.shape)), np.eye(len(A)), 0
    for place, stay in enumerate(stays.tolist()):
        power = np.linalg.matrix_power(A, stay - reached) @ power
        found[place], reached = power, stay
    return found
