"""Loops of one channel with the others closed, for several channels or dead times not in series.

With f the characteristic function of all loops closed, and f_k that with channel k opened, the loop
of the channel is L = (f - f_k) / f_k, a quotient of quasi-polynomials with exact coefficients. The
frequencies where |L| is 1 and where L is real are isolated on bands of frequency in ball
arithmetic. So no crossing is missed, up to the frequency beyond which |L| stays small.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
from flint import acb, arb, ctx, fmpq_poly

from workbench._core.arrays import EPS, ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certify.known_plants.exact_function import ExactFunction
from workbench.errors import InputError
from workbench.mu.loops.characteristic import LateChannels
from workbench.mu.loops.crossings import PRECISION, Crossing, ExactLoop
from workbench.mu.loops.delayed_loop import DelayedLoop
from workbench.mu.loops.delayed_modulus import LeastDelta
from workbench.mu.loops.encirclements import radius_where, zeros_right_of_axis
from workbench.mu.loops.far_bands import FarBands
from workbench.mu.loops.isolated_roots import RealFunction
from workbench.mu.loops.least_quotient import least_quotient
from workbench.mu.loops.phases import LimitPair
from workbench.mu.loops.quasi_polynomials import (
    QuasiPolynomial,
    without_common_factor,
)
from workbench.systems.axis_poles import POLE_ROUNDINGS

ZERO = Fraction(0)
SLOWEST = 2.0**-60
"""Least frequency of a nonzero crossing, relative to the frequency beyond which |L| stays small.
Slower crossings belong to poles that are integrators up to rounding. Half or double changes
nothing.
"""
LEVELS = [2.0**-k for k in range(2, 52, 3)]
"""Crossings of the real axis are reported down to these sizes |L|, in turn until a factor above 1
is found. With dead time there are infinitely many crossings.
"""
ABOVE_LIMIT = [0.5 * 5.0**-k for k in range(5)]
"""Crossings are searched in turn down to these shares above the level that is approached at
infinite frequency. The last one, 8e-4, is the largest error of a margin that is approached there,
unless more than two phases are free. Another share of a fifth takes five times as many bands.
"""
LIMITED_SHARE = 0.5
"""Where the terms of lower power are less than this share of the highest one, the frequency counts
as high. With half or double of it, bands are searched in doubles from twice or half the frequency.
"""
MODULUS_TOLERANCE = 1e-4
"""Largest relative distance of a proven modulus below the least distance. A modulus margin is
quoted to three digits. With half of it the search takes longer; double loosens a fourth digit.
"""


@dataclass(frozen=True, eq=False)
class CoupledLoops:
    """Loops closed with negative feedback, and quantities that all of them share.

    Unlike a closed `StateSpace`, it has exact coefficients, and dead times where signals
    return.
    """

    channels: LateChannels

    @cached_property
    def loops(self) -> list[CoupledLoop]:
        """The loop of each channel."""
        return [CoupledLoop(self, k) for k in range(self.channels.loops)]

    @cached_property
    def stable(self) -> bool:
        """Whether the system with all loops closed is stable, and remains so under rounding.

        Raises InputError if the gains that return with dead time are too large at infinite
        frequency.
        """
        if zeros_right_of_axis(self.channels.closed) != 0:
            return False
        crossings = [one.omega for loop in self.loops for one in loop.unit_crossings()]
        return not any(self.may_be_unstable(omega) for omega in crossings)

    def may_be_unstable(self, omega: float) -> bool:
        """Whether rounding of the entries puts a pole of the closed loop at a frequency."""
        Q, n = self.channels.Q, self.channels.states
        late = np.exp(-1j * omega * np.array([float(T) for T in self.channels.delays]))
        factors = np.concatenate([late, np.ones(self.channels.loops)])
        A, B, C, D = Q[:n, :n], Q[:n, n:] * factors, Q[n:, :n], Q[n:, n:] * factors
        inner = np.linalg.inv(np.eye(len(D)) - D)
        entries = np.abs(A) + np.abs(B) @ np.abs(inner) @ np.abs(C)
        try:
            near = np.abs(np.linalg.inv(1j * omega * np.eye(n) - A - B @ inner @ C))
        except np.linalg.LinAlgError:
            return True
        return not POLE_ROUNDINGS * EPS * float((near.T * entries).sum()) < 1.0


@dataclass(frozen=True, eq=False)
class CoupledLoop:
    """The loop L = N / D of one channel, the others closed.

    Unlike an `ExactLoop`, it is opened at one channel, while others with dead time stay closed.
    """

    whole: CoupledLoops
    channel: int

    @cached_property
    def _quotient(self) -> tuple[QuasiPolynomial, QuasiPolynomial]:
        opened = self.whole.channels.opened(self.channel)
        return without_common_factor(self.whole.channels.closed - opened, opened)

    @property
    def numerator(self) -> QuasiPolynomial:
        """N without the factors that it shares with D."""
        return self._quotient[0]

    @property
    def denominator(self) -> QuasiPolynomial:
        """D without the factors that it shares with N."""
        return self._quotient[1]

    @cached_property
    def _in_series(self) -> ExactLoop | DelayedLoop | None:
        """The loop as R exp(-s T), if its dead time is in series with the rest or has no effect on
        it; else None.
        """
        N, D = self._quotient
        if len(N.terms) > 1 or len(D.terms) > 1:
            return None
        ((T, p),) = N.terms.items() or [(Fraction(0), fmpq_poly([0]))]
        rational = ExactLoop(ExactFunction(p, D.undelayed), _static(), 0.0)
        return DelayedLoop(rational, T) if T else rational

    def unit_crossings(self) -> list[Crossing]:
        """Where |L| is 1, from low to high frequencies."""
        if self._in_series:
            return self._in_series.unit_crossings()
        with ctx.workprec(PRECISION):
            end = self._end_of_unit()
            roots = _Size(self.numerator, self.denominator).roots(SLOWEST * end, end)
            found = [self._crossing(omega) for omega in roots]
        return [one for one in found if self._seen(one)]

    def real_crossings(self) -> list[Crossing]:
        """Crossings with L negative and |L| above a level, low enough to show the nearest factor
        above 1.

        If L is, or comes close to, a negative number again and again up to infinite frequency, the
        largest of them below 1 is added as a crossing there.

        Raises InputError if a factor below 1 makes infinitely many poles unstable.
        """
        if self._in_series:
            return self._in_series.real_crossings()
        found = self._above_limit[0]
        return [*found, Crossing(math.inf, complex(-self.limit))] if self.limit else found

    def stable(self) -> bool:
        """Whether the system with all loops closed is stable, and remains so under rounding."""
        return self.whole.stable

    def modulus(self) -> float:
        """A proven lower bound of |1 + L| over all frequencies, close to the least value."""
        return self.least_delta(1.0, False, MODULUS_TOLERANCE).lower

    def exceeds(self, modulus: float) -> bool:
        """Whether |1 + L| is proven to be at least ``modulus`` at every frequency."""
        return modulus <= self.modulus()

    def least_delta(self, skew: float, pair: bool, tolerance: float) -> LeastDelta:
        """Bounds of the least disk factor in this channel that makes the loop unstable."""
        assert not pair  # here two channels are two loops
        closed = self.numerator + self.denominator
        # h = b D + a N with b = a + 1
        h = self.denominator + closed.scaled((skew - 1.0) / 2.0)
        return least_quotient(closed, h, self.whole.channels.delays, tolerance)

    def response(self, omega: RealArray) -> ComplexArray:
        """L at frequencies [rad/s] (F,); at infinity the negative of the `limit`."""
        with ctx.workprec(PRECISION):
            values = [self._value(w) if w < math.inf else -self.limit for w in omega.tolist()]
            return np.array([complex(value) for value in values], dtype=complex)

    @property
    def longest_delay(self) -> Fraction:
        """The longest dead time [s] along a path around all loops."""
        return max(self.whole.channels.closed.terms)

    @property
    def limit(self) -> float:
        """The largest -L below 1 that is approached at infinite frequency; 0 if there is none.

        It is a bound of all -L below 1 beyond the crossings that are known.
        """
        if self._in_series:
            return -float(self._in_series.response(np.array([math.inf])).real[0])
        return self._above_limit[1]

    @cached_property
    def _above_limit(self) -> tuple[list[Crossing], float]:
        """The known crossings, and the `limit`."""
        ends = self._limits
        if not ends.swapped.least_size(0.0):
            raise InputError(
                f"with a smaller gain in channel {self.channel + 1}, the gains that return with "
                "dead time add up to 1 or more at infinite frequency, or are not proven to stay "
                "below it: the closed loop may have infinitely many unstable poles; add a lag to "
                "plant or controller"
            )
        approached = ends.largest_crossing()
        levels = [level for level in LEVELS if level > (1 + ABOVE_LIMIT[0]) * approached]
        if approached:
            levels += [min((1 + share) * approached, 1.0) for share in ABOVE_LIMIT]
        elif ends.f.size and ends.least_size(0.0):
            levels = [0.0]  # beyond some frequency, L is never negative
        found: list[Crossing] = []
        bound = 1.0
        for level in levels:
            end = self._last_crossing(level)
            if end is None:
                return found, bound
            found, bound = self._real_above(level, end), level
            if any(one.value.real > -1.0 for one in found):
                return found, approached
        return found, bound if approached else 0.0

    def _value(self, omega: Any) -> acb:
        return self.numerator.at(omega) / self.denominator.at(omega)

    def _crossing(self, omega: arb) -> Crossing:
        return Crossing(float(omega), complex(self._value(omega)))

    @cached_property
    def _limits(self) -> LimitPair:
        """N and D over their highest power at infinite frequency."""
        return LimitPair.of(*self._quotient, self.denominator.order, self.whole.channels.delays)

    @cached_property
    def _high(self) -> float:
        """A frequency [rad/s] beyond which terms of lower power are small."""
        return self._end(
            LIMITED_SHARE * abs(self.denominator.leading(self.denominator.order)[ZERO])
        )

    def _last_crossing(self, level: float) -> float | None:
        """A frequency [rad/s] beyond which L is not negative with a size above a level; None if it
        is not known, or too far to be searched up to it.
        """
        room = min(self._limits.least_size(level), self._limits.swapped.least_size(0.0))
        end = self._end(room) if room else math.inf
        return end if end <= self._high or self._far_bands.suffice(end) else None

    def _end(self, room: float) -> float:
        """A frequency [rad/s] beyond which all terms of lower power of N and D add up to less."""
        n = self.denominator.order
        end = radius_where(
            lambda R: bool(sum((one.lower(R, n) for one in self._quotient), arb(0)) < room)
        )
        assert end is not None
        return end

    @cached_property
    def _far_bands(self) -> FarBands:
        return FarBands(*self._quotient, self.denominator.order, self._high)

    def _end_of_unit(self) -> float:
        """A frequency [rad/s] beyond which |L| stays on one side of 1."""
        N, D = self._quotient
        end = radius_where(lambda R: self._is_below(N, D, 1.0, R) or self._is_below(D, N, 1.0, R))
        if end is None:
            raise InputError(
                f"|L| of channel {self.channel + 1} comes close to 1 at infinite frequency, where "
                "dead time turns L around 0: it crosses the unit circle again and again; add a lag "
                "to plant or controller"
            )
        return end

    def _is_below(
        self, N: QuasiPolynomial, D: QuasiPolynomial, share: float, radius: float
    ) -> bool:
        """Whether |N| is below a share of |D| beyond a radius [rad/s]."""
        n = self.denominator.order
        first, others = D.sums(radius, n)
        return bool(sum(N.sums(radius, n), arb(0)) < share * (first - others))

    def _real_above(self, level: float, end: float) -> list[Crossing]:
        """Crossings with L negative and |L| above a level, up to the frequency ``end`` [rad/s]."""
        with ctx.workprec(PRECISION):
            function = _Imaginary(self.numerator, self.denominator, level)
            near = min(end, self._high)
            omega = [arb(0), *function.roots(SLOWEST * near, near)]
            far = self._far_bands.in_question(level, end) if end > near else []
            for band in far:
                omega += function.roots(*band)
            found = [self._crossing(one) for one in omega if abs(self.denominator.at(one)) > 0]
        real = [Crossing(one.omega, complex(one.value.real)) for one in found]
        return [one for one in real if one.value.real < -level and self._seen(one)]

    @staticmethod
    def _seen(one: Crossing) -> bool:
        """Whether the crossing is more than rounding, so that a finite gain moves it to -1."""
        return POLE_ROUNDINGS * EPS * abs(one.value) < 1.0


def _static() -> StateSpace:
    import control

    return control.ss([], [], [], [[0.0]])


class _Size(RealFunction):
    """|N|^2 - |D|^2; bands are skipped where |N| is below |D| for all phases of the
    exponentials.
    """

    level = 1.0
    """Bands where |N| is below this multiple of |D| are skipped: there the function has no zero. It
    follows from the function; half skips fewer bands, and double would skip zeros.
    """

    def __init__(self, N: QuasiPolynomial, D: QuasiPolynomial) -> None:
        self.N, self.D = N, D

    def at(self, omega: Any) -> arb:
        return _square(self.N.at(omega)) - _square(self.D.at(omega))

    def size(self, omega: float) -> arb:
        return _square(self.N.at(omega)) + _square(self.D.at(omega))

    def excluded(self, low: float, high: float) -> bool:
        if self._small(low, high):
            return True
        N, D = abs(self.N.on(low, high)), abs(self.D.on(low, high))
        return bool(N > D or N < D)

    def slope(self, low: float, high: float) -> arb:
        return _slope(self.N, self.N, low, high).real - _slope(self.D, self.D, low, high).real

    def _small(self, low: float, high: float) -> bool:
        most, least = self.N.sizes(low, high)[1], self.D.sizes(low, high)[0]
        return bool(most < self.level * least)


class _Imaginary(_Size):
    """Im(N D*); bands are skipped where |L| is below a level."""

    def __init__(self, N: QuasiPolynomial, D: QuasiPolynomial, level: float) -> None:
        super().__init__(N, D)
        self.level = level

    def at(self, omega: Any) -> arb:
        return (self.N.at(omega) * self.D.at(omega).conjugate()).imag

    def size(self, omega: float) -> arb:
        return abs(self.N.at(omega)) * abs(self.D.at(omega))

    def excluded(self, low: float, high: float) -> bool:
        if self._small(low, high):
            return True
        product = self.N.on(low, high) * self.D.on(low, high).conjugate()
        return bool(product.imag > 0 or product.imag < 0 or product.real > 0)

    def slope(self, low: float, high: float) -> arb:
        return _slope(self.N, self.D, low, high).imag


def _slope(f: QuasiPolynomial, g: QuasiPolynomial, low: float, high: float) -> acb:
    """A ball that contains the derivative of f g* over frequency on a band."""
    j = acb(0, 1)
    band = arb(low).union(arb(high))
    F, G = f.on(low, high), g.on(low, high)
    return j * f.derivative.at(band) * G.conjugate() + F * (j * g.derivative.at(band)).conjugate()


def _square(value: acb) -> arb:
    return value.real**2 + value.imag**2
