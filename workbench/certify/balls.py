"""Ball arithmetic: numbers with proven error bounds, from floating-point arrays and back.

Every operation on balls of python-flint gives a ball that contains the exact result for all members
of its arguments (F. Johansson, "Arb: efficient arbitrary-precision midpoint-radius interval
arithmetic", IEEE Trans. Computers 66 (2017) 1281-1292). Floating-point numbers become balls of
radius 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from flint import acb, acb_mat, arb

from workbench.arrays import Array
from workbench.certify.rounding import Enclosure
from workbench.certify.stable_system import StableSystem

Matrix = acb_mat
"""A matrix of complex balls."""


def balls(values: Array) -> Matrix:
    """The matrix (m, n) of floating-point numbers as balls of radius 0."""
    return acb_mat(np.asarray(values, complex).tolist())


def enclosed(matrix: Enclosure) -> Matrix:
    """The members of an enclosure (m, n) as balls."""
    if not matrix.rad.any():
        return balls(matrix.mid)
    real = np.isrealobj(matrix.mid)
    found = balls(matrix.mid)
    for place, radius in np.ndenumerate(matrix.rad):
        spread = arb(0.0, float(radius))
        found[place] += acb(spread, arb(0) if real else spread)
    return found


def middle(M: Matrix) -> Array:
    """Midpoints, rounded to complex floating-point numbers."""
    return np.array([[complex(entry) for entry in row] for row in M.tolist()], complex).reshape(
        M.nrows(), M.ncols()
    )


def doubles(M: Matrix) -> Enclosure:
    """The balls, rounded outward to floating-point numbers."""
    mid = middle(M)
    rest = M - balls(mid)
    rad = np.array([[above(entry.abs_upper()) for entry in row] for row in rest.tolist()])
    return Enclosure(mid, rad.reshape(mid.shape))


def submatrix(M: Matrix, rows: Array, columns: Array) -> Matrix:
    """The rows and columns with these numbers."""
    return acb_mat([[M[int(i), int(j)] for j in columns] for i in rows])


def identity(n: int) -> Matrix:
    """The identity matrix."""
    return acb_mat([[int(i == j) for j in range(n)] for i in range(n)])


def length(entries: Sequence[acb]) -> arb:
    """Euclidean length of a vector; of all entries of a matrix, its Frobenius norm."""
    return sum((abs(entry) ** 2 for entry in entries), arb(0)).sqrt()


def below(ball: arb) -> float:
    """The largest floating-point number that no member of a ball is below; -inf for no proof."""
    end = ball.lower()
    value = float(end)
    if math.isnan(value):
        return -math.inf
    return value if arb(value) <= end else math.nextafter(value, -math.inf)


def above(ball: arb) -> float:
    """The least floating-point number that no member of a ball is above; inf for no proof."""
    end = ball.upper()
    value = float(end)
    if math.isnan(value):
        return math.inf
    return value if arb(value) >= end else math.nextafter(value, math.inf)


def norm_of_block(Delta: Any) -> arb:
    """An upper bound of the largest singular value of a block, given as a float array.

    It is exact for multiples of the identity and dyads.
    """
    if np.array_equal(Delta, Delta.flat[0] * np.eye(*Delta.shape)):
        return abs(acb(complex(Delta.flat[0])))
    return length([acb(complex(entry)) for entry in Delta.flat])


def response_of(system: StableSystem, omega: float) -> Matrix | None:
    """The frequency response at `omega` [rad/s], infinity allowed (outputs, inputs).

    None where ball arithmetic cannot tell j omega I - A from a singular matrix.
    """
    A, B, C, D = map(enclosed, (system.source or system).enclosures)
    if math.isinf(omega) or not len(system.A):
        return D
    try:
        if omega == 0.0:  # real arithmetic keeps the response exactly real
            return acb_mat(D.real - C.real * A.real.solve(B.real))
        return D + C * (acb(0, float(omega)) * identity(len(system.A)) - A).solve(B)
    except ZeroDivisionError:
        return None
