"""Number of zeros of a quasi-polynomial right of the axis, from its turns about 0.

Along the axis the turns are added up over bands, on each of which the function is proven to lie in
a half plane. Beyond a radius, its highest power without delay is larger than all other terms
together, so that on the half circle there the function turns as that power does.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction

from flint import acb, arb, ctx

from workbench.errors import InputError
from workbench.mu.loops.crossings import PRECISION
from workbench.mu.loops.quasi_polynomials import QuasiPolynomial

MOST_BANDS = 40_000
"""Largest number of bands; if they do not suffice, a zero is on the axis or very close to it. Half
or double changes how near to the axis a zero may be, and how long such a loop takes.
"""
EXPONENT = 1000
"""The largest radius tried is 2 to this power, and the smallest its reciprocal. Doubles end at
2^1023. Half still holds every loop in usual units; double is no double.
"""


def zeros_right_of_axis(f: QuasiPolynomial) -> int | None:
    """The number of zeros with a positive real part; None where one may be on the axis.

    Raises InputError as `need_decaying` does.
    """
    with ctx.workprec(PRECISION):
        n, end = f.order, need_decaying(f)
        turned = _turn_angle(f, end)
        if turned is None:
            return None
        top = f.at(end) / (f.undelayed[n] * acb(0, end) ** n)
        return round(float((arb(n) / 2 + (top.arg() - turned) / arb.pi()).mid()))


def need_decaying(f: QuasiPolynomial) -> float:
    """A radius beyond which the highest power without delay dominates all other terms.

    Raises InputError if there is none: then infinitely many zeros lie right of the axis, or zeros
    come arbitrarily close to it.
    """
    end = radius_where(lambda R: _dominates(f, R))
    if end is None:
        sizes = {T: abs(c) for T, c in f.leading(f.order).items()}
        first = sizes.pop(Fraction(0))
        raise InputError(
            f"the gains that return with dead time add up to {sum(sizes.values()) / first:.6g} at "
            "infinite frequency: the closed loop has infinitely many unstable poles, or may be on "
            "the border to that; make the sum less than 1, for instance by a lag"
        )
    return end


def radius_where(holds: Callable[[float], bool]) -> float | None:
    """The least power of 2 from which on a condition holds; None if it never does.

    The condition must be monotone: if it holds at a radius, it holds beyond it.
    """
    low, high = -EXPONENT, EXPONENT
    if not holds(math.ldexp(1.0, high)):
        return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if holds(math.ldexp(1.0, middle)) else (middle, high)
    return math.ldexp(1.0, high)


def _dominates(f: QuasiPolynomial, radius: float) -> bool:
    first, others = f.sums(radius, f.order)
    return bool(others < first)


def _turn_angle(f: QuasiPolynomial, end: float) -> arb | None:
    """The angle [rad] by which f turns from 0 to a frequency; None if a zero may lie on the way."""
    total, bands = arb(0), [(0.0, end)]
    for _ in range(MOST_BANDS):
        if not bands:
            return total
        low, high = bands.pop()
        middle = (low + high) / 2
        centre = f.at(middle).conjugate()
        if (f.on(low, high) * centre).real > 0:
            total += (f.at(high) * centre).arg() - (f.at(low) * centre).arg()
        elif low < middle < high:
            bands += [(low, middle), (middle, high)]
        else:
            return None
    return None
