"""Proof that equations have a zero within a box, with surplus unknowns fixed.

With P near the inverse of the Jacobian and Y a box around y, let

    K(Y) = y - P F(y) + (I - P F'(Y)) (Y - y).

If K(Y) lies in the interior of Y, then F has exactly one zero in Y.

Source: S. Rump, "Verification methods: rigorous results using floating-point arithmetic", Acta
Numerica 19 (2010), theorem 13.3.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from flint import arb, arb_mat, ctx
from numpy.typing import NDArray

from workbench._core.arrays import EPS

STEP_BITS = 10
"""If a step is larger than 2^-10 of the unknowns' scale, the proof is given up: no zero is near.
Starts come from doubles and are more accurate. With 5 bits, a zero far from the start may be
proven; with 20 bits, starts near double zeros, known to half of their digits, are given up.
"""

Balls = list[arb]


def zero_within(
    start: Balls,
    residual: Callable[[Balls], Balls],
    jacobian: Callable[[Balls], list[Balls]],
) -> Balls | None:
    """A box near `start` (N,) that holds a zero of N or fewer equations; None without proof.

    As many unknowns as there are equations vary, chosen by a QR decomposition with pivoting; the
    others keep their values exactly.
    """
    rows = jacobian(start)
    scale = _scales(start)
    weight = [
        _reciprocal(max(abs(x * s).mid() for x, s in zip(row, scale, strict=True))) for row in rows
    ]
    table = [
        [w * x * s for x, s in zip(row, scale, strict=True)]
        for w, row in zip(weight, rows, strict=True)
    ]
    chosen = _independent(np.array([[float(x) for x in row] for row in table]))
    if chosen is None:
        return None
    inverse = arb_mat([[row[j] for j in chosen] for row in table]).mid().inv().mid()
    P = _diagonal([scale[j] for j in chosen]) * inverse * _diagonal(weight)

    def step(at: Balls) -> Balls:
        return (P * arb_mat([[x] for x in residual(at)])).entries()

    y = list(start)
    settled = arb(2) ** -(3 * ctx.prec // 4)
    # With one inverse for all, each step leaves about the same share of the error.
    for count in range(1 + math.ceil(3 * ctx.prec / 4 / STEP_BITS)):
        moved = step(y)
        if not all(
            abs(d).mid() <= scale[j] * 2.0**-STEP_BITS for j, d in zip(chosen, moved, strict=True)
        ):
            return None
        for j, d in zip(chosen, moved, strict=True):
            y[j] = (y[j] - d).mid()
        if count and all(
            abs(d).mid() <= scale[j] * settled for j, d in zip(chosen, moved, strict=True)
        ):
            break
    moved = step(y)
    box = list(y)
    for j, d in zip(chosen, moved, strict=True):
        box[j] = y[j] + arb(0, (2 * abs(d) + scale[j] * settled).upper())
    around = [box[j] - y[j] for j in chosen]
    wide = arb_mat([[row[j] for j in chosen] for row in jacobian(box)])
    rest = (_diagonal([arb(1)] * len(chosen)) - P * wide) * arb_mat([[d] for d in around])
    inside = all(
        box[j].contains_interior(y[j] - d + e)
        for j, d, e in zip(chosen, moved, rest.entries(), strict=True)
    )
    return box if inside else None


def _scales(start: Balls) -> Balls:
    """The sizes of the unknowns; for unknowns equal to 0, the largest size."""
    sizes = [abs(x) for x in start]
    largest = max(sizes)
    return [size if size > largest * 2.0**-40 else largest for size in sizes]


def _independent(table: NDArray[np.float64]) -> list[int] | None:
    """Indices of as many independent columns as there are rows; None if there are too few."""
    from scipy.linalg import qr

    if not np.isfinite(table).all() or table.shape[0] > table.shape[1]:
        return None
    R, order = qr(table, mode="r", pivoting=True)
    pivots = np.abs(np.diagonal(R))
    if not pivots.min() > table.shape[1] * EPS * pivots.max():
        return None
    return [int(j) for j in order[: len(table)]]


def _reciprocal(size: arb) -> arb:
    return (1 / size).mid() if size > 0 else arb(1)


def _diagonal(entries: Balls) -> arb_mat:
    """The diagonal matrix of these entries."""
    return arb_mat(
        [[x if i == j else 0 for j in range(len(entries))] for i, x in enumerate(entries)]
    )
