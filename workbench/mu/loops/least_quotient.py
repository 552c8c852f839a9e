"""The least |f / h| of two quasi-polynomials along the axis, by branch and bound over frequency.

With the skew e, b = (1 + e) / 2 and a = b - 1, a channel's factor of `workbench.mu.margins.disk`
breaks a loop L = N / D with |delta| = |N + D| / |b D + a N|; for e = 1 this is the distance of L
from -1.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise

from flint import acb, arb, ctx

from workbench.certify.balls import above
from workbench.mu.loops.crossings import PRECISION
from workbench.mu.loops.delayed_modulus import (
    LIMIT_TOLERANCE,
    MOST_BANDS,
    LeastDelta,
    least_double,
)
from workbench.mu.loops.encirclements import EXPONENT, radius_where
from workbench.mu.loops.phases import ROUNDING, LimitPair
from workbench.mu.loops.quasi_polynomials import QuasiPolynomial

FIRST_BANDS = 16
"""Number of first bands; each is twice as wide as the one before. They reach down to 2^-16 of the
end. With half of them the first band is wider, and is halved more often; double costs time.
"""
TRIED_OMEGAS = 80
"""Number of frequencies, half an octave apart, at which a small value is searched for first. They
reach forty octaves down from the frequency beyond which no value is small. With half of them the
search may start from a larger value, and takes longer; double costs time.
"""
FARTHEST = 2.0**EXPONENT
"""Radius that stands for infinity."""
LIMIT_SHARE = 2.0**-30
"""Relative distance by which bounds beyond a radius may be below the value at infinity. A bound may
come near to its limit only at infinity. With half of it the search goes on to twice the frequency;
double loosens a bound by 2e-9 at most.
"""


def least_quotient(
    f: QuasiPolynomial, h: QuasiPolynomial, parts: Sequence[Fraction], tolerance: float
) -> LeastDelta:
    """Bounds of the least |f / h|, for f without zeros on the axis; infinite where h is 0.

    ``parts`` [s] are the dead times of the loop.

    Bands are halved until the bounds agree to ``tolerance``, relative, or the number of bands is
    too large.
    """
    with ctx.workprec(PRECISION):
        if not any(h.terms.values()):
            return LeastDelta(math.inf, math.inf, math.inf)
        return _Search(f, h, parts, tolerance).least(1.0 - tolerance)


class _Search:
    def __init__(
        self,
        f: QuasiPolynomial,
        h: QuasiPolynomial,
        parts: Sequence[Fraction],
        tolerance: float,
    ) -> None:
        self.f, self.h = f, h
        limits = LimitPair.of(f, h, f.order, parts)
        self.least_limit, self.limit = limits.least_ratio(tolerance / 2.0)
        self.largest_h = limits.g.size * (1.0 + ROUNDING)

    def least(self, share: float) -> LeastDelta:
        first = min([(self.limit, math.inf), *((self._at(w), w) for w in self._first_omegas())])
        if first[1] == math.inf:  # approached, perhaps from above at ever higher frequencies
            share = min(share, 1.0 - LIMIT_TOLERANCE)
        wanted = min(first[0] * share, self._bound_beyond(FARTHEST) * (1.0 - LIMIT_SHARE))
        end = radius_where(lambda R: self._bound_beyond(R) >= wanted)
        assert end is not None
        edges = [0.0, *(end * 2.0**-k for k in range(FIRST_BANDS, -1, -1))]
        bands = [(self._below(low, high), low, high) for low, high in pairwise(edges)]
        heapq.heapify(bands)
        taken = min(first, (self._at(0.0), 0.0))
        for _ in range(MOST_BANDS):
            bound, low, high = bands[0]
            middle = (low + high) / 2
            taken = min(taken, (self._at(middle), middle))
            if bound >= taken[0] * share:
                break
            heapq.heapreplace(bands, (self._below(low, middle), low, middle))
            heapq.heappush(bands, (self._below(middle, high), middle, high))
        return LeastDelta(min(bands[0][0], self._bound_beyond(end), taken[0]), *taken)

    def _first_omegas(self) -> list[float]:
        """Frequencies at which a small value is searched for first."""
        end = radius_where(lambda R: self._bound_beyond(R) > 0)
        return [] if end is None else [end * 2.0 ** (-k / 2) for k in range(TRIED_OMEGAS)]

    def _bound_beyond(self, end: float) -> float:
        """A lower bound of the quotient beyond a frequency.

        There f and h over their highest power differ from their limits by their lower terms. The
        limits are such that |f| >= max(least_f, least_limit |h|).
        """
        (first, others), lower = self.f.sums(end, self.f.order), self.f.lower(end, self.f.order)
        least_f, more_h = first - others, self.h.lower(end, self.f.order)
        if not least_f > 0:
            return 0.0
        if not self.largest_h:
            return least_double(least_f / more_h) if more_h > 0 else math.inf
        least_f += lower  # of the limit
        bound, size = arb(self.least_limit), arb(self.largest_h)
        # The quotient is least at the largest |h| for which least_f is the bound of |f|.
        if bound * size > least_f:
            size = least_f / bound
        least = least_double((least_f - lower) / (size + more_h))
        return max(least, 0.0)

    def _at(self, omega: float) -> float:
        """The quotient at a frequency, rounded up."""
        f, h = abs(self.f.at(omega)), abs(self.h.at(omega))
        return above((f / h).abs_upper()) if h > 0 else math.inf

    def _below(self, low: float, high: float) -> float:
        """A lower bound of the quotient on a band."""
        F, H = self.f.on(low, high), self.h.on(low, high)
        sizes = self.f.sizes(low, high)[0], self.h.sizes(low, high)[1]
        plain = F.abs_lower() / H.abs_upper(), sizes[0] / sizes[1]
        bound = max(self._bound_beyond(low) if low else 0.0, *map(least_double, plain))
        if not abs(H) > 0:
            return bound
        band, m = arb(low).union(arb(high)), (arb(low) + arb(high)) / 2
        slope = (self.f.derivative.at(band) - F / H * self.h.derivative.at(band)) / H * acb(0, 1)
        rate = 2 * ((F / H).conjugate() * slope).real
        square = abs(self.f.at(m) / self.h.at(m)) ** 2 + rate * arb(0, (arb(high) - arb(low)) / 2)
        return max(bound, least_double(square.abs_lower().sqrt()) if square > 0 else 0.0)
