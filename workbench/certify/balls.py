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
from flint import acb, acb_mat, arb, ctx

from workbench.arrays import Array
from workbench.certify.modes.modal_form import real_balls, real_doubles
from workbench.certify.rounding import TINY, UPWARD, Enclosure, exact
from workbench.certify.stable_system import StableSystem

FEWEST_REFINED = 30
"""Fewest states whose response is refined; fewer ones are eliminated in balls."""
LARGEST_DEFECT = 2.0**-10
"""Largest error of an inverse in doubles, by which a solution is refined."""
DOUBLE_BITS = 53
"""Bits of a double; a solution in doubles is refined in twice as many, then in more and more."""

Matrix = acb_mat
"""A matrix of complex balls."""


def balls(values: Array) -> Matrix:
    """The matrix (m, n) of floating-point numbers as balls of radius 0."""
    array = np.asarray(values, complex)
    rows, columns = array.shape  # which lists of rows would lose where one is 0
    return acb_mat(rows, columns, array.ravel().tolist())


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
    found = [M[int(i), int(j)] for i in rows for j in columns]
    return acb_mat(len(rows), len(columns), found)


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
    quick = _refined(system.source or system, omega) if omega else None
    if quick is not None:
        return D + C * quick
    try:
        if omega == 0.0:  # real arithmetic keeps the response exactly real
            return acb_mat(D.real - C.real * A.real.solve(B.real))
        return D + C * (acb(0, float(omega)) * identity(len(system.A)) - A).solve(B)
    except ZeroDivisionError:
        return None


def _refined(system: StableSystem, omega: float) -> Matrix | None:
    """(j omega I - A)^-1 B by refinement with an inverse in doubles, in the precision at work.

    For Y near the inverse, E = 1 - Y (j omega I - A) with rows of sum at most theta < 1 and the
    residual R of X, the error of X is at most Z + theta max(Z) / (1 - theta), Z = |Y| |R|. None
    where that does not lead to the precision.
    """
    A, B = system.enclosures[:2]
    n = len(A.mid)
    if n < FEWEST_REFINED or A.rad.any() or B.rad.any():
        return None
    M = exact(1j * omega * np.eye(n)) - A
    try:
        Y = np.linalg.inv(M.mid)
    except np.linalg.LinAlgError:
        return None
    E = exact(np.eye(n)) - exact(Y) @ M
    theta = float(((np.abs(E.mid) + E.rad) * UPWARD).sum(axis=1).max()) * UPWARD
    if not theta < LARGEST_DEFECT:
        return None
    # Real and imaginary parts stand side by side: real balls take a fourth of the time.
    r = B.mid.shape[1]
    a, b = real_balls(A.mid), real_balls(np.hstack([B.mid, np.zeros((n, r))]))
    quarter = np.array([[0.0, 1.0], [-1.0, 0.0]])
    turn = real_balls(np.asarray(omega * np.kron(quarter, np.eye(r)), dtype=float))
    X = real_balls(_side_by_side(Y @ B.mid))
    gained = -math.log2(theta + TINY)
    for step in range(math.ceil(ctx.prec / gained) + 1):
        with ctx.workprec(min(ctx.prec, math.ceil(2 * DOUBLE_BITS + step * gained))):
            rest = real_doubles(b - (X * turn - a * X)).mid
        X = (X + real_balls(_side_by_side(Y @ (rest[:, :r] + 1j * rest[:, r:])))).mid()
    R = real_doubles(b - (X * turn - a * X))
    size = np.abs(R.mid) + R.rad
    Z = np.abs(Y) @ (size[:, :r] + size[:, r:]) * UPWARD**4
    error = (Z + theta * Z.max(axis=0) / (1 - theta)) * UPWARD**4 + TINY
    parts = X * real_balls(np.eye(2 * r)[:, :r]), X * real_balls(np.eye(2 * r)[:, r:])
    near = acb_mat(parts[0]) + acb_mat(parts[1]) * acb(0, 1)
    return near + enclosed(Enclosure(np.zeros(error.shape, complex), error))


def _side_by_side(X: Array) -> Array:
    """The real and the imaginary parts (m, 2 n) of a matrix (m, n)."""
    return np.hstack([X.real, X.imag])
