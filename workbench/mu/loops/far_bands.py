"""Bands of high frequency in which a quotient of quasi-polynomials may be negative, in doubles.

Where the power n dominates, N(s) / s^n and D(s) / s^n are sums of exponentials whose factors are
polynomials of 1 / omega. Bands are halved all at once; one is left out where N + x D, for every x
of an interval, is farther from 0 at its middle than it can move.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from flint import acb, arb, ctx

from workbench._core.arrays import EPS, BoolArray, ComplexArray, RealArray
from workbench.mu.loops.crossings import PRECISION
from workbench.mu.loops.phases import ROUNDING, distance_to_segment
from workbench.mu.loops.quasi_polynomials import QuasiPolynomial

MOST_BANDS = 50_000
"""Largest number of first bands; a search that needs more is not made, and takes seconds. With half
of it a margin that is only approached may be a little lower; double costs time.
"""
CHUNK = 20_000
"""Number of first bands that are evaluated at once. This many numbers fit into the caches. Half or
double changes time and memory only.
"""
TURN = 0.5
"""Turn [rad] of the longest dead time on a first band. Wider bands are nearly all in question. With
half of it the search ends at half the frequency; with double, more bands are halved.
"""
HALVINGS = 12
"""A band that is still in question after so many bisections is kept. It is then 4096 times as
narrow, and exact arithmetic isolates a root in it at once. Half or double changes the time only.
"""


class FarBands:
    """N and D over s^n at frequencies from ``start`` [rad/s] on."""

    def __init__(self, N: QuasiPolynomial, D: QuasiPolynomial, order: int, start: float) -> None:
        self.start = start
        self.N, self.D = (_FarSum(one, order, start) for one in (N, D))
        self.step = TURN / max(float(max(one.delays, default=0.0)) for one in (self.N, self.D))

    def suffice(self, end: float) -> bool:
        """Whether the bands up to a frequency are few enough."""
        return (end - self.start) / self.step <= MOST_BANDS

    def in_question(self, level: float, end: float) -> list[tuple[float, float]]:
        """Bands up to a frequency that may hold a negative N / D of a size above a level."""
        found: list[tuple[float, float]] = []
        count = max(math.ceil((end - self.start) / self.step), 1)
        edges = np.linspace(self.start, max(end, self.start), count + 1)
        for first in range(0, count, CHUNK):
            low, high = edges[first : first + CHUNK + 1][:-1], edges[first : first + CHUNK + 1][1:]
            for _ in range(HALVINGS):
                kept = self._may_cross(level, low, high)
                low, high = low[kept], high[kept]
                middle = (low + high) / 2
                low = np.stack([low, middle], axis=1).ravel()
                high = np.stack([middle, high], axis=1).ravel()
            found += zip(low.tolist(), high.tolist(), strict=True)
        return _merged(found)

    def _may_cross(self, level: float, low: RealArray, high: RealArray) -> BoolArray:
        middle = (low + high) / 2
        N, D = self.N.at(middle), self.D.at(middle)
        moved = (self.N.rate(low) + self.D.rate(low)) * (high - low) / 2
        moved = moved + self.N.rounding(high) + self.D.rounding(high)
        near = np.minimum(distance_to_segment(N + level * D, N + D), distance_to_segment(N + D, D))
        found: BoolArray = near <= moved
        return found


class _FarSum:
    """One quasi-polynomial over s^n: polynomials of start / omega times exponentials."""

    def __init__(self, f: QuasiPolynomial, order: int, start: float) -> None:
        self.start = start
        self.delays = np.array([float(T) for T in f.terms])
        with ctx.workprec(PRECISION):
            turned = acb(0, -1)
            self.factors = [
                np.array(
                    [
                        complex(acb(p[order - k]) * turned**k / arb(start) ** k)
                        for k in range(order + 1)
                    ]
                )
                for p in f.terms.values()
            ]

    def at(self, omega: RealArray) -> ComplexArray:
        total = np.zeros(omega.shape, dtype=complex)
        for T, factors in zip(self.delays, self.factors, strict=True):
            total += np.polyval(factors[::-1], self.start / omega) * np.exp(-1j * omega * T)
        return total

    def rate(self, low: RealArray) -> RealArray:
        """A bound of the derivative over frequency from ``low`` [rad/s] on."""
        v, total = self.start / low, np.zeros(low.shape)
        for T, factors in zip(self.delays, self.factors, strict=True):
            sizes = np.abs(factors)
            slopes = sizes[1:] * np.arange(1, len(sizes))
            total += (
                T * np.polyval(sizes[::-1], v) + np.polyval(slopes[::-1], v) * v**2 / self.start
            )
        return total

    def rounding(self, omega: RealArray) -> RealArray:
        size = sum(float(np.abs(one).sum()) for one in self.factors)
        found: RealArray = (ROUNDING + 4.0 * EPS * omega * self.delays.max(initial=0.0)) * size
        return found


def _merged(bands: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Bands with neighbours that touch put together."""
    bands = sorted(bands)
    cuts = [0, *(k + 1 for k, (a, b) in enumerate(pairwise(bands)) if a[1] < b[0]), len(bands)]
    return [(bands[i][0], bands[j - 1][1]) for i, j in pairwise(cuts) if j > i]
