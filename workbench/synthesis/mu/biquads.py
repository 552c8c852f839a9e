"""Stable, minimum-phase functions of frequency: a gain times biquads.

    d(s) = g * prod (s^2 / z^2 + 2 a s / z + 1) / (s^2 / p^2 + 2 b s / p + 1),

The zeros and poles have any damping. Every parameter is positive, so its logarithm is free.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certify.proofs.scaled_system import ScalingFunctions
from workbench.systems.realisation import Matrices, realisation

FrequencyRange = tuple[float, float]
"""Lowest and highest frequency [rad/s]."""
DAMPING_RANGE = (0.1, 20.0)
"""Least and largest damping ratio of zeros and poles. A damping ratio above 1 is a pair of real
roots.
"""
LARGEST_LOG_GAIN = 50.0
"""Largest magnitude of log gains. A gain farther from 1 has no effect on the loop."""
CORNER_SPREADS = (0.6, 2.6)
"""Distances between the corners of initial guesses, in natural logarithms of frequency."""


@dataclass(frozen=True)
class Biquads:
    """Several functions, one per row, all with the same number of biquads.

    Their parameters x have shape (rows, P). A row contains log gain and, for each biquad, log z,
    log a, log p, log b.
    """

    rows: int
    biquads: int

    @property
    def size(self) -> int:
        """Number of parameters of a row."""
        return 1 + 4 * self.biquads

    @property
    def corners(self) -> list[tuple[int, int]]:
        """Index of each corner in a row of parameters, and 1 for a zero or -1 for a pole."""
        return [
            (1 + 4 * k + at, sign) for k in range(self.biquads) for at, sign in ((0, 1), (2, -1))
        ]

    def log_magnitude(self, x: RealArray, omega: RealArray) -> tuple[RealArray, RealArray]:
        """log|d| (rows, F) at frequencies (F,) [rad/s], and its derivatives (rows, P, F)."""
        value = np.repeat(x[:, :1], len(omega), axis=1)
        slope = np.zeros((len(x), self.size, len(omega)))
        slope[:, 0] = 1.0
        for first, sign in self.corners:
            corner, damping = (np.exp(x[:, first + k, None]) for k in (0, 1))
            real, imaginary = corner**2 - omega**2, 2 * damping * corner * omega
            square = real**2 + imaginary**2
            value += sign * (np.log(square) / 2 - 2 * np.log(corner))
            slope[:, first] = sign * ((2 * real * corner**2 + imaginary**2) / square - 2)
            slope[:, first + 1] = sign * imaginary**2 / square
        return value, slope

    def phase(self, x: RealArray, omega: RealArray) -> tuple[RealArray, RealArray]:
        """arg d (rows, F) [rad], continuous from 0 at frequency 0, and derivatives (rows, P, F)."""
        value = np.zeros((len(x), len(omega)))
        slope = np.zeros((len(x), self.size, len(omega)))
        for first, sign in self.corners:
            corner, damping = (np.exp(x[:, first + k, None]) for k in (0, 1))
            real, imaginary = corner**2 - omega**2, 2 * damping * corner * omega
            square = real**2 + imaginary**2
            value += sign * np.arctan2(imaginary, real)
            slope[:, first] = -sign * imaginary * (corner**2 + omega**2) / square
            slope[:, first + 1] = sign * imaginary * real / square
        return value, slope

    def systems(self, x: RealArray) -> list[StateSpace]:
        """The function d of each row as a StateSpace."""
        return [realisation(each, 0.0) for each in self.realised(x)]

    def realised(self, x: RealArray) -> list[Matrices]:
        """The matrices of the function of each row."""
        return [_series_realisation(row) for row in x]

    def functions(self, x: RealArray) -> ScalingFunctions:
        """The functions by the coefficients of their quadratic factors."""
        biquads = x[:, 1:].reshape(self.rows, self.biquads, 2, 2)
        corner, damping = np.exp(biquads[..., 0]), np.exp(biquads[..., 1])
        factors = np.stack([2.0 * damping * corner, corner**2], axis=-1)
        above, below = factors[:, :, 0], factors[:, :, 1]
        gain = np.exp(x[:, 0]) * (below[..., 1] / above[..., 1]).prod(axis=1)
        return ScalingFunctions(gain, above, below)

    def inverse(self, x: RealArray) -> RealArray:
        """The parameters of 1 / d, which exchanges zeros and poles of d."""
        y = -x
        for zero in range(1, self.size, 4):
            y[:, zero : zero + 2], y[:, zero + 2 : zero + 4] = (
                x[:, zero + 2 : zero + 4],
                x[:, zero : zero + 2],
            )
        return y

    def guess(self, gains: RealArray, middle: float, spread: float) -> RealArray:
        """Parameters with given log gains (rows,) and corners spread around a log frequency."""
        x = np.zeros((len(gains), self.size))
        x[:, 0] = gains
        places = spread * (np.arange(self.biquads) - (self.biquads - 1) / 2)
        for first, sign in self.corners:
            x[:, first] = middle + places[first // 4] + 0.3 * sign
        return x

    def bounds(self, within: FrequencyRange) -> list[tuple[float, float]]:
        """Bounds on the parameters of a row, with corners within frequencies [rad/s]."""
        low, high = np.log(within)
        found = [(-LARGEST_LOG_GAIN, LARGEST_LOG_GAIN)] * self.size
        for first, _ in self.corners:
            found[first] = (float(low), float(high))
            found[first + 1] = (float(np.log(DAMPING_RANGE[0])), float(np.log(DAMPING_RANGE[1])))
        return found


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
