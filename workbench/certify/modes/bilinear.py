"""The bilinear transformation of a sampled realisation, enclosed in doubles.

With z = (1 + s T / 2) / (1 - s T / 2), the system has the realisation

    2 / T (A + 1)^-1 (A - 1),   4 / T (A + 1)^-1 B,   C (A + 1)^-1,   D - C (A + 1)^-1 B.

Solutions of A + 1 in doubles are corrected by their residuals, which sharp products give to full
precision, so that an entry loses hardly more than its last bit.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench._core.arrays import EPS, RealArray
from workbench.certify.rounding import TINY, UPWARD, Enclosure, exact, sharp_product, solution

Realised = tuple[RealArray, RealArray, RealArray, RealArray]
"""A, B, C and D."""


def bilinear_enclosures(
    given: Realised, period: float
) -> tuple[Enclosure, Enclosure, Enclosure, Enclosure] | None:
    """A, B, C and D in continuous time, enclosed, for a realisation that is sampled every `period`
    [s].

    None if A + 1 may be singular up to rounding, or is too close to singular for doubles.
    """
    A, B, C, D = given
    n, one = len(A), np.eye(len(A))
    whole = _shifted_solution(A, [np.hstack([A, B]), np.hstack([-one, np.zeros_like(B)])])
    across = _shifted_solution(A.T, [C.T])
    if whole is None or across is None:
        return None
    X, small = whole
    # D - C X - C Z, where Z is the small part of the solution
    enters = slice(n, None)
    direct = sharp_product(
        np.hstack([D, -C, -C]), np.vstack([np.eye(D.shape[1]), X[:, enters], small.mid[:, enters]])
    )
    direct = Enclosure(direct.mid, (direct.rad + np.abs(C) @ small.rad[:, enters]) * UPWARD)
    found = exact(X) + small
    moved, back = (Enclosure(found.mid[:, at], found.rad[:, at]) for at in (slice(n), enters))
    out = (exact(across[0]) + across[1]).H
    return (
        _scaled_over_period(moved, 2.0, period),
        _scaled_over_period(back, 4.0, period),
        out,
        direct,
    )


def _shifted_solution(
    A: RealArray, right: Sequence[RealArray]
) -> tuple[RealArray, Enclosure] | None:
    """(A + 1)^-1 times a sum of right sides: a solution in doubles, and its enclosed error."""
    n = len(A)
    shifted, one = A + np.eye(n), np.eye(n)
    near = Enclosure(shifted, EPS * np.abs(shifted) * UPWARD)  # the sum is rounded
    try:
        X: RealArray = np.asarray(np.linalg.solve(shifted, sum(right)), dtype=float)
    except np.linalg.LinAlgError:
        return None
    left = np.hstack([*(one for _ in right), A, one])
    small = solution(near, sharp_product(left, np.vstack([*right, -X, -X])))
    return None if small is None else (X, small)


def _scaled_over_period(matrix: Enclosure, factor: float, period: float) -> Enclosure:
    """The matrix times a power of two, divided by the period."""
    mid = matrix.mid * factor / period
    return Enclosure(mid, (matrix.rad * factor / period + 0.5 * EPS * np.abs(mid)) * UPWARD + TINY)
