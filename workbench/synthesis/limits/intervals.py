"""Interval arithmetic on arrays of doubles, rounded outward.

IEEE 754 rounds sums, products, quotients and square roots to the nearest double. So the next double
below or above the result bounds the exact number. NaN (from 0 times infinity) stays NaN: every
comparison with it is false, so nothing is concluded from it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import RealArray

STEP = 2.0**-52
"""Largest distance to the next double, relative to the double. Products with it are exact."""
SMALLEST = 2.0**-1074
"""The smallest double: the distance to the next double where products with STEP underflow."""


def up(value: ArrayLike) -> RealArray:
    """Round upward: doubles at or above the next double after each value."""
    value = np.asarray(value, dtype=float)
    return value + (np.abs(value) * STEP + SMALLEST)


def down(value: ArrayLike) -> RealArray:
    """Round downward: doubles at or below the next double before each value."""
    value = np.asarray(value, dtype=float)
    return value - (np.abs(value) * STEP + SMALLEST)


@dataclass(frozen=True, eq=False)
class Interval:
    """Intervals of real numbers from ``low`` to ``high``, two arrays of the same shape."""

    low: RealArray
    high: RealArray

    __array_ufunc__ = None  # makes NumPy arrays use the interval's operators

    @classmethod
    def of(cls, value: Interval | ArrayLike) -> Interval:
        """Doubles as intervals of length zero."""
        if isinstance(value, Interval):
            return value
        exact = np.asarray(value, dtype=float)
        return cls(exact, exact)

    @property
    def columns(self) -> Interval:
        """The intervals (F,) as a column (F, 1)."""
        return Interval(self.low[:, None], self.high[:, None])

    def __add__(self, other: Interval | ArrayLike) -> Interval:
        other = Interval.of(other)
        return Interval(down(self.low + other.low), up(self.high + other.high))

    def __neg__(self) -> Interval:
        return Interval(-self.high, -self.low)

    def __sub__(self, other: Interval | ArrayLike) -> Interval:
        other = Interval.of(other)
        return Interval(down(self.low - other.high), up(self.high - other.low))

    def __rsub__(self, other: ArrayLike) -> Interval:
        return Interval.of(other) - self

    def __mul__(self, other: Interval | ArrayLike) -> Interval:
        other = Interval.of(other)
        return _hull(
            self.low * other.low,
            self.low * other.high,
            self.high * other.low,
            self.high * other.high,
        )

    def __truediv__(self, other: Interval | ArrayLike) -> Interval:
        """Quotients; every real number where the divisor may be zero."""
        other = Interval.of(other)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            found = _hull(
                self.low / other.low,
                self.low / other.high,
                self.high / other.low,
                self.high / other.high,
            )
        zero = (other.low <= 0.0) & (other.high >= 0.0)
        return Interval(np.where(zero, -np.inf, found.low), np.where(zero, np.inf, found.high))

    __radd__, __rmul__ = __add__, __mul__

    def __rtruediv__(self, other: ArrayLike) -> Interval:
        return Interval.of(other) / self

    def squared(self) -> Interval:
        """Squares, which are not negative."""
        size = self.size()
        return Interval(np.maximum(down(size.low**2), 0.0), up(size.high**2))

    def size(self) -> Interval:
        """Absolute values."""
        across = (self.low <= 0.0) & (self.high >= 0.0)
        ends = np.abs(self.low), np.abs(self.high)
        return Interval(np.where(across, 0.0, np.minimum(*ends)), np.maximum(*ends))

    def root(self) -> Interval:
        """Square roots; negative numbers count as zero."""
        low, high = (np.sqrt(np.maximum(end, 0.0)) for end in (self.low, self.high))
        return Interval(np.maximum(down(low), 0.0), up(high))


@dataclass(frozen=True, eq=False)
class ComplexInterval:
    """Complex numbers with ``real`` and ``imag`` parts in intervals."""

    real: Interval
    imag: Interval

    def __add__(self, other: ComplexInterval) -> ComplexInterval:
        return ComplexInterval(self.real + other.real, self.imag + other.imag)

    def __mul__(self, other: ComplexInterval) -> ComplexInterval:
        return ComplexInterval(
            self.real * other.real - self.imag * other.imag,
            self.real * other.imag + self.imag * other.real,
        )

    def __truediv__(self, other: ComplexInterval) -> ComplexInterval:
        square = other.real.squared() + other.imag.squared()
        upper = self * ComplexInterval(other.real, -other.imag)
        return ComplexInterval(upper.real / square, upper.imag / square)

    def scaled(self, factor: Interval | ArrayLike) -> ComplexInterval:
        """Products with a real interval."""
        return ComplexInterval(self.real * factor, self.imag * factor)

    def size(self) -> Interval:
        """Absolute values."""
        return (self.real.squared() + self.imag.squared()).root()


def _hull(*products: RealArray) -> Interval:
    low = np.minimum(np.minimum(products[0], products[1]), np.minimum(products[2], products[3]))
    high = np.maximum(np.maximum(products[0], products[1]), np.maximum(products[2], products[3]))
    return Interval(down(low), up(high))
