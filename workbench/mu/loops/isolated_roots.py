"""Roots of a real function of frequency, isolated by bounds of its value and slope on bands.

A band is skipped where the function is proven not to be 0, and has at most one root where the slope
is proven not to be 0. If neither can be proven on the narrowest bands that the precision allows,
the function touches 0 or nearly does.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from flint import arb

NARROW = 2.0**-32
"""Relative width of a band that is not halved any more. Two roots so close to each other are
reported as one, since a curve that touches its line in exact arithmetic has such roots in doubles.
Doubles show a double root to half of their bits, 2^-26. Half or double: an interval is halved once
more or less.
"""
TOUCHED = 2.0**-50
"""The function touches 0 if its value, divided by the sum of the sizes of its terms, is below this.
It is eight roundings of a double: the terms are those of a loop given in doubles. With half of it a
curve that touches is missed more often; with double of it one that stays 2e-15 apart touches.
"""
HALVINGS = 90
"""Number of bisections of a band with one root. They leave 2^-90 of the band. With half of them
roots may have fewer digits than a double; more change nothing.
"""


class RealFunction(ABC):
    """A real function of frequency [rad/s], evaluated in balls."""

    @abstractmethod
    def at(self, omega: Any) -> arb:
        """The value at a frequency."""

    @abstractmethod
    def size(self, omega: float) -> arb:
        """The sum of the sizes of the terms at a frequency."""

    @abstractmethod
    def excluded(self, low: float, high: float) -> bool:
        """Whether the band has no root, or its roots are not wanted."""

    @abstractmethod
    def slope(self, low: float, high: float) -> arb:
        """A ball that contains the derivative on a band."""

    def roots(self, low: float, high: float) -> list[arb]:
        """Roots in (low, high], from low to high."""
        found: list[arb] = []
        touching: list[tuple[float, float]] = []
        bands = [(low, high)]
        while bands:
            low, high = bands.pop()
            middle = (low + high) / 2
            if self.excluded(low, high):
                continue
            slope = self.slope(low, high)
            if slope > 0 or slope < 0:
                found += self._single(low, high)
            elif high - low > NARROW * high and low < middle < high:
                bands += [(middle, high), (low, middle)]
            elif touching and low <= touching[-1][1]:
                touching[-1] = (touching[-1][0], high)
            else:
                touching.append((low, high))
        found += [arb((low + high) / 2) for low, high in touching if self._touches(low, high)]
        return sorted(found, key=float)

    def _touches(self, low: float, high: float) -> bool:
        middle = (low + high) / 2
        near = abs(self.at(middle)) <= TOUCHED * self.size(middle)
        return bool(near) or _sign(self.at(low)) * _sign(self.at(high)) < 0

    def _single(self, low: float, high: float) -> list[arb]:
        """The root of a monotone function in (low, high], if there is one."""
        first, last = _sign(self.at(low)), _sign(self.at(high))
        if last == 0:
            return [arb(high)]
        if first * last >= 0:
            return []
        a, b = arb(low), arb(high)
        for _ in range(HALVINGS):
            middle = ((a + b) / 2).mid()
            a, b = (middle, b) if _sign(self.at(middle)) == first else (a, middle)
        return [((a + b) / 2).mid()]


def _sign(ball: arb) -> int:
    return int(ball > 0) - int(ball < 0)
