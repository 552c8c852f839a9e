"""The least distance of L = R exp(-s T) from -1, by branch and bound over frequency in balls."""

from __future__ import annotations

import heapq
from fractions import Fraction
from itertools import pairwise

from flint import acb, acb_poly, arb, ctx, fmpq, fmpq_poly

TOLERANCE = 1e-6
"""Share by which the bound may be below the least distance."""
LIMIT_TOLERANCE = 1e-3
"""The same where |L| keeps a size at infinity, about which it turns endlessly."""
BITS = 128
"""Precision of the balls."""
FIRST = 16
"""Frequencies between which the search begins, beside those that double from there on."""
MOST = 20_000
"""Most bands of frequency that are examined: the bound is what is proven by then."""


def least_distance(N: fmpq_poly, D: fmpq_poly, delay: Fraction, tail: float) -> float:
    """A lower bound of |1 + L| over all frequencies, L = N / D exp(-s delay).

    Beyond ``tail`` [rad/s] |L| is monotone, and its limit is below 1.
    """
    with ctx.workprec(BITS):
        bands = _Bands(acb_poly(N), acb_poly(D), arb(fmpq(delay.numerator, delay.denominator)))
        return bands.least(tail)


class _Bands:
    def __init__(self, N: acb_poly, D: acb_poly, T: arb) -> None:
        self.N, self.D, self.T = N, D, T
        self.slopes = N.derivative(), D.derivative()

    def least(self, tail: float) -> float:
        """The bound; bands are halved where it is least, until it is near a value that is taken."""
        limit = self._limit()
        share = 1 - (LIMIT_TOLERANCE if limit > 0 else TOLERANCE)
        end = max(tail, 1e-300)
        taken = min(1.0 - limit, self.at(end))
        while not self._beyond(end) >= taken * share:
            end *= 2.0
            taken = min(taken, self.at(end))
        edges = [0.0, *(end * 2.0**-k for k in range(FIRST, -1, -1))]
        bands = [(self.below(a, b), a, b) for a, b in pairwise(edges)]
        heapq.heapify(bands)
        for _ in range(MOST):
            bound, low, high = bands[0]
            middle = (low + high) / 2
            taken = min(taken, self.at(middle))
            if bound >= taken * share:
                break
            heapq.heapreplace(bands, (self.below(low, middle), low, middle))
            heapq.heappush(bands, (self.below(middle, high), middle, high))
        return min(bands[0][0], self._beyond(end), 1.0)

    def at(self, omega: float) -> float:
        """|1 + L| at a frequency, rounded up; infinite at a pole."""
        s = acb(0, omega)
        value = self.N(s) / self.D(s) * (-s * self.T).exp() + 1
        return float(abs(value).abs_upper()) if value.is_finite() else float("inf")

    def below(self, low: float, high: float) -> float:
        """A lower bound of |1 + L| on a band."""
        s = acb(0, arb(low).union(arb(high)))
        late = (-s * self.T).exp()
        N, D = self.N(s), self.D(s)
        size = abs(D).abs_upper()
        if not size > 0:
            return 0.0
        plain = abs(D + N * late).abs_lower() / size
        R = N / D
        if R.is_finite():
            for apart in (1 - abs(R).abs_upper(), abs(R).abs_lower() - 1):  # whatever the phase is
                plain = max(plain, apart.mid() if apart > 0 else arb(0))
            slope = ((self.slopes[0](s) - R * self.slopes[1](s)) / D - self.T * R) * late
            rate = 2 * ((R * late + 1).conjugate() * slope * acb(0, 1)).real
            m = acb(0, (low + high) / 2)
            middle = self.N(m) / self.D(m) * (-m * self.T).exp() + 1
            square = abs(middle) ** 2 + rate * (arb(0, (high - low) / 2))
            if square > 0:
                plain = max(plain, square.abs_lower().sqrt().abs_lower())
        return float(arb(plain).abs_lower()) * (1 - 2.0**-50)

    def _beyond(self, end: float) -> float:
        """A lower bound of |1 + L| from a frequency on."""
        s = acb(0, end)
        here = float(abs(self.N(s) / self.D(s)).abs_upper()) * (1 + 2.0**-50)
        return (1 - max(here, self._limit())) * (1 - 2.0**-50)

    def _limit(self) -> float:
        """|R| at infinity, rounded up."""
        degree = self.D.degree()
        return float(abs(self.N[degree] / self.D[degree]).abs_upper()) * (1 + 2.0**-50)
