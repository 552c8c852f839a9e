"""Uncertain delays: analysis uses a disk that covers them, samples use the delays themselves."""

from __future__ import annotations

import math
import numbers
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import polynomial

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import is_real
from workbench.structure import Block, Complex
from workbench.systems.conversion import as_system
from workbench.uncertainty.algebra.elements import Element

PADE_ORDER = 8
"""Order of the Pade approximation of delays in samples. Its phase error is below 0.01 rad up to
omega tau = 7.
"""
NO_DELAY = 1e-9
"""A delay below this share of the largest delay counts as zero."""
SHORTEST_DELAY, LONGEST_DELAY = 1e-100, 1e100
"""Smallest and largest upper limit of a delay [s] for which there is a cover. Coefficients for
others overflow or underflow.
"""
COVER_ZEROS = (1 / 2.363, 2 * 0.838)
"""Time constant relative to the delay, and twice the damping, of the cover's numerator."""
COVER_POLES = (1 / 2.363, 2 * 0.685)
"""Time constant relative to the delay, and twice the damping, of the cover's denominator."""


@dataclass(frozen=True)
class DelayElement(Element):
    """The delay exp(-s tau), tau from low to high [s], represented as 1 + W delta.

    |W| is at least |exp(-j omega tau) - 1| for all tau up to high, and at most 2.1 % above the
    largest of these (Z.-Q. Wang, P. Lundstrom, S. Skogestad, Representation of uncertain time
    delays in the H-infinity framework, Int. J. Control 59 (1994) 627-638). Delta may have any
    phase, so the set is larger than the set of delays.
    """

    low: float
    high: float

    @property
    def channels(self) -> tuple[str, ...]:
        return (self.name,)

    def block(self, occurrences: int) -> Block:
        return Complex(occurrences, name=self.name)

    @property
    def cover(self) -> StateSpace:
        """The weight W."""
        import control

        above, below = _polynomials()
        scale = self.high ** np.arange(4)
        return control.ss(control.tf((above * scale)[::-1], (below * scale)[::-1]))

    def shortened(self, high: float) -> StateSpace:
        """Factor on delta with which the set contains only delays up to a smaller `high`."""
        import control

        above, below = _polynomials()
        one, other = (t ** np.arange(3) * above[1:] for t in (high, self.high))
        into, out = (t ** np.arange(4) * below for t in (self.high, high))
        num, den = polynomial.polymul(one, into), polynomial.polymul(other, out)
        return control.ss(control.tf(high / self.high * num[::-1], den[::-1]))

    def delta(self, value: Any) -> Any:
        """The rational approximation of (exp(-s tau) - 1) / W for a delay tau; a system is returned
        unchanged.
        """
        import control

        if not isinstance(value, numbers.Number):
            return as_system(value, self.name)
        if not is_real(value) or not 0.0 <= float(value) < math.inf:  # type: ignore[arg-type]
            raise InputError(f"{self.name} = {value!r}; a delay of 0 or more [s] is needed")
        tau = float(value)  # type: ignore[arg-type]
        if tau <= NO_DELAY * self.high:
            return 0.0
        # With time relative to tau: (num - den) / s / den of the delay, times s / W.
        den = _pade()
        k = np.arange(len(den))
        odd = np.where(k % 2 == 1, -2.0 * den, 0.0)[1:]
        above, below = (part * (self.high / tau) ** np.arange(4) for part in _polynomials())
        num: RealArray = np.asarray(polynomial.polymul(odd, below))
        whole: RealArray = np.asarray(polynomial.polymul(den, above[1:]))
        scaled = control.ss(control.tf(np.trim_zeros(num[::-1], "f"), whole[::-1]))
        return control.ss(scaled.A / tau, scaled.B / tau, scaled.C, scaled.D)

    def value(self, delta: Any) -> Any:
        return delta

    def sample(self, rng: np.random.Generator, speed: float) -> float:
        return float(rng.uniform(self.low, self.high))


def _polynomials() -> tuple[RealArray, RealArray]:
    """Numerator and denominator of W as polynomials in s times the largest delay, lowest power
    first.
    """
    (a, b), (c, d) = COVER_ZEROS, COVER_POLES
    above = polynomial.polymul([0.0, 1.0], [1.0, b * a, a * a])
    below = polynomial.polymul([1.0, 0.5], [1.0, d * c, c * c])
    return np.asarray(above), np.asarray(below)


def _pade() -> RealArray:
    """Denominator of the diagonal Pade approximation of exp(-s), lowest power first."""
    n = PADE_ORDER
    powers = range(n + 1)
    return np.array(
        [math.comb(n, k) * math.factorial(2 * n - k) / math.factorial(2 * n) for k in powers]
    )
