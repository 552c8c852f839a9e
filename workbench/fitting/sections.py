"""Sections c0 + c1 s + c2 s^2, the factors of rational functions, and their logarithms.

The logarithm of a product of sections is the sum of theirs. Its real part is the log-magnitude,
and its imaginary part the phase. With the shares r_i = c_i s^i / p of the terms of a section p,

    d log p / d log c_i = r_i,    d^2 log p / d log c_i d log c_j = r_i [i = j] - r_i r_j.

The shares add up to 1, so those of c1 s and c2 s^2 tell the third. Their real parts are the
derivatives of the log-magnitude, and their imaginary parts those of the phase. They are computed
apart, since fits of magnitudes need no phase and their time goes here.

Functions choose their own parameters of the coefficients: `FactoredRational` the coefficients or
their logarithms, `Biquads` of mu synthesis the logarithms of corner frequencies and damping ratios.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray

Coefficients = RealArray | float
"""Coefficients of sections, or one that all of them share."""
Shares = tuple[RealArray, RealArray]
"""Real or imaginary parts of the shares of c1 s and c2 s^2."""


@dataclass(frozen=True, eq=False)
class PolynomialSections:
    """Sections at s = j omega: their ``even`` real parts and ``odd`` imaginary ones (..., F).

    ``constant`` is c0, and ``size`` the square of the magnitudes.
    """

    constant: Coefficients
    even: RealArray
    odd: RealArray
    size: RealArray

    @classmethod
    def at(
        cls, omega: RealArray, c0: Coefficients, c1: Coefficients, c2: Coefficients
    ) -> PolynomialSections:
        """PolynomialSections at omega, with coefficients; they broadcast to one shape (..., F)."""
        even, odd = c0 - c2 * omega**2, c1 * omega
        return cls(c0, even, odd, even**2 + odd**2)

    @property
    def values(self) -> ComplexArray:
        """Values p (..., F)."""
        found: ComplexArray = self.even + 1j * self.odd
        return found

    @property
    def log_magnitude(self) -> RealArray:
        """log|p| (..., F)."""
        found: RealArray = np.log(self.size) / 2
        return found

    @property
    def phase(self) -> RealArray:
        """arg p (..., F) [rad]; for positive coefficients it rises from 0 at frequency 0."""
        found: RealArray = np.arctan2(self.odd, self.even)
        return found

    @property
    def magnitude_shares(self) -> Shares:
        """Derivatives (..., F) of log|p| by log c1 and log c2."""
        return self.odd**2 / self.size, (self.even - self.constant) * self.even / self.size

    @property
    def phase_shares(self) -> Shares:
        """Derivatives (..., F) of arg p by log c1 and log c2."""
        return self.odd * self.even / self.size, (self.constant - self.even) * self.odd / self.size
