"""Two proofs that no constant gain in a box stabilises a plant with a loop norm below a level.

The gains K of u = K y, in positive feedback, form a box |K - K0| <= r, entry by entry.

Proof at one frequency. Take a measurement y that does not depend on K. If P21 has a right inverse
R, the input w(K) = w + R (y - P22 K y - P21 w) drives the loop so that it measures y, and it
answers with z(K) = P11 w(K) + P12 K y. Both are affine in K, so

    |z(K)| >= |z(K0)| - sum r_ij |y_j| |(P12 - P11 R P22) e_i|,
    |w(K)| <= |w(K0)| + sum r_ij |y_j| |R P22 e_i|,

and the quotient is at most the norm of every stable loop. No inverse depends on K, so poles may
cross the axis within the box. If P12 has a left inverse, the same proof works for the transposed
plant.

Proof of instability. If A(K)' P + P A(K) < 0 at the corners of the box, this also holds inside,
since D22 = 0 makes A(K) affine in K. If in addition x' P x < 0 for some x, V = x' P x decreases
from there without bound, so that no K in the box stabilises (A. M. Lyapunov's first theorem on
instability).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np
from flint import acb, acb_mat, arb, ctx

from workbench._core.arrays import ComplexArray, RealArray
from workbench.certify.balls import balls, below, identity
from workbench.certify.rounding import BALL_BITS, exact, positive_definite

Sides = tuple[int, int]
"""Numbers of performance outputs z and of exogenous inputs w."""


def level_of_box(
    plant: tuple[RealArray, RealArray, RealArray, RealArray],
    sides: Sides,
    box: tuple[RealArray, RealArray],
    omega: float,
    driven: tuple[ComplexArray, ComplexArray],
    dual: bool,
) -> float:
    """A level proven to be a lower bound of the loop's norm for every stabilising gain in a box.

    Parameters
    ----------
    plant
        A, B, C and D of a continuous plant, its inputs (w, u) and outputs (z, y).
    sides
        Numbers of z and w.
    box
        The least and the largest gains (controls, measurements).
    omega
        Frequency [rad/s]; infinity is allowed.
    driven
        w (w,) and y (measurements,) of the proof; any choice is valid, and a good one proves a high
        level.
    dual
        Whether the proof is that of the transposed plant.
    """
    A, B, C, D = plant
    z, w = sides
    low, high = box
    with ctx.workprec(BALL_BITS):
        response = _response(A, B, C, D, omega)
        if response is None:
            return 0.0
        if dual:
            response, (low, high), (z, w) = response.transpose(), (low.T, high.T), (w, z)
        centre = (low + high) / 2
        # The differences are rounded by at most half a unit in the last place.
        radius = np.nextafter(np.maximum(high - centre, centre - low), np.inf)
        ends = [response.nrows(), response.ncols()]
        P11, P12 = _part(response, 0, z, 0, w), _part(response, 0, z, w, ends[1])
        P21, P22 = _part(response, z, ends[0], 0, w), _part(response, z, ends[0], w, ends[1])
        about = _conjugate(P21)
        try:
            R = about * (P21 * about).inv()
        except ZeroDivisionError:
            return 0.0
        free, y = (balls(each.reshape(-1, 1)) for each in driven)
        u = balls(centre) * y
        inward = free + R * (y - P22 * u - P21 * free)
        outward = P11 * inward + P12 * u
        by_u, moved = P12 - P11 * (R * P22), R * P22
        reach = [
            sum((float(radius[i, j]) * y[j, 0].abs_upper() for j in range(y.nrows())), arb(0))
            for i in range(u.nrows())
        ]
        least, most = _at_least(outward), _at_most(inward)
        for i, by in enumerate(reach):
            least -= by * _at_most(_part(by_u, 0, by_u.nrows(), i, i + 1))
            most += by * _at_most(_part(moved, 0, moved.nrows(), i, i + 1))
        return max(below(least / most), 0.0)


def is_unstable_box(
    A: RealArray, B: RealArray, C: RealArray, box: tuple[RealArray, RealArray], P: RealArray
) -> bool:
    """Whether the form x' P x proves that no gain in a box stabilises x' = A x + B K C x.

    A, B and C are the matrices from controls to measurements; P (n, n) is symmetric.
    """
    values, vectors = np.linalg.eigh(P)
    if not len(values) or values[0] >= 0:
        return False
    x = exact(vectors[:, :1])
    if not positive_definite(x.H @ (exact(-P) @ x)):
        return False
    for corner in box_corners(box):
        closed = exact(A) + exact(B) @ (exact(corner) @ exact(C))
        down = closed.H @ exact(P)
        if not positive_definite(-(down + down.H)):
            return False
    return True


def box_corners(box: tuple[RealArray, RealArray]) -> Iterator[RealArray]:
    """The corners of a box of gains: each entry that may vary is at one of its ends."""
    low, high = box
    moving = np.argwhere(low < high)
    for ends in product((False, True), repeat=len(moving)):
        corner = low.copy()
        for (i, j), end in zip(moving, ends, strict=True):
            corner[i, j] = high[i, j] if end else low[i, j]
        yield corner


def _response(
    A: RealArray, B: RealArray, C: RealArray, D: RealArray, omega: float
) -> acb_mat | None:
    """The plant at a frequency; None if balls cannot tell the frequency from a pole."""
    if np.isinf(omega) or not len(A):
        return balls(D)
    try:
        inside = identity(len(A)) * acb(0, omega) - balls(A)
        return balls(C) * inside.solve(balls(B)) + balls(D)
    except ZeroDivisionError:
        return None


def _part(M: acb_mat, top: int, bottom: int, left: int, right: int) -> acb_mat:
    """Some rows and columns of a matrix."""
    return acb_mat(
        bottom - top,
        right - left,
        [M[i, j] for i in range(top, bottom) for j in range(left, right)],
    )


def _conjugate(M: acb_mat) -> acb_mat:
    """The conjugate transpose of the midpoints."""
    found = M.transpose()
    rows, columns = found.nrows(), found.ncols()
    entries = [complex(found[i, j]) for i in range(rows) for j in range(columns)]
    return acb_mat(rows, columns, [each.conjugate() for each in entries])


def _at_least(column: acb_mat) -> arb:
    """A lower bound of the length of a vector."""
    return sum((column[i, 0].abs_lower() ** 2 for i in range(column.nrows())), arb(0)).sqrt()


def _at_most(column: acb_mat) -> arb:
    """An upper bound of the length of a vector."""
    return sum((column[i, 0].abs_upper() ** 2 for i in range(column.nrows())), arb(0)).sqrt()
