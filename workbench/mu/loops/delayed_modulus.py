"""Least distance of L = R exp(-s T) from -1, by branch and bound over frequency in ball arithmetic.

With the skew e, b = (1 + e) / 2 and a = b - 1, a channel's factor f of `workbench.mu.margins.disk`
breaks the loop where delta = (1 + L) / (b + a L). For a disk in one channel, the least size of
delta is this |delta|; with e = 1 it is the distance of L from -1. Where plant and controller have a
factor each, mu of both factors is that of [[A, B], [C, A]] with A = (b + a L) / (1 + L) and B C =
-L / (1 + L)^2, which is the largest singular value with |B| = |C|, as D-scaling is exact for two
blocks. So the least size of delta is, squared,

    |1 + L|^2 / (p + sqrt(p^2 - d^2)),  p = |b + a L|^2 + |L|,  d = |b^2 + (2 a b + 1) L + a^2 L^2|.

Over all L with |L| <= r < 1, it is least on the circle |L| = r: 1 / mu is logarithmically
subharmonic in L.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

from flint import acb, acb_poly, arb, ctx, fmpq, fmpq_poly

from workbench.certify.balls import above, below
from workbench.mu.loops.crossings import PRECISION

DISTANCE_TOLERANCE = 1e-6
"""Largest relative distance of the lower bound below the least distance, unless another one is
asked for. Distances are compared to six digits. With half of it more bands are halved; double
changes the sixth digit.
"""
LIMIT_TOLERANCE = 1e-3
"""The same for a loop where |L| does not fall to 0 at infinite frequency, and L turns around 0
forever. There bands are needed forever, and each digit takes many more. Half takes longer; double
loosens a third digit.
"""
FIRST_BANDS = 16
"""Number of frequencies that divide the first bands of the search; beyond them, bands double in
width. They reach from the end down to 2^-16 of it, which is nearly 0. With half of them the first
band is wider, and is halved more often; double costs time.
"""
MOST_BANDS = 20_000
"""Largest number of bands examined; the answer is the bound proven by then. The search ends earlier
once the bounds meet. Half or double changes the bound only where L turns many times.
"""
ARCS, MOST_ARCS = 8, 400
"""Number of arcs into which a half circle is cut first if the phase of L is arbitrary, and the
largest number. Arcs are halved where the bound is least. Half or double of the first changes
nothing but the time; of the second, how near a bound on an arc comes to the least value.
"""


@dataclass(frozen=True)
class LeastDelta:
    """No |delta| < ``lower`` breaks the loop; one of size ``upper`` does, at ``omega``.

    ``omega`` [rad/s] is infinite if ``upper`` is only approached at infinite frequency.
    """

    lower: float
    upper: float
    omega: float


def least_distance(N: fmpq_poly, D: fmpq_poly, delay: Fraction, tail: float) -> float:
    """A lower bound of |1 + L| over all frequencies; arguments as of `least_delta`."""
    return least_delta(N, D, delay, tail, skew=1.0).lower


def least_delta(
    N: fmpq_poly,
    D: fmpq_poly,
    delay: Fraction,
    tail: float,
    *,
    skew: float,
    pair: bool = False,
    tolerance: float = DISTANCE_TOLERANCE,
) -> LeastDelta:
    """Bounds of the least |delta| that breaks the loop, L = N / D exp(-s delay).

    Beyond ``tail`` [rad/s], |L| is monotone with a limit below 1. With ``pair``, plant and
    controller have a factor each; otherwise only one of them does.
    """
    with ctx.workprec(PRECISION):
        T = arb(fmpq(delay.numerator, delay.denominator))
        return Bands(acb_poly(N), acb_poly(D), T, skew, pair).least(tail, tolerance)


class Bands:
    """Bounds of the least |delta| on bands of frequency."""

    def __init__(
        self, N: acb_poly, D: acb_poly, T: arb, skew: float = 1.0, pair: bool = False
    ) -> None:
        self.N, self.D, self.T, self.pair = N, D, T, pair
        self.b = (1 + arb(skew)) / 2
        self.a = self.b - 1
        self.slopes = N.derivative(), D.derivative()

    def least(self, tail: float, tolerance: float) -> LeastDelta:
        """The bounds; the band of least bound is halved until that is near an attained value."""
        share = 1 - (max(LIMIT_TOLERANCE, tolerance) if self._limit() > 0 else tolerance)
        end = max(tail, 1e-300)
        taken = min((self._at_infinity(), math.inf), (self.at(end), end))
        while not self._bound_beyond(end) >= taken[0] * share:
            end *= 2.0
            taken = min(taken, (self.at(end), end))
        edges = [0.0, *(end * 2.0**-k for k in range(FIRST_BANDS, -1, -1))]
        bands = [(self.below(low, high), low, high) for low, high in pairwise(edges)]
        heapq.heapify(bands)
        taken = min(taken, (self.at(0.0), 0.0))
        for _ in range(MOST_BANDS):
            bound, low, high = bands[0]
            middle = (low + high) / 2
            taken = min(taken, (self.at(middle), middle))
            if bound >= taken[0] * share:
                break
            heapq.heapreplace(bands, (self.below(low, middle), low, middle))
            heapq.heappush(bands, (self.below(middle, high), middle, high))
        lower = min(bands[0][0], self._bound_beyond(end), taken[0])
        return LeastDelta(lower, *taken)

    def at(self, omega: float) -> float:
        """The least |delta| at a frequency, rounded up."""
        s = acb(0, omega)
        return self._delta_rounded_up(self.N(s) * (-s * self.T).exp(), self.D(s))

    def below(self, low: float, high: float) -> float:
        """A lower bound of the least |delta| on a band."""
        s = acb(0, arb(low).union(arb(high)))
        late = (-s * self.T).exp()
        N, D = self.N(s), self.D(s)
        plain = self._delta_rounded_down(N * late, D)
        R = N / D
        if not R.is_finite():
            return plain
        m, half = acb(0, (low + high) / 2), (high - low) / 2
        slope = ((self.slopes[0](s) - R * self.slopes[1](s)) / D - self.T * R) * late
        middle = self.N(m) / self.D(m) * (-m * self.T).exp()
        if not self.pair:  # delta is analytic, with the slope L' / (b + a L)^2
            below = self.b + self.a * (R * late)
            rate = 2 * (((R * late + 1) / below).conjugate() * slope / below**2 * acb(0, 1)).real
            square = abs((middle + 1) / (self.b + self.a * middle)) ** 2 + rate * arb(0, half)
            plain = max(plain, least_double(square.abs_lower().sqrt()) if square > 0 else 0.0)
        elif middle.is_finite():
            plain = max(
                plain, self._delta_rounded_down(middle + slope * acb(0, arb(0, half)), acb(1))
            )
        if high - low > 1 / self.T:  # L turns by a large angle: its phase is taken as arbitrary
            plain = max(plain, self._on_circle(abs(R)))
        return plain

    def _delta_rounded_down(self, N: acb, D: acb) -> float:
        """The least |delta| for L = N / D, rounded down."""
        inner, d = self._inner(N, D)
        size = inner.abs_upper()
        if self.pair:
            size = _paired(size**2 + abs(N).abs_upper() * abs(D).abs_upper(), d.abs_lower())
        return least_double(abs(D + N).abs_lower() / size) if size > 0 else math.inf

    def _delta_rounded_up(self, N: acb, D: acb) -> float:
        """The least |delta| for L = N / D, rounded up."""
        inner, d = self._inner(N, D)
        size = inner.abs_lower()
        if self.pair:
            size = _paired(size**2 + abs(N).abs_lower() * abs(D).abs_lower(), d.abs_upper())
        found = abs(D + N).abs_upper() / size if size > 0 else arb("inf")
        return above(found.abs_upper())

    def _inner(self, N: acb, D: acb) -> tuple[arb, arb]:
        """|b + a L| times |D|, and d times |D|^2."""
        a, b = self.a, self.b
        return abs(b * D + a * N), abs(b**2 * D**2 + (2 * a * b + 1) * N * D + a**2 * N**2)

    def _on_circle(self, sizes: arb) -> float:
        """A lower bound of the least |delta| for this |L| and any phase; 0 if L may be -1."""
        if sizes < 1:
            r = sizes.abs_upper()
        elif sizes > 1:
            r = sizes.abs_lower()
        else:
            return 0.0
        if not self.pair:  # on the circle |1 / delta| is largest where L is real
            ends = [abs(self.b - self.a * r) / abs(1 - r), abs(self.b + self.a * r) / (1 + r)]
            return min(least_double(1 / end) if end > 0 else math.inf for end in ends)
        arcs = [(0.0, k / ARCS, (k + 1) / ARCS) for k in range(ARCS)]
        arcs = [(self._on_arc(r, low, high), low, high) for _, low, high in arcs]
        heapq.heapify(arcs)
        taken = math.inf
        for _ in range(MOST_ARCS):
            bound, low, high = arcs[0]
            middle = (low + high) / 2
            taken = min(taken, self._delta_rounded_up(_polar(r, arb(middle)), acb(1)))
            if bound >= taken * (1 - LIMIT_TOLERANCE / 4):
                break
            heapq.heapreplace(arcs, (self._on_arc(r, low, middle), low, middle))
            heapq.heappush(arcs, (self._on_arc(r, middle, high), middle, high))
        return arcs[0][0]

    def _on_arc(self, r: arb, low: float, high: float) -> float:
        return self._delta_rounded_down(_polar(r, arb(low).union(arb(high))), acb(1))

    def _bound_beyond(self, end: float) -> float:
        """A lower bound of the least |delta| beyond a frequency."""
        s = acb(0, end)
        return self._on_circle(abs(self.N(s) / self.D(s)).union(self._limit()))

    def _at_infinity(self) -> float:
        """A value of |delta| that is approached at infinite frequency, where L is real again and
        again.
        """
        limit = self._limit()
        return min(self._delta_rounded_up(acb(sign * limit), acb(1)) for sign in (-1, 1))

    def _limit(self) -> arb:
        """|R| at infinity."""
        degree = self.D.degree()
        return abs(self.N[degree] / self.D[degree])


def _polar(r: arb, half_turns: arb) -> acb:
    """r exp(j pi half_turns)."""
    return acb(0, arb.pi() * half_turns).exp() * r


def _paired(p: arb, d: arb) -> arb:
    """(p + (p^2 - d^2)^(1/2))^(1/2), with 0 for the root of a negative number."""
    square = p**2 - d**2
    return (p + (square.sqrt() if square > 0 else arb(0))).sqrt()


def least_double(value: arb) -> float:
    """The least number in a ball of positive numbers, rounded down; 0 if the ball is unbounded."""
    return below(value.abs_lower()) if value.is_finite() else 0.0
