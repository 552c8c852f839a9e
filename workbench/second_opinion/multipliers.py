"""The inequality of the multipliers of mu, recomputed in ball arithmetic."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray

BITS = 300
"""Precision [bits] of the balls: enough to make the sign certain for doubles of any grading."""


def inequality_holds(
    M: ComplexArray, D_left: ComplexArray, D_right: ComplexArray, G: ComplexArray, bound: float
) -> bool:
    """Whether bound^2 D_r - M^H D_l M - j (G M - M^H G^H) and D_r are proven positive definite.

    For one matrix M (c, r) with its multipliers (c, c), (r, r) and (r, c). The pivots of a Cholesky
    factorisation decide, in balls that contain every rounding error. A bound of 0 is not checked:
    the result is True.
    """
    from flint import ctx

    if bound == 0.0:
        return True
    if not np.isfinite(bound):
        return False
    before = ctx.prec
    try:
        ctx.prec = BITS
        m, dl, dr, g = (_balls(part) for part in (M, D_left, D_right, G))
        mh = m.conjugate().transpose()
        twist = g * m
        j = _unit()
        S = dr * (_number(bound) * _number(bound)) - mh * dl * m
        S = S - (twist - twist.conjugate().transpose()) * j
        S = S + S.conjugate().transpose()  # the Hermitian part, doubled
        return _positive(S) and _positive(dr)
    finally:
        ctx.prec = before


def _positive(S: Any) -> bool:
    """Whether every pivot of the Hermitian matrix is proven positive."""
    n = S.nrows()
    rows = [[S[i, k] for k in range(n)] for i in range(n)]
    for k in range(n):
        pivot = rows[k][k].real
        if not pivot > 0:
            return False
        for i in range(k + 1, n):
            ratio = rows[i][k] / pivot
            for other in range(k + 1, n):
                rows[i][other] -= ratio * rows[k][other]
    return True


def _balls(matrix: ComplexArray) -> Any:
    """The doubles of a matrix as exact balls."""
    from flint import acb, acb_mat

    return acb_mat([[acb(complex(x).real, complex(x).imag) for x in row] for row in matrix])


def _number(value: float) -> Any:
    from flint import acb

    return acb(float(value))


def _unit() -> Any:
    from flint import acb

    return acb(0, 1)
