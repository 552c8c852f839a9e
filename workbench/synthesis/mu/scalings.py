"""D scalings of an iteration: stable, minimum-phase, and fitted by what they do to the loop.

A block's scaling is a gain times biquads, see `Biquads`. D at a frequency is not unique and means
nothing where mu is small. So the parameters are not fitted to D at frequencies: they are those for
which the worst of sigma_max(D M D^-1) over a reference is least.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from workbench.arrays import RealArray
from workbench.structure import Structure
from workbench.synthesis.mu.biquads import DAMPING, LARGEST, Biquads

BEYOND = 2.0
"""How far, in natural logarithms, corners may lie beyond the frequencies."""
STEPS = 80
STARTS = 7
"""Log frequencies about which corners start, when they are to follow a target."""
SPREAD = 0.6
"""Distance of the corners of a first guess, in natural logarithms."""


PARAMETERS = "log gain and, for each biquad, log z, log a, log p, log b"


class Scalings(Biquads):
    """Scalings of as many scalar blocks as there are rows; parameters are (blocks, P)."""

    @classmethod
    def of(cls, x: RealArray) -> Scalings:
        """Those that parameters (blocks, P) are of."""
        return cls(len(x), (x.shape[1] - 1) // 4)

    def log_magnitude(self, x: RealArray, omega: RealArray) -> tuple[RealArray, RealArray]:
        """As of `Biquads`, all biquads at once, as `bending` has it."""
        r, damped, square, signs = self._relative(x, omega)
        value = x[:, :1] + (signs * np.log(square)).sum(axis=1) / 2
        slope = np.ones((self.rows, self.size, len(omega)))
        slope[:, 1::2] = signs * ((2 * (1 - r) + damped) / square - 2)
        slope[:, 2::2] = signs * damped / square
        return value, slope

    def bending(self, x: RealArray, omega: RealArray, weight: RealArray) -> RealArray:
        """Second derivatives (blocks, P, P) of the sum of log|d| times a weight (blocks, F)."""
        r, damped, square, signs = self._relative(x, omega)
        weight = weight[:, None] * signs
        by_corner, by_damping = (2 * (1 - r) + damped) / square, damped / square
        twice = (4 + 4 * (1 - r) + 2 * damped) / square
        found = np.zeros((self.rows, self.size, self.size))
        corner, damping = np.arange(1, self.size, 2), np.arange(2, self.size, 2)
        found[:, corner, corner] = (weight * (twice - 2 * by_corner**2)).sum(axis=2)
        mixed = (weight * 2 * by_damping * (1 - by_corner)).sum(axis=2)
        found[:, corner, damping] = found[:, damping, corner] = mixed
        found[:, damping, damping] = (weight * 2 * by_damping * (1 - by_damping)).sum(axis=2)
        return found

    def _relative(
        self, x: RealArray, omega: RealArray
    ) -> tuple[RealArray, RealArray, RealArray, RealArray]:
        """Of every zero and pole (blocks, corners, F): r = (omega / corner)^2, 4 damping^2 r, and
        (1 - r)^2 + 4 damping^2 r, the square of its factor; signs (corners, 1), 1 for zeros."""
        signs = np.tile([[1.0], [-1.0]], (self.biquads, 1))
        r = np.exp(2 * (np.log(omega) - x[:, 1::2, None]))
        damped = 4 * np.exp(2 * x[:, 2::2, None]) * r
        return r, damped, (1 - r) ** 2 + damped, signs

    def grown(self, x: RealArray, omega: float, split: RealArray) -> tuple[Scalings, RealArray]:
        """With a biquad more about omega [rad/s], its zeros by `split` (blocks,), in natural
        logarithms, above it and its poles below."""
        larger = Scalings(self.rows, self.biquads + 1)
        y = np.zeros((self.rows, larger.size))
        y[:, : self.size] = x
        y[:, self.size], y[:, self.size + 2] = np.log(omega) + split, np.log(omega) - split
        return larger, y

    def without(self, x: RealArray, biquad: int) -> tuple[Scalings, RealArray]:
        """With a biquad less."""
        first = 1 + 4 * biquad
        return Scalings(self.rows, self.biquads - 1), np.delete(x, range(first, first + 4), 1)

    def limits(self, omega: RealArray) -> tuple[RealArray, RealArray]:
        """Least and largest parameters, flat, for frequencies [rad/s]."""
        low, high = np.log(omega[[0, -1]])
        least, largest = np.full((2, self.rows, self.size), [[[-LARGEST]], [[LARGEST]]])
        for first, _ in self.corners:
            least[:, first], largest[:, first] = low - BEYOND, high + BEYOND
            least[:, first + 1], largest[:, first + 1] = np.log(DAMPING)
        return least.ravel(), largest.ravel()

    @property
    def dampings(self) -> RealArray:
        """1 for the parameters, flat, that are logarithms of damping, 0 for others."""
        found = np.zeros((self.rows, self.size))
        found[:, [first + 1 for first, _ in self.corners]] = 1.0
        return found.ravel()

    def follow(self, target: RealArray, omega: RealArray, weight: RealArray) -> RealArray:
        """Parameters for which log|d| is near a target (blocks, F), weighted (F,) least squares."""
        low, high = np.log(omega[[0, -1]])
        bounds = np.array(
            [[-LARGEST, LARGEST]] + [[low, high], np.log(DAMPING)] * (2 * self.biquads)
        )
        bounds = np.tile(bounds, (self.rows, 1)).T
        shape = (self.rows, self.size)

        def missed(flat: RealArray) -> RealArray:
            value, _ = self.log_magnitude(flat.reshape(shape), omega)
            return np.asarray((weight * (value - target)).ravel())

        def slopes(flat: RealArray) -> RealArray:
            _, slope = self.log_magnitude(flat.reshape(shape), omega)
            found = np.zeros((self.rows, len(omega), self.rows, self.size))
            for block in range(self.rows):
                found[block, :, block] = weight[:, None] * slope[block].T
            return found.reshape(self.rows * len(omega), -1)

        gains = np.average(target, axis=1, weights=weight)
        middles = np.linspace(low, high, STARTS + 2)[1:-1]
        starts = [self.guess(gains, middle, SPREAD) for middle in middles]
        fits = [
            least_squares(
                missed, np.clip(x.ravel(), *bounds), slopes, bounds=bounds, max_nfev=STEPS
            )
            for x in starts
        ]
        best = min(fits, key=lambda fit: fit.cost)
        return np.asarray(best.x.reshape(shape))


def diagonals(structure: Structure, value: RealArray) -> tuple[RealArray, RealArray]:
    """Rows (F, c) and columns (F, r) of values (B, F) of the first B blocks; 0 of the others."""
    rows = np.zeros((value.shape[1], structure.columns))
    columns = np.zeros((value.shape[1], structure.rows))
    places = zip(value, structure.column_slices, structure.row_slices, strict=False)
    for one, row, column in places:
        rows[:, row], columns[:, column] = one[:, None], one[:, None]
    return rows, columns
