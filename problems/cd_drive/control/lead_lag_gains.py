"""Gains and corner frequencies of a lead-lag controller, from its exact polynomials.

Two nearly equal zeros lose half of their digits when they are computed as eigenvalues: an error of
1e-16 moves them by 1e-8. Sums and products of the zeros are coefficients of the numerator, which
lose no digits. So the zeros are described by these, and the coefficients are computed in rational
arithmetic.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import fmpq, fmpq_mat, fmpq_poly

from workbench.errors import InputError
from workbench.types import RealArray, StateSpace

UNITS = {
    "proportional_gain": "V/unit",
    "zero_frequency": "Hz",
    "zero_damping": "1",
    "lead_pole": "Hz",
    "roll_off": "Hz",
}
"""Unit of each number that describes a lead-lag controller."""


@dataclass(frozen=True)
class LeadLagGains:
    """K(s) = c (s^2 + 2 d w s + w^2) / ((s + leak) (s + p_1) (s + p_2)) in terms that designers
    use.

    With the leak left out, K = (P + I / s + D s) / ((1 + s / p_1) (1 + s / p_2)).
    """

    proportional_gain: float
    """P = 2 d w c / (p_1 p_2) [V/unit]."""
    zero_frequency: float
    """Geometric mean of both zeros, w / (2 pi) [Hz]."""
    zero_damping: float
    """Mean of both zeros over their geometric mean, d: 1 for equal zeros, above 1 for real,
    different ones.
    """
    lead_pole: float
    """Pole of the lead, p_1 / (2 pi) [Hz]."""
    roll_off: float
    """Faster pole, p_2 / (2 pi) [Hz]."""

    @classmethod
    def of(cls, K: StateSpace) -> LeadLagGains:
        """The numbers of a controller [V/unit] with two zeros and three real poles.

        Raises InputError for a controller of any other form.
        """
        numerator, denominator = transfer_polynomials(K)
        shape = (numerator.degree(), denominator.degree())
        if shape != (2, 3):
            raise InputError(
                f"the controller has {shape[0]} zeros and {shape[1]} poles; a PI with lead and "
                "roll-off has 2 and 3"
            )
        product, total = (float(numerator[k] / numerator[2]) for k in (0, 1))
        if not (product > 0.0 and total > 0.0):
            raise InputError(
                f"the zeros have the product {product} (rad/s)^2 and the sum {-total} rad/s; both "
                "zeros must lie left of the imaginary axis"
            )
        _, lead, roll_off = _real_poles(denominator)
        frequency = product**0.5
        return cls(
            proportional_gain=float(numerator[1]) / (lead * roll_off),
            zero_frequency=frequency / (2 * np.pi),
            zero_damping=total / (2 * frequency),
            lead_pole=lead / (2 * np.pi),
            roll_off=roll_off / (2 * np.pi),
        )

    def zeros(self) -> str:
        """Both zeros [Hz] in words, a complex pair with its imaginary part."""
        mean = self.zero_frequency * self.zero_damping
        half = np.sqrt(abs(self.zero_damping**2 - 1)) * self.zero_frequency
        if self.zero_damping < 1:
            return f"{mean:.5g} +- {half:.3g}j"
        return f"{mean - half:.5g}, {mean + half:.5g}"


def transfer_polynomials(K: StateSpace) -> tuple[fmpq_poly, fmpq_poly]:
    """Numerator and denominator in s [rad/s], as exact as the doubles of the matrices are.

    The coefficients are as exact as the matrices' floating-point numbers. For one input and one
    output, det(sI - A + BC) = det(sI - A) (1 + C (sI - A)^-1 B). Common factors are not cancelled.
    """
    if (K.noutputs, K.ninputs) != (1, 1):
        raise InputError(
            f"the system has {K.noutputs} outputs and {K.ninputs} inputs; polynomials are made "
            "for one of each"
        )
    A, B, C = (_exact(matrix) for matrix in (K.A, K.B, K.C))
    denominator = A.charpoly()
    numerator = (A - B * C).charpoly() + (_rational(K.D[0, 0]) - 1) * denominator
    return numerator, denominator


def _rational(number: float) -> fmpq:
    """A finite double, exactly."""
    return fmpq(*float(number).as_integer_ratio())


def _exact(matrix: RealArray) -> fmpq_mat:
    rows, columns = matrix.shape
    return fmpq_mat(rows, columns, [_rational(entry) for entry in matrix.ravel()])


def _real_poles(denominator: fmpq_poly) -> list[float]:
    """Magnitudes of the poles, the smallest first [rad/s]."""
    found: Any = denominator.numer().complex_roots()
    roots = [complex(root) for root, times in found for _ in range(times)]
    if any(root.imag != 0.0 or root.real > 0.0 for root in roots):
        raise InputError(
            f"the controller has poles {roots} rad/s; they must be real and not right of the "
            "imaginary axis"
        )
    return sorted(-root.real for root in roots)
