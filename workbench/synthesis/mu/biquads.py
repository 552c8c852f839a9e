"""Stable, minimum-phase functions of frequency: a gain times biquads.

    d(s) = g * prod (s^2 / z^2 + 2 a s / z + 1) / (s^2 / p^2 + 2 b s / p + 1).

The zeros and poles have any damping. Every parameter is positive, so its logarithm is free. A
`FactoredRational` has coefficients as parameters and is one function. Here corners and dampings are
the parameters, since each of them has limits, and several functions are computed at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench._core.arrays import RealArray
from workbench.certify.proofs.scaled_system import ScalingFunctions
from workbench.fitting.sections import PolynomialSections, Shares
from workbench.systems.realisation import Matrices

FrequencyRange = tuple[float, float]
"""Lowest and highest frequency [rad/s]."""
DAMPING_RANGE = (0.1, 20.0)
"""Least and largest damping ratio of zeros and poles. A damping ratio above 1 is a pair of real
roots.
"""
LARGEST_LOG_GAIN = 50.0
"""Largest magnitude of log gains. A gain farther from 1 has no effect on the loop."""
CORNER_REACH = float(np.exp(2.0))
"""Factor by which corners of scalings may lie outside the frequencies of a loop."""
PARAMETERS = "log gain and, for each biquad, log z, log a, log p, log b"
"""Names of the parameters of a function, for labels of datasets."""


@dataclass(frozen=True)
class Biquads:
    """Several functions, one per row, all with the same number of biquads.

    Their parameters x have shape (rows, P). A row contains log gain and, for each biquad, log z,
    log a, log p, log b.
    """

    rows: int
    biquads: int

    @classmethod
    def of(cls, x: RealArray) -> Biquads:
        """The functions that have the parameters x (rows, P)."""
        return cls(len(x), (x.shape[1] - 1) // 4)

    @property
    def size(self) -> int:
        """Number of parameters of a row."""
        return 1 + 4 * self.biquads

    @cached_property
    def signs(self) -> RealArray:
        """1 for zeros and -1 for poles, in their order (corners, 1)."""
        return np.tile([[1.0], [-1.0]], (self.biquads, 1))

    # --- values and derivatives -----------------------------------------------------------------

    def sections(self, x: RealArray, omega: RealArray) -> PolynomialSections:
        """The quadratic factors (rows, corners, F) at frequencies (F,) [rad/s]."""
        ratio = omega * np.exp(-x[:, 1::2, None])
        return PolynomialSections.at(ratio, 1.0, 2 * np.exp(x[:, 2::2, None]), 1.0)

    def log_magnitude(self, x: RealArray, omega: RealArray) -> tuple[RealArray, RealArray]:
        """log|d| (rows, F) at frequencies (F,) [rad/s], and its derivatives (rows, P, F)."""
        found = self.sections(x, omega)
        value = x[:, :1] + (self.signs * found.log_magnitude).sum(axis=1)
        return value, self._slopes(1.0, found.magnitude_shares)

    def phase(self, x: RealArray, omega: RealArray) -> tuple[RealArray, RealArray]:
        """arg d (rows, F) [rad], continuous from 0 at frequency 0, and derivatives (rows, P, F)."""
        found = self.sections(x, omega)
        value = (self.signs * found.phase).sum(axis=1)
        return value, self._slopes(0.0, found.phase_shares)

    def _slopes(self, by_gain: float, shares: Shares) -> RealArray:
        """Derivatives (rows, P, F) from those by the coefficients of all sections."""
        first, second = shares
        slope = np.empty((len(first), self.size, first.shape[-1]))
        slope[:, 0] = by_gain
        slope[:, 1::2] = -self.signs * (first + 2 * second)
        slope[:, 2::2] = self.signs * first
        return slope

    def bending(self, x: RealArray, omega: RealArray, weight: RealArray) -> RealArray:
        """Second derivatives (rows, P, P) of the sum of log|d| times a weight (rows, F)."""
        found = self.sections(x, omega)
        first, second = found.magnitude_shares
        both, weight = first + 2 * second, weight[:, None] * self.signs
        turn, turn_2 = found.phase_shares
        turned = turn + 2 * turn_2
        bent = np.zeros((self.rows, self.size, self.size))
        corner, damping = np.arange(1, self.size, 2), np.arange(2, self.size, 2)
        by_corners = both + 2 * second - both**2 + turned**2
        by_both = first * both - turn * turned - first
        by_dampings = first - first**2 + turn**2
        bent[:, corner, corner] = (weight * by_corners).sum(axis=2)
        bent[:, corner, damping] = bent[:, damping, corner] = (weight * by_both).sum(axis=2)
        bent[:, damping, damping] = (weight * by_dampings).sum(axis=2)
        return bent

    # --- systems --------------------------------------------------------------------------------

    def realised(self, x: RealArray) -> list[Matrices]:
        """The matrices of the function of each row."""
        return [_series_realisation(row) for row in x]

    def functions(self, x: RealArray) -> ScalingFunctions:
        """The functions by the coefficients of their quadratic factors."""
        biquads = x[:, 1:].reshape(len(x), self.biquads, 2, 2)
        corner, damping = np.exp(biquads[..., 0]), np.exp(biquads[..., 1])
        factors = np.stack([2.0 * damping * corner, corner**2], axis=-1)
        above, below = factors[:, :, 0], factors[:, :, 1]
        gain = np.exp(x[:, 0]) * (below[..., 1] / above[..., 1]).prod(axis=1)
        return ScalingFunctions(gain, above, below)

    # --- parameters -----------------------------------------------------------------------------

    def inverse(self, x: RealArray) -> RealArray:
        """The parameters of 1 / d, which exchanges zeros and poles of d."""
        biquads = x[:, 1:].reshape(len(x), self.biquads, 2, 2)
        return np.hstack([-x[:, :1], biquads[:, :, ::-1].reshape(len(x), 4 * self.biquads)])

    def guess(self, gains: RealArray, middle: float, spread: float) -> RealArray:
        """Parameters with given log gains (rows,) and corners spread around a log frequency."""
        x = np.zeros((self.rows, self.size))
        places = spread * (np.arange(self.biquads) - (self.biquads - 1) / 2)
        x[:, 0], x[:, 1::2] = gains, middle + np.repeat(places, 2) + 0.3 * self.signs[:, 0]
        return x

    def grown(self, x: RealArray, omega: float, split: RealArray) -> tuple[Biquads, RealArray]:
        """The functions and parameters with one more biquad at omega [rad/s].

        Its zeros lie above omega by `split` (rows,), in natural logarithms, and its poles below.
        """
        more = np.zeros((self.rows, 4))
        more[:, 0], more[:, 2] = np.log(omega) + split, np.log(omega) - split
        return Biquads(self.rows, self.biquads + 1), np.hstack([x, more])

    def without(self, x: RealArray, biquad: int) -> tuple[Biquads, RealArray]:
        """The functions and parameters without one of the biquads."""
        first = 1 + 4 * biquad
        return Biquads(self.rows, self.biquads - 1), np.delete(x, range(first, first + 4), 1)

    def bounds(self, within: FrequencyRange) -> RealArray:
        """Least and largest parameters of a row (P, 2), with corners within frequencies [rad/s]."""
        found = np.tile([-LARGEST_LOG_GAIN, LARGEST_LOG_GAIN], (self.size, 1))
        found[1::2], found[2::2] = np.log(within), np.log(DAMPING_RANGE)
        return found

    def limits(self, omega: RealArray, reach: float = CORNER_REACH) -> RealArray:
        """Least and largest flat parameters (2, rows * P) for frequencies [rad/s] of a loop."""
        row = self.bounds((omega[0] / reach, omega[-1] * reach))
        return np.tile(row.T, self.rows)

    @property
    def dampings(self) -> RealArray:
        """1 for the flat parameters that are logarithms of damping ratios, 0 for the others."""
        found = np.zeros((self.rows, self.size))
        found[:, 2::2] = 1.0
        return found.ravel()


def _series_realisation(row: RealArray) -> Matrices:
    """The matrices of the function of a row of parameters: its biquads in series.

    The output of each biquad enters all later biquads.
    """
    z, a, p, b = np.exp(row[1:].reshape(-1, 4).T)
    gain, n = float(np.exp(row[0])), 2 * len(z)
    # (s^2 + 2 a z s + z^2) - (s^2 + 2 b p s + p^2), in units of p.
    C = np.stack([(z**2 - p**2) / p, 2.0 * (a * z - b * p)], axis=1).reshape(1, n)
    A, B = np.zeros((n, n)), np.zeros((n, 1))
    for k in range(len(z)):
        first, second = 2 * k, 2 * k + 1
        A[second, :first] = C[0, :first]
        A[first, second], A[second, first], A[second, second] = p[k], -p[k], -2.0 * b[k] * p[k]
        B[second] = 1.0
    gain *= float((p**2 / z**2).prod())
    return A, B, gain * C, np.array([[gain]])
