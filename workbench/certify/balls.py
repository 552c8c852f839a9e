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

from workbench._core.arrays import Array, RealArray
from workbench.certify.modes.modal_form import (
    FEWEST_QUICK,
    PRECISIONS,
    real_balls,
    real_doubles,
)
from workbench.certify.rounding import DOUBLE_BITS, TINY, UPWARD, Enclosure, exact
from workbench.certify.stable_system import StableSystem, bilinear_frequency
from workbench.systems.frequency_response import driven_states

LARGEST_DEFECT = 2.0**-10
"""Largest error of an inverse in doubles that is used to refine a solution. Each step then gains 10
bits. With half of it a few more responses are eliminated in balls; with double of it steps gain 9
bits; the enclosure is proven either way.
"""

Matrix = acb_mat
"""A matrix of complex balls."""


def balls(values: Array) -> Matrix:
    """The matrix (m, n) of floating-point numbers as balls of radius 0."""
    array = np.asarray(values, complex)
    rows, columns = array.shape  # a list of rows would lose the shape if a dimension is 0
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
    """The rows and columns with these indices."""
    found = [M[int(i), int(j)] for i in rows for j in columns]
    return acb_mat(len(rows), len(columns), found)


def identity(n: int) -> Matrix:
    """The identity matrix."""
    return acb_mat([[int(i == j) for j in range(n)] for i in range(n)])


def length(entries: Sequence[acb]) -> arb:
    """Euclidean length of a vector; for all entries of a matrix, its Frobenius norm."""
    return sum((abs(entry) ** 2 for entry in entries), arb(0)).sqrt()


def below(ball: arb) -> float:
    """The largest floating-point number that is a lower bound of a ball; -inf without a proof."""
    end = ball.lower()
    value = float(end)
    if math.isnan(value):
        return -math.inf
    return value if arb(value) <= end else math.nextafter(value, -math.inf)


def above(ball: arb) -> float:
    """The least floating-point number that is an upper bound of a ball; inf without a proof."""
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


def matrices_in_balls(system: StableSystem) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """A, B, C and D in continuous time, in the current precision; those given, if they are known.

    Raises ZeroDivisionError if a pole cannot be told from z = -1.
    """
    if system.source is None:
        A, B, C, D = map(enclosed, system.enclosures)
    else:
        A, B, C, D = map(acb_mat, system.source.in_balls(ctx.prec))
    return A, B, C, D


def in_plane(omega: float, period: float) -> float | arb:
    """v of a frequency `omega` [rad/s] of a system sampled every `period` [s], exactly, in balls.

    The value is a ball, so that no proof about a lightly damped resonance depends on how a
    processor rounds a tangent. A ``period`` of 0 means continuous time.
    """
    v = float(bilinear_frequency(omega, period))
    if not (period and 0.0 < v < math.inf):
        return v
    with ctx.workprec(PRECISIONS[-1]):
        T = arb(period)
        return (arb(float(omega)) * T / 2).tan() * 2 / T


def response_of(system: StableSystem, omega: float | arb) -> Matrix | None:
    """The frequency response at `omega` [rad/s], infinity allowed (outputs, inputs).

    For a sampled system it is computed at z itself, from the given matrices. None if ball
    arithmetic cannot tell s I - A, or z I - A, from a singular matrix.
    """
    given = system.source
    try:
        if given is None:
            return _response_at(_point(omega, 0.0), *map(enclosed, system.enclosures))
        point = _point(omega, given.period)
        quick = _refined(given.A, given.B, point) if point is not None and omega else None
        if quick is not None:
            M = balls(given.D) + balls(given.C) * quick
        else:
            M = _response_at(point, *map(balls, (given.A, given.B, given.C, given.D)))
    except ZeroDivisionError:
        return None
    out, into = given.gains_in_balls()
    return acb_mat(out) * M * acb_mat(into)


def _point(omega: float | arb, period: float) -> acb | None:
    """s = j omega, None for infinity; z = (1 + s T / 2) / (1 - s T / 2) for a sampled system."""
    v = omega if isinstance(omega, arb) else arb(float(omega))
    if not v.is_finite():
        return acb(-1) if period else None
    if not period:
        return acb(0, v)
    half = acb(0, v * arb(period) / 2)
    return (1 + half) / (1 - half)


def _response_at(point: acb | None, A: Matrix, B: Matrix, C: Matrix, D: Matrix) -> Matrix:
    """D + C (point - A)^-1 B; D if the point is None."""
    if point is None or not A.nrows():
        return D
    if point.imag == 0:  # real arithmetic keeps the response exactly real
        shifted = point.real * identity(A.nrows()).real - A.real
        return acb_mat(D.real + C.real * shifted.solve(B.real))
    return D + C * (point * identity(A.nrows()) - A).solve(B)


def _refined(A: RealArray, B: RealArray, point: acb) -> Matrix | None:
    """(point - A)^-1 B by refinement with an inverse in doubles, in the current precision.

    Let Y be near the inverse, let E = 1 - Y (point - A) have row sums of at most theta < 1, and let
    R be the residual of X. Then the error of X is at most Z + theta max(Z) / (1 - theta) with Z =
    |Y| |R|. None if this does not reach the precision.
    """
    n = len(A)
    if n < FEWEST_QUICK:  # elimination in balls takes no time
        return None
    near = doubles(acb_mat([[point]]))
    M = Enclosure(near.mid * np.eye(n), near.rad * np.eye(n)) - exact(A)
    try:
        Y = driven_states(A, np.eye(n), near.mid[0])[0]
    except np.linalg.LinAlgError:
        return None
    E = exact(np.eye(n)) - exact(Y) @ M
    theta = float(((np.abs(E.mid) + E.rad) * UPWARD).sum(axis=1).max()) * UPWARD
    if not theta < LARGEST_DEFECT:
        return None
    # Real and imaginary parts stand side by side: real balls take a quarter of the time.
    r = B.shape[1]
    a, b = real_balls(A), real_balls(np.hstack([B, np.zeros((n, r))]))
    quarter: RealArray = np.kron(np.array([[0.0, 1.0], [-1.0, 0.0]]), np.eye(r))
    turn = real_balls(np.eye(2 * r)) * point.real + real_balls(quarter) * point.imag
    X = real_balls(_side_by_side(Y @ B))
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
    result = acb_mat(parts[0]) + acb_mat(parts[1]) * acb(0, 1)
    return result + enclosed(Enclosure(np.zeros(error.shape, complex), error))


def _side_by_side(X: Array) -> Array:
    """The real and the imaginary parts (m, 2 n) of a matrix (m, n)."""
    return np.hstack([X.real, X.imag])
