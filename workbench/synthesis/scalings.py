"""D scalings of an iteration: stable, minimum-phase, and fitted by what they do to the loop.

A block's scaling is a gain times biquads with zeros and poles of any damping,

    d(s) = g * prod (s^2 / z^2 + 2 a s / z + 1) / (s^2 / p^2 + 2 b s / p + 1),

with every parameter positive, so that logarithms are free. D at a frequency is not unique and means
nothing where mu is small. So the parameters are not fitted to D at frequencies: they are those for
which the worst of sigma_max(D M D^-1) over a reference is least.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize

from workbench.structure import Structure

if TYPE_CHECKING:
    from control import StateSpace

Array = NDArray[Any]
Real = NDArray[np.float64]
DAMPING = (0.1, 20.0)
"""Least and largest damping of zeros and poles; above 1 they are pairs of real ones."""
BEYOND = 2.0
"""How far, in natural logarithms, corners may lie beyond the frequencies."""
LARGEST = 50.0
"""Of log gains: what is farther from 1 is so for lack of any effect."""
SHARPNESS = (6.0, 25.0, 100.0, 400.0)
"""Exponents of the mean that stands for the worst, each started from the one before."""
STEPS = 80
PLAIN = 1e-4
"""Weight of the logarithms of damping: what the loop does not need stays plain."""
STARTS = 7
"""Log frequencies about which corners start, when they are to follow a target."""
SPREAD = (0.6, 2.6)
"""Distances of the corners of a first guess, in natural logarithms."""


PARAMETERS = "log gain and, for each biquad, log z, log a, log p, log b"


@dataclass(frozen=True)
class Scalings:
    """Scalings of `blocks` scalar blocks by so many biquads each; parameters are (blocks, P).

    A row is log gain and, for each biquad, log z, log a, log p, log b.
    """

    blocks: int
    biquads: int

    @classmethod
    def of(cls, x: Real) -> Scalings:
        """Those that parameters (blocks, P) are of."""
        return cls(len(x), (x.shape[1] - 1) // 4)

    @property
    def size(self) -> int:
        """Parameters of a block."""
        return 1 + 4 * self.biquads

    def log_magnitude(self, x: Real, omega: Real) -> tuple[Real, Real]:
        """log|d| (blocks, F) at frequencies [rad/s], and its slopes (blocks, P, F)."""
        value = np.repeat(x[:, :1], len(omega), axis=1)
        slope = np.zeros((self.blocks, self.size, len(omega)))
        slope[:, 0] = 1.0
        for first, sign in self._corners():
            corner, damping = (np.exp(x[:, first + k, None]) for k in (0, 1))
            real, imaginary = corner**2 - omega**2, 2 * damping * corner * omega
            square = real**2 + imaginary**2
            value += sign * (np.log(square) / 2 - 2 * np.log(corner))
            slope[:, first] = sign * ((2 * real * corner**2 + imaginary**2) / square - 2)
            slope[:, first + 1] = sign * imaginary**2 / square
        return value, slope

    def systems(self, x: Real) -> list[StateSpace]:
        """d of each block."""
        return [reduce(lambda a, b: a * b, map(_biquad, *_split(row))) for row in x]

    def inverse(self, x: Real) -> Real:
        """The parameters of 1 / d: zeros are poles and poles zeros."""
        y = -x
        for zero in range(1, self.size, 4):
            y[:, zero : zero + 2], y[:, zero + 2 : zero + 4] = (
                x[:, zero + 2 : zero + 4],
                x[:, zero : zero + 2],
            )
        return y

    def guess(self, gains: Real, middle: float, spread: float) -> Real:
        """Parameters with these log gains, the corners spread about one log frequency."""
        x = np.zeros((self.blocks, self.size))
        x[:, 0] = gains
        places = spread * (np.arange(self.biquads) - (self.biquads - 1) / 2)
        for first, sign in self._corners():
            x[:, first] = middle + places[first // 4] + 0.3 * sign
        return x

    def fit(
        self, M: Array, structure: Structure, omega: Real, reference: Real, x: Real
    ) -> tuple[Real, float]:
        """The best parameters near x, and log of the worst sigma_max(D M D^-1) over the reference.

        M (F, c, r) at omega (F,) [rad/s], reference (F,).
        """
        low, high = np.log(omega[[0, -1]])
        bounds = [(-LARGEST, LARGEST)] * self.size
        for first, _ in self._corners():
            bounds[first] = (low - BEYOND, high + BEYOND)
            bounds[first + 1] = (np.log(DAMPING[0]), np.log(DAMPING[1]))
        damping = [first + 1 for first, _ in self._corners()]
        log_reference = np.log(reference)

        def cost(flat: Real, sharpness: float) -> tuple[float, Real]:
            y = flat.reshape(x.shape)
            value, slope = self.log_magnitude(y, omega)
            size, by_block = _scaled_size(M, structure, value)
            excess = size - log_reference
            weight = np.exp(sharpness * (excess - excess.max()))
            mean = excess.max() + np.log(weight.mean()) / sharpness
            gradient = np.einsum("f,bf,bpf->bp", weight / weight.sum(), by_block, slope)
            gradient[:, damping] += 2 * PLAIN * y[:, damping]
            return float(mean + PLAIN * np.sum(y[:, damping] ** 2)), gradient.ravel()

        flat = x.ravel()
        for sharpness in SHARPNESS:
            flat = minimize(
                cost,
                flat,
                args=(sharpness,),
                jac=True,
                method="L-BFGS-B",
                bounds=bounds * self.blocks,
                options={"maxiter": STEPS},
            ).x
        best = flat.reshape(x.shape)
        size, _ = _scaled_size(M, structure, self.log_magnitude(best, omega)[0])
        return best, float(np.max(size - log_reference))

    def follow(self, target: Real, omega: Real, weight: Real) -> Real:
        """Parameters for which log|d| is near a target (blocks, F), weighted (F,) least squares."""
        low, high = np.log(omega[[0, -1]])
        bounds = np.array(
            [[-LARGEST, LARGEST]] + [[low, high], np.log(DAMPING)] * (2 * self.biquads)
        )
        bounds = np.tile(bounds, (self.blocks, 1)).T
        shape = (self.blocks, self.size)

        def missed(flat: Real) -> Real:
            value, _ = self.log_magnitude(flat.reshape(shape), omega)
            return np.asarray((weight * (value - target)).ravel())

        def slopes(flat: Real) -> Real:
            _, slope = self.log_magnitude(flat.reshape(shape), omega)
            found = np.zeros((self.blocks, len(omega), self.blocks, self.size))
            for block in range(self.blocks):
                found[block, :, block] = weight[:, None] * slope[block].T
            return found.reshape(self.blocks * len(omega), -1)

        gains = np.average(target, axis=1, weights=weight)
        middles = np.linspace(low, high, STARTS + 2)[1:-1]
        starts = [self.guess(gains, middle, SPREAD[0]) for middle in middles]
        fits = [
            least_squares(
                missed, np.clip(x.ravel(), *bounds), slopes, bounds=bounds, max_nfev=STEPS
            )
            for x in starts
        ]
        best = min(fits, key=lambda fit: fit.cost)
        return np.asarray(best.x.reshape(shape))

    def _corners(self) -> list[tuple[int, int]]:
        """Places of the corners in a row, and 1 for zeros, -1 for poles."""
        return [
            (1 + 4 * k + at, sign) for k in range(self.biquads) for at, sign in ((0, 1), (2, -1))
        ]


def diagonals(structure: Structure, value: Real) -> tuple[Real, Real]:
    """Rows (F, c) and columns (F, r) of values (B, F) of the first B blocks; 0 of the others."""
    rows = np.zeros((value.shape[1], structure.columns))
    columns = np.zeros((value.shape[1], structure.rows))
    places = zip(value, structure.column_slices, structure.row_slices, strict=False)
    for one, row, column in places:
        rows[:, row], columns[:, column] = one[:, None], one[:, None]
    return rows, columns


def _scaled_size(M: Array, structure: Structure, value: Real) -> tuple[Real, Real]:
    """log sigma_max(D M D^-1) (F,) and its slopes (B, F) with log d."""
    rows, columns = diagonals(structure, value)
    scaled = np.exp(rows)[:, :, None] * M * np.exp(-columns)[:, None, :]
    left, size, right = np.linalg.svd(scaled, full_matrices=False)
    out, into = np.abs(left[:, :, 0]) ** 2, np.abs(right[:, 0, :]) ** 2
    places = zip(value, structure.column_slices, structure.row_slices, strict=False)
    slopes = [out[:, row].sum(axis=1) - into[:, column].sum(axis=1) for _, row, column in places]
    return np.log(size[:, 0]), np.reshape(slopes, value.shape)


def _split(row: Real) -> tuple[list[float], Real]:
    """Gains and corners of the factors of a row: the gain is in the first."""
    biquads = row[1:].reshape(-1, 4)
    none = np.full((1, 4), np.nan)
    factors = np.concatenate([none, biquads])
    return [row[0], *np.zeros(len(biquads))], factors


def _biquad(log_gain: float, corners: Real) -> StateSpace:
    """exp(log_gain) and the biquad of log corners; without one where they are NaN."""
    import control

    gain = np.exp(log_gain)
    if np.isnan(corners).any():
        return control.ss([], [], [], [[gain]])
    z, a, p, b = np.exp(corners)
    direct = gain * p**2 / z**2
    # (s^2 + 2 a z s + z^2) - (s^2 + 2 b p s + p^2) over the latter, in units of p
    constant, linear = direct * (z**2 - p**2) / p, direct * (2 * a * z - 2 * b * p)
    A = p * np.array([[0.0, 1.0], [-1.0, -2.0 * b]])
    return control.ss(A, [[0.0], [1.0]], [[constant, linear]], [[direct]])
