"""A proof that no rational function of given degrees passes through discs at given frequencies.

If |P / Q - c_k| <= r_k at every frequency omega_k, then for all weights w_k >= 0

    sum_k w_k (|P - c_k Q|^2 - r_k^2 |Q|^2) <= 0,    P = P(j omega_k), Q = Q(j omega_k).

The sum is a quadratic form in the real coefficients of P and Q. If it is positive definite, there
are no such P and Q. (This is the S-procedure: V. A. Yakubovich, Vestnik Leningrad Univ. 4 (1977)
73-93.) The form is computed and eliminated in ball arithmetic; it is positive definite if every
pivot is proven to be positive.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray

BITS_PER_DEGREE = 64
"""Bits of the balls for each coefficient: powers of frequencies over many decades cancel. 64 bits
for each degree hold nineteen decades. With half of them bounds of fits over more than nine decades
are not proven; double takes longer.
"""


def none_within(
    omega: RealArray,
    centers: ComplexArray,
    sizes: RealArray,
    ratio: float,
    weights: RealArray,
    degrees: tuple[int, int],
) -> bool:
    """Whether weights prove that no P / Q lies within ratio * sizes of all centers.

    Parameters
    ----------
    omega
        Frequency [rad/s] of each disc (K,); several discs may share one.
    centers, sizes, ratio
        Centres of the discs (K,), and their radii (K,) divided by ``ratio``.
    weights
        Nonnegative weights (K,).
    degrees
        Largest degrees of P and of Q, polynomials with real coefficients.
    """
    from flint import arb, ctx

    weights = np.asarray(weights, dtype=float)
    finite = all(np.isfinite(part).all() for part in (omega, centers, sizes, weights))
    if not (finite and np.isfinite(ratio) and (weights >= 0).all()):
        return False
    count = sum(degrees) + 2
    with ctx.workprec(BITS_PER_DEGREE * (count + 2)):
        form = [[arb(0)] * count for _ in range(count)]
        unit = 1 / arb(float(np.exp(np.log(omega).mean())))
        for k in np.flatnonzero(weights):
            rows = _rows(arb(float(omega[k])) * unit, complex(centers[k]), degrees)
            size = arb(float(sizes[k])) * arb(ratio)
            for sign, (row, other) in ((arb(1), rows[0]), (-size * size, rows[1])):
                share = arb(float(weights[k])) * sign
                for i in range(count):
                    for j in range(i + 1):
                        form[i][j] += share * (row[i] * row[j] + other[i] * other[j])
        return _positive_definite(form)


def _rows(
    x: Any, center: complex, degrees: tuple[int, int]
) -> tuple[tuple[list[Any], list[Any]], tuple[list[Any], list[Any]]]:
    """Real and imaginary parts of P - c Q, and of Q, as rows over the coefficients of P and Q.

    The polynomials are in j x.
    """
    from flint import arb

    real, imaginary = arb(center.real), arb(center.imag)
    top = [_power(x, k) for k in range(degrees[0] + 1)]
    bottom = [_power(x, k) for k in range(degrees[1] + 1)]
    away = (
        [a for a, _ in top] + [imaginary * b - real * a for a, b in bottom],
        [b for _, b in top] + [-real * b - imaginary * a for a, b in bottom],
    )
    none = [arb(0)] * len(top)
    return away, (none + [a for a, _ in bottom], none + [b for _, b in bottom])


def _power(x: Any, k: int) -> tuple[Any, Any]:
    """Real and imaginary part of (j x)^k."""
    from flint import arb

    size = x**k * (1, 1, -1, -1)[k % 4]
    return (size, arb(0)) if k % 2 == 0 else (arb(0), size)


def _positive_definite(form: list[list[Any]]) -> bool:
    """Whether every pivot of the symmetric form, given by its lower triangle, is positive."""
    for k in range(len(form)):
        pivot = form[k][k]
        if not pivot > 0:
            return False
        for i in range(k + 1, len(form)):
            share = form[i][k] / pivot
            for j in range(k + 1, i + 1):
                form[i][j] -= share * form[j][k]
    return True
