"""Bounds on rational functions over cells of frequency, rounded outward.

From the value at the middle of a cell and the derivative of the logarithm over it,

    |R(m)| (1 - y) <= |R| <= |R(m)| / (1 - y),    y = r max |d log R / d omega|,

where r is the cell's radius. The product of the bounds on each factor is used where it is narrower.
So the bounds of a narrow cell follow the function's slope, and a wide cell, or one with a root on
the axis, still has a bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import RealArray
from workbench.fitting.rational import Rational
from workbench.synthesis.limits.intervals import ComplexInterval, Interval, down, up


@dataclass(frozen=True, eq=False)
class FrequencyCells:
    """Intervals of frequency [rad/s] from ``low`` to ``high`` (F,), finite and not negative."""

    low: RealArray
    high: RealArray

    @property
    def all(self) -> Interval:
        """Each cell as an interval."""
        return Interval(self.low, self.high)

    @property
    def middle(self) -> RealArray:
        """The middle of each cell on a linear scale, up to rounding."""
        return np.clip(self.low + (self.high - self.low) / 2, self.low, self.high)

    @property
    def radius(self) -> RealArray:
        """Largest distance of a frequency in the cell from its middle."""
        middle = self.middle
        farthest = up(np.maximum(self.high - middle, middle - self.low))
        return np.where(self.high == self.low, 0.0, farthest)

    @property
    def width(self) -> Interval:
        """Lengths of the cells."""
        return Interval.of(self.high) - self.low

    @property
    def halved(self) -> FrequencyCells:
        """The lower halves of all cells, followed by the upper halves."""
        middle = self.middle
        return FrequencyCells(np.append(self.low, middle), np.append(middle, self.high))

    def at(self, k: NDArray) -> FrequencyCells:
        """Some of the cells, by index or mask."""
        return FrequencyCells(self.low[k], self.high[k])

    def joined(self, others: FrequencyCells) -> FrequencyCells:
        """These cells, followed by others."""
        return FrequencyCells(np.append(self.low, others.low), np.append(self.high, others.high))


def least_magnitude(function: Rational, cells: FrequencyCells) -> RealArray:
    """A lower bound (F,) on |R(j omega)| over each cell."""
    slow = _magnitude(function, Interval.of(cells.middle)).low * _lower_factor(function, cells)
    return np.fmax(np.fmax(down(slow), _magnitude(function, cells.all).low), 0.0)


def largest_magnitude(function: Rational, cells: FrequencyCells) -> RealArray:
    """An upper bound (F,) on |R(j omega)| over each cell."""
    middle, left = (
        _magnitude(function, Interval.of(cells.middle)).high,
        _lower_factor(function, cells),
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        slow = np.where(left > 0.0, up(middle / left), np.inf)
    return np.fmin(slow, _magnitude(function, cells.all).high)


def direction(function: Rational, cells: FrequencyCells) -> tuple[ComplexInterval, RealArray]:
    """R / |R| at the middle of each cell, and its largest change of angle [rad] over the cell."""
    s = Interval.of(cells.middle)
    sign = Interval.of(np.full(s.low.shape, np.sign(function.gain)))
    found = ComplexInterval(sign, Interval.of(np.zeros(s.low.shape)))
    for k, pole in enumerate(function.poles):
        if k < function.zeros.size:
            found = _unit(found * root_factor(function.zeros[k], s))
        found = _unit(found / root_factor(pole, s))
    turned = up(_log_slope(function, cells).imag.size().high * cells.radius)
    return found, np.where(np.isnan(turned), np.inf, turned)


def asymptote(function: Rational, lowest: float) -> Interval:
    """Bounds on |R(j omega)| omega^k above the frequency `lowest` [rad/s].

    k is the number of poles less the number of zeros; `lowest` is positive.
    """
    inverse = Interval(np.zeros(()), up(1.0 / lowest))
    found = Interval.of(abs(function.gain))
    for k, pole in enumerate(function.poles):
        if k < function.zeros.size:
            found = found * relative_factor(function.zeros[k], inverse)
        found = found / relative_factor(pole, inverse)
    return found


def relative_factor(root: complex, inverse: Interval) -> Interval:
    """|j omega - root| / omega as a function of 1 / omega."""
    return ((inverse * root.real).squared() + (1.0 - inverse * root.imag).squared()).root()


def root_factor(root: complex, omega: Interval) -> ComplexInterval:
    """The factor j omega - root."""
    return ComplexInterval(Interval.of(np.full(omega.low.shape, -root.real)), omega - root.imag)


def _unit(found: ComplexInterval) -> ComplexInterval:
    size = found.size()
    return ComplexInterval(found.real / size, found.imag / size)


def _magnitude(function: Rational, omega: Interval) -> Interval:
    found = Interval.of(np.full(omega.low.shape, abs(function.gain)))
    for k, pole in enumerate(function.poles):  # interleaved, so that no product overflows
        if k < function.zeros.size:
            found = found * root_factor(function.zeros[k], omega).size()
        size = root_factor(pole, omega).size()  # its lower bound may be 0
        found = Interval(np.fmax(down(found.low / size.high), 0.0), up(found.high / size.low))
    return found


def _lower_factor(function: Rational, cells: FrequencyCells) -> RealArray:
    """The factor 1 - y, not negative; 0 where the cell may contain a root on the axis."""
    slope = _log_slope(function, cells).real.size().high
    return np.fmax(down(1.0 - up(slope * cells.radius)), 0.0)


def _log_slope(function: Rational, cells: FrequencyCells) -> ComplexInterval:
    """d log R(j omega) / d omega over each cell: the sum of 1 / (omega + j root) with its signs."""
    none = Interval.of(np.zeros(cells.low.shape))
    found = ComplexInterval(none, none)
    for sign, roots in ((1.0, function.zeros), (-1.0, function.poles)):
        for root in roots:
            away = cells.all - root.imag
            square = away.squared() + Interval.of(root.real).squared()
            found += ComplexInterval(away / square * sign, -root.real / square * sign)
    return found
