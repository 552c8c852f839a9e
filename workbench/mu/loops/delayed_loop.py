"""Crossings and stability of a loop L = R exp(-s T) of one channel, R rational and T known.

Since |L| = |R|, crossings of the unit circle are roots of a polynomial. The phase of L has the
slope Re(R' / R) - T over frequency, a rational function of omega^2: between its zeros, and the
frequencies at which R crosses an axis, the phase of L is monotone and R stays in one quadrant, so
that no crossing of the real axis is missed.

The poles of the closed loop right of the axis are counted: those of 1 + R, and for every crossing
of the unit circle at omega the pairs that cross the axis there at the delays tau + 2 pi m / omega
up to T. They cross to the right where |R| falls through 1 (K. L. Cooke, P. van den Driessche, On
zeroes of some transcendental equations, Funkcialaj Ekvacioj 29 (1986) 77-90). With |R| >= 1 at
infinity there would be infinitely many crossings; such a loop is refused.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from flint import acb, acb_poly, arb, ctx, fmpq, fmpq_poly

from workbench._core.arrays import EPS, ComplexArray, RealArray
from workbench.certify.known_plants.exact_function import (
    ExactFunction,
    X,
    exact_square,
    products,
)
from workbench.mu.loops.crossings import (
    PRECISION,
    Crossing,
    ExactLoop,
    positive_roots,
)
from workbench.mu.loops.delayed_modulus import LeastDelta, least_delta, least_distance
from workbench.systems.axis_poles import POLE_ROUNDINGS

HALVINGS = 80
"""Number of bisections for a crossing of the real axis within an interval of frequency. They leave
2^-80 of the interval. With half of them crossings may have fewer digits than a double; more change
nothing.
"""
CROSSINGS_PER_END = 3
"""Number of crossings of the negative real axis that are reported at either end of an interval on
which gain and phase are monotone; in all there are infinitely many. A choice for tables and
figures: the margins come from all crossings. Half or double lists fewer or more.
"""
SAME_ROOT = 2.0**-100
"""Roots of several polynomials within this relative distance are one, such as poles on the axis.
Roots are known to 2^-150 or so, except multiple ones. Half or double changes nothing.
"""
END_MARGIN = 2.0**-90
"""An interval of frequency ends this share before its limit, such as a pole on the axis. It is far
from the rounding of the balls and far below that of a double. Half or double changes nothing.
"""
BORDER = 2.0**-140
"""A count of crossings this close to a whole number is undecided. The phase has `PRECISION` bits,
of which 50 may be lost. Half or double changes nothing but for a pole that is on the axis.
"""


@dataclass(frozen=True, eq=False)
class DelayedLoop:
    """L = R exp(-s delay), with R as an `ExactLoop` in continuous time and the delay [s] exact.

    Unlike an `ExactLoop`, it has a dead time.
    """

    rational: ExactLoop
    delay: Fraction

    def unit_crossings(self) -> list[Crossing]:
        """Crossings with |L| = 1, from low to high frequencies."""
        found = self.rational.unit_crossings()
        values = self.response(np.array([one.omega for one in found]))
        return [Crossing(o.omega, complex(v)) for o, v in zip(found, values, strict=True)]

    def real_crossings(self) -> list[Crossing]:
        """Crossings with L negative; of infinitely many, those at the ends of monotone intervals.

        If |L| does not fall to 0 at infinite frequency, its limit is added as a crossing there.
        """
        start = self.rational._at_zero()
        found = [start] if start and start.value.real < 0 else []
        with ctx.workprec(PRECISION):
            breaks = [arb(0), *self._breaks()]
            for low, high in zip(breaks, [*breaks[1:], None], strict=True):
                found += [self._crossing(omega) for omega in self._negative_real_omegas(low, high)]
        limit = self._limit
        if limit:
            found.append(Crossing(math.inf, complex(-float(limit))))
        every = sorted((one for one in found if self._seen(one)), key=lambda one: one.omega)
        return [one for k, one in enumerate(every) if not k or one.omega > every[k - 1].omega]

    def stable(self) -> bool:
        """Whether the loop with negative feedback is stable, and remains so under rounding."""
        closed = self._numerator + self._denominator
        hidden = self.rational.function.denominator.gcd(self.rational.function.numerator)
        if not closed[0] or self._limit >= 1 or self._right(hidden) or self._on_axis(hidden):
            return False
        return self.unstable_poles() == 0 and not any(
            self.may_be_unstable(one.omega) for one in [*self.unit_crossings(), *self._nearest()]
        )

    def modulus(self) -> float:
        """A proven lower bound of |1 + L| over all frequencies, close to the least value."""
        return least_distance(self._numerator, self._denominator, self.delay, self._tail())

    def exceeds(self, modulus: float) -> bool:
        """Whether |1 + L| is proven to be at least ``modulus`` at every frequency."""
        return modulus <= self.modulus()

    def least_delta(self, skew: float, pair: bool, tolerance: float) -> LeastDelta:
        """Bounds of the least disk factor that makes the loop unstable; see `least_delta`."""
        N, D = self._numerator, self._denominator
        tail = self._tail()
        return least_delta(N, D, self.delay, tail, skew=skew, pair=pair, tolerance=tolerance)

    def response(self, omega: RealArray) -> ComplexArray:
        """L at frequencies [rad/s] (F,); at infinity 0, or minus the limit of its size."""
        with ctx.workprec(PRECISION):
            return np.array(
                [complex(self._value(arb(w))) if w < math.inf else -float(self._limit)
                 for w in omega],
                dtype=complex,
            )  # fmt: skip

    def may_be_unstable(self, omega: float, gain: float = 1.0) -> bool:
        """Whether rounding of the entries of R may make L = -1 / gain at a frequency."""
        L = self.rational.system
        size = abs(L.D[0, 0])
        if L.nstates:
            try:
                resolvent = np.linalg.inv(1j * omega * np.eye(L.nstates) - L.A)
            except np.linalg.LinAlgError:
                return False
            size += (np.abs(L.C) @ np.abs(resolvent) @ np.abs(L.B)).item()
        distance = abs(1.0 + gain * self.response(np.array([omega])).item())
        return bool(distance <= POLE_ROUNDINGS * EPS * (1.0 + gain * size))

    @property
    def longest_delay(self) -> Fraction:
        """The dead time [s]."""
        return self.delay

    # --- the rational part --------------------------------------------------------------------

    @cached_property
    def _reduced(self) -> ExactFunction:
        N, D = self.rational.function.numerator, self.rational.function.denominator
        common = N.gcd(D) if N else D / D.leading_coefficient()
        return ExactFunction(N // common, D // common)

    @property
    def _numerator(self) -> fmpq_poly:
        return self._reduced.numerator

    @property
    def _denominator(self) -> fmpq_poly:
        return self._reduced.denominator

    @property
    def _limit(self) -> fmpq:
        """|R| at infinity."""
        degree = self._denominator.degree()
        return abs(self._numerator[degree] / self._denominator[degree])

    @property
    def _exact_delay(self) -> fmpq:
        return fmpq(self.delay.numerator, self.delay.denominator)

    def _value(self, omega: arb) -> acb:
        s = acb(0, omega)
        R = acb_poly(self._numerator)(s) / acb_poly(self._denominator)(s)
        return R * acb(0, -omega * arb(self._exact_delay)).exp()

    def _flat(self) -> fmpq_poly:
        """Polynomial of x whose zeros are the stationary points of |R|."""
        above, below = exact_square(self._numerator), exact_square(self._denominator)
        return above.derivative() * below - above * below.derivative()

    def _tail(self) -> float:
        """A frequency [rad/s] beyond which |R| is monotone."""
        with ctx.workprec(PRECISION):
            return max((float(x.sqrt()) for x in positive_roots(self._flat())), default=0.0)

    def _breaks(self) -> list[arb]:
        """Frequencies between which |R| and the phase of L are monotone, and R stays in one
        quadrant.
        """
        N, D = self._numerator, self._denominator
        even, odd = products(N, D)  # N D* = even + j omega odd
        square = exact_square(N) * exact_square(D)
        slope = even * (odd + 2 * X * odd.derivative()) - 2 * X * odd * even.derivative()
        turning = slope - self._exact_delay * square
        crossed = exact_square(N) - exact_square(D)
        parts = (even, odd, square, turning, self._flat(), crossed)
        every: list[Any] = [x.sqrt().mid() for part in parts for x in positive_roots(part)]
        every.sort()
        return [one for k, one in enumerate(every) if not k or one > every[k - 1] * (1 + SAME_ROOT)]

    # --- crossings of the negative real axis ---------------------------------------------------

    def _negative_real_omegas(self, low: arb, high: arb | None) -> list[arb]:
        """Frequencies in an interval at which L is negative, nearest to its ends; ``high`` None: no
        end.
        """
        quadrant = self._quadrant(low * 2 + 1 if high is None else (low + high) / 2)
        low = low * (1 + END_MARGIN) if low > 0 else arb(2) ** -PRECISION
        first = float(self._phase(low, quadrant))
        if high is None:
            if not self.delay:
                return []
            last = first - 2 * math.pi * (CROSSINGS_PER_END + 1)
            high = low + 2 * math.pi * (CROSSINGS_PER_END + 3) / arb(self._exact_delay)
        else:
            high = high * (1 - END_MARGIN)
            last = float(self._phase(high, quadrant))
        down, up = sorted([first, last])
        turns = range(math.floor((down / math.pi - 1) / 2), math.ceil((up / math.pi - 1) / 2) + 1)
        wanted = [k for k in turns if down < (2 * k + 1) * math.pi < up]
        chosen = (
            wanted
            if len(wanted) <= 2 * CROSSINGS_PER_END
            else [*wanted[:CROSSINGS_PER_END], *wanted[-CROSSINGS_PER_END:]]
        )
        return [self._at_phase(low, high, (2 * k + 1), quadrant, last < first) for k in chosen]

    def _quadrant(self, omega: arb) -> float:
        """The middle [rad] of the quadrant in which R lies."""
        value = complex(self._value(omega) * acb(0, omega * arb(self._exact_delay)).exp())
        turn = math.atan2(value.imag, value.real)
        return (math.floor(turn / (math.pi / 2)) + 0.5) * math.pi / 2

    def _phase(self, omega: arb, quadrant: float) -> arb:
        """The phase [rad] of L; the phase of R is counted from the middle of its quadrant."""
        s = acb(0, omega)
        above, below = acb_poly(self._numerator)(s), acb_poly(self._denominator)(s)
        R: acb = above * below.conjugate() * acb(0, -quadrant).exp()
        return R.arg().mid() + quadrant - omega * arb(self._exact_delay)

    def _at_phase(self, low: arb, high: arb, turns: int, quadrant: float, falls: bool) -> arb:
        """The frequency at which the phase is this many half turns."""
        wanted = arb.pi() * turns
        for _ in range(HALVINGS):
            middle = ((low + high) / 2).mid()
            above = bool((self._phase(middle, quadrant) - wanted).mid() > 0)
            low, high = (middle, high) if above == falls else (low, middle)
        return ((low + high) / 2).mid()

    def _crossing(self, omega: arb) -> Crossing:
        return Crossing(float(omega), complex(complex(self._value(omega)).real))

    def _seen(self, one: Crossing) -> bool:
        return bool(abs(one.value) > 0) and self.rational._seen(one)

    # --- poles of the closed loop --------------------------------------------------------------

    def unstable_poles(self) -> int | None:
        """Number of closed-loop poles right of the axis; None if one is within BORDER of it."""
        count = self._right(self._numerator + self._denominator)
        square = exact_square(self._denominator) - exact_square(self._numerator)
        with ctx.workprec(PRECISION):
            roots = positive_roots(square)
            signs = _signs_between(square, roots)
            for x, (before, after) in zip(roots, pairwise(signs), strict=True):
                omega = x.sqrt().mid()
                s = acb(0, omega)
                R = acb_poly(self._numerator)(s) / acb_poly(self._denominator)(s)
                turn = (-R).arg().mid() / (2 * arb.pi())  # at a delay of 0
                turn = turn + 1 if turn < -BORDER else turn
                passed = omega * arb(self._exact_delay) / (2 * arb.pi()) - turn
                whole = _floor(passed)
                if min(abs(passed - whole), abs(passed - whole - 1)) < BORDER:
                    return None
                pairs = max(whole + 1, 0)
                if abs(turn) <= BORDER and after < before and pairs:
                    pairs -= 1  # it is on the axis without delay, and left of it with any delay
                count += (after - before) * pairs
        return count

    def _nearest(self) -> list[Crossing]:
        return [one for one in self.real_crossings() if math.isfinite(one.omega)]

    @staticmethod
    def _right(polynomial: fmpq_poly) -> int:
        """Number of roots right of the axis."""
        roots: Any = polynomial.complex_roots() if polynomial.degree() > 0 else []
        return sum(k for root, k in roots if root.real > 0)

    @staticmethod
    def _on_axis(polynomial: fmpq_poly) -> bool:
        roots: Any = polynomial.complex_roots() if polynomial.degree() > 0 else []
        return any(not root.real > 0 and not root.real < 0 for root, _ in roots)


def _signs_between(polynomial: fmpq_poly, roots: list[arb]) -> list[int]:
    """Signs of a polynomial below the first of its positive roots, between them and beyond."""
    ends = [arb(0), *roots]
    middles = [(low + high) / 2 for low, high in pairwise(ends)]
    values = [polynomial(_rational(one)) for one in [*middles, 2 * ends[-1] + 1]]
    return [(value > 0) - (value < 0) for value in values]


def _floor(value: arb) -> int:
    whole: Any = math.floor(_rational(value))  # a fmpz, which its annotation does not say
    return int(whole)


def _rational(value: arb) -> fmpq:
    """A dyadic rational near the middle of a ball."""
    mantissa, exponent = value.mid().man_exp()
    return fmpq(mantissa) * fmpq(2) ** int(exponent)
