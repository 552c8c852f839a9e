"""Exact proof, from two real zeros of a plant, that no stable controller stabilises it.

Let p(s) = det(s I - A) and n(s) = p(s) G(s) for a plant G, and p_K(s) the same for K. With positive
feedback the closed loop has the characteristic polynomial f = p p_K det(I - G K). If K is stable,
p_K is positive on the real axis from 0 on. Where all entries of n are zero (a blocking zero z),
f(z) has the sign of p(z). If p has opposite signs at two blocking zeros, f has a root between them,
and the loop is unstable. A strictly proper plant has a blocking zero at infinity, where f is
positive: p(z) < 0 at one other blocking zero is enough.

A blocking zero is a root of the greatest common divisor of the entries of n. The signs of the
divisor at the ends of a range prove that the zero lies in it.

Source: D. C. Youla, J. J. Bongiorno, C. N. Lu, "Single-loop feedback-stabilization of linear
multivariable dynamical plants", Automatica 10 (1974) 159-173 (parity interlacing).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from flint import arb, fmpq, fmpq_mat, fmpq_poly

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace

Range = tuple[float, float]
"""Ends of a range of the real axis [rad/s]; if both are infinite, the range is the point at
infinity.
"""


@dataclass(frozen=True)
class Interlacing:
    """What is proven: each range contains a blocking zero of the plant, and p has opposite signs in
    the two ranges.
    """

    low_zero: bool
    high_zero: bool
    opposite: bool

    @property
    def holds(self) -> bool:
        """Whether it is proven that no stable controller stabilises the plant."""
        return self.low_zero and self.high_zero and self.opposite


def interlacing(plant: StateSpace, low: Range, high: Range) -> Interlacing:
    """The proof for a continuous plant with a blocking zero in each of two ranges.

    Nothing is proven if the ranges are not in order, or begin left of 0.
    """
    in_order = 0.0 <= low[0] <= low[1] < high[0] <= high[1] and math.isfinite(low[1])
    if not in_order or plant.dt:
        return Interlacing(False, False, False)
    p = exact_matrix(plant.A).charpoly()
    common = _common_divisor(plant, p)
    opposite = _sign_of(p, low) * _sign_of(p, high) < 0
    has_low, has_high = (_has_zero(plant, common, ends) for ends in (low, high))
    return Interlacing(has_low, has_high, opposite)


def separated_zeros(plant: StateSpace) -> tuple[Range, Range] | None:
    """Ranges of two neighbouring blocking zeros, from 0 on, at which p has opposite signs; or None.

    The zeros are isolated as roots of an exact polynomial, so that a zero at 0 is exactly 0.
    """
    p = exact_matrix(plant.A).charpoly()
    common = _common_divisor(plant, p)
    roots: Any = common.numer().complex_roots()
    real = [root.real for root, _ in roots if root.imag == 0]
    found = sorted(_range_about(root) for root in real if not root < 0)
    if not np.any(plant.D):
        found.append((math.inf, math.inf))
    signed = [(ends, sign) for ends in found if (sign := _sign_of(p, ends))]
    for (low, below), (high, above) in pairwise(signed):
        if below * above < 0:
            return low, high
    return None


def _range_about(root: arb) -> Range:
    """Doubles on both sides of a root that a ball encloses; both equal it where it is 0."""
    if root == 0:
        return 0.0, 0.0
    low, high = float(root.lower()), float(root.upper())
    return math.nextafter(low, 0.0), math.nextafter(high, math.inf)


def _common_divisor(plant: StateSpace, p: fmpq_poly) -> fmpq_poly:
    """Greatest common divisor of the entries of n: n_ij = det(s I - A + b_j c_i) - p + d_ij p."""
    A, D = exact_matrix(plant.A), plant.D
    found = fmpq_poly([])
    for i, j in np.ndindex(D.shape):
        b, c = exact_matrix(plant.B[:, [j]]), exact_matrix(plant.C[[i]])
        found = found.gcd((A - b * c).charpoly() + (as_fraction(D[i, j]) - 1) * p)
    return found


def _has_zero(plant: StateSpace, common: fmpq_poly, ends: Range) -> bool:
    """Whether a range contains a blocking zero: the signs at its ends differ, or one is zero."""
    if math.isinf(ends[0]):
        return not np.any(plant.D)
    once = common / common.gcd(common.derivative()) if common else common  # its roots are simple
    low, high = (once(as_fraction(end)) for end in ends)
    return low * high <= 0


def _sign_of(p: fmpq_poly, ends: Range) -> int:
    """Sign that p has everywhere in a range; 0: not proven.

    About the middle m, p(m + t) = q_0 + q_1 t + ... keeps the sign of q_0 for |t| <= r where
    |q_0| exceeds the sum of the |q_k| r^k.
    """
    if math.isinf(ends[0]):
        return 1
    low, high = map(as_fraction, ends)
    first, *others = p(fmpq_poly([(low + high) / 2, 1])).coeffs()
    r = (high - low) / 2
    if abs(first) <= sum((abs(q) * r**k for k, q in enumerate(others, start=1)), fmpq(0)):
        return 0
    return 1 if first > 0 else -1


def exact_matrix(values: RealArray) -> fmpq_mat:
    """Doubles (m, n) as fractions."""
    rows, columns = values.shape
    return fmpq_mat(rows, columns, [as_fraction(value) for value in values.ravel()])


def as_fraction(value: float) -> fmpq:
    """A double as a fraction."""
    return fmpq(*float(value).as_integer_ratio())
