"""D scalings of an iteration: stable, minimum-phase functions.

The scaling of a block is a gain times biquads, see `Biquads`. D at a frequency is not unique, and
it is arbitrary where mu is small. The parameters are therefore not fitted to values of D. Instead
they minimise the worst ratio of sigma_max(D M D^-1) to a reference, see `scaling_fit`.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from workbench._core.arrays import RealArray
from workbench.structure import Structure
from workbench.synthesis.mu.biquads import DAMPING_RANGE, LARGEST_LOG_GAIN, Biquads

CORNER_MARGIN = 2.0
"""Largest distance, in natural logarithms, of corners beyond the frequencies of a loop."""
MOST_EVALUATIONS = 80
"""Largest number of evaluations of one least-squares fit to a target."""
START_COUNT = 7
"""Number of log frequencies around which corners start in a fit to a target."""
CORNER_SPREAD = 0.6
"""Distance between the corners of an initial guess, in natural logarithms."""


PARAMETERS = "log gain and, for each biquad, log z, log a, log p, log b"
"""Names of the parameters of a scaling, for labels of datasets."""


class Scalings(Biquads):
    """Scalings of scalar blocks, one row each; their parameters have shape (blocks, P)."""

    @classmethod
    def of(cls, x: RealArray) -> Scalings:
        """The scalings that have the parameters x (blocks, P)."""
        return cls(len(x), (x.shape[1] - 1) // 4)

    def log_magnitude(self, x: RealArray, omega: RealArray) -> tuple[RealArray, RealArray]:
        """log|d| and derivatives as `Biquads.log_magnitude`, computed for all biquads at once."""
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
        """Relative squares r = (omega / corner)^2 of every zero and pole, and functions of r.

        Returns r, 4 damping^2 r and (1 - r)^2 + 4 damping^2 r, the square of the factor, each of
        shape (blocks, corners, F), and the signs (corners, 1), 1 for zeros and -1 for poles.
        """
        signs = np.tile([[1.0], [-1.0]], (self.biquads, 1))
        r = np.exp(2 * (np.log(omega) - x[:, 1::2, None]))
        damped = 4 * np.exp(2 * x[:, 2::2, None]) * r
        return r, damped, (1 - r) ** 2 + damped, signs

    def grown(self, x: RealArray, omega: float, split: RealArray) -> tuple[Scalings, RealArray]:
        """The scalings and parameters with one more biquad at omega [rad/s].

        Its zeros lie above omega by `split` (blocks,), in natural logarithms, and its poles below.
        """
        larger = Scalings(self.rows, self.biquads + 1)
        y = np.zeros((self.rows, larger.size))
        y[:, : self.size] = x
        y[:, self.size], y[:, self.size + 2] = np.log(omega) + split, np.log(omega) - split
        return larger, y

    def without(self, x: RealArray, biquad: int) -> tuple[Scalings, RealArray]:
        """The scalings and parameters without one of the biquads."""
        first = 1 + 4 * biquad
        return Scalings(self.rows, self.biquads - 1), np.delete(x, range(first, first + 4), 1)

    def limits(self, omega: RealArray) -> tuple[RealArray, RealArray]:
        """Least and largest values of the flat parameters for frequencies [rad/s] of a loop."""
        low, high = np.log(omega[[0, -1]])
        least, largest = np.full(
            (2, self.rows, self.size), [[[-LARGEST_LOG_GAIN]], [[LARGEST_LOG_GAIN]]]
        )
        for first, _ in self.corners:
            least[:, first], largest[:, first] = low - CORNER_MARGIN, high + CORNER_MARGIN
            least[:, first + 1], largest[:, first + 1] = np.log(DAMPING_RANGE)
        return least.ravel(), largest.ravel()

    @property
    def dampings(self) -> RealArray:
        """1 for the flat parameters that are logarithms of damping ratios, 0 for the others."""
        found = np.zeros((self.rows, self.size))
        found[:, [first + 1 for first, _ in self.corners]] = 1.0
        return found.ravel()

    def follow(self, target: RealArray, omega: RealArray, weight: RealArray) -> RealArray:
        """Parameters that fit log|d| to a target (blocks, F) by weighted least squares."""
        low, high = np.log(omega[[0, -1]])
        bounds = np.array(
            [[-LARGEST_LOG_GAIN, LARGEST_LOG_GAIN]]
            + [[low, high], np.log(DAMPING_RANGE)] * (2 * self.biquads)
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
        middles = np.linspace(low, high, START_COUNT + 2)[1:-1]
        starts = [self.guess(gains, middle, CORNER_SPREAD) for middle in middles]
        fits = [
            least_squares(
                missed,
                np.clip(x.ravel(), *bounds),
                slopes,
                bounds=bounds,
                max_nfev=MOST_EVALUATIONS,
            )
            for x in starts
        ]
        best = min(fits, key=lambda fit: fit.cost)
        return np.asarray(best.x.reshape(shape))


def diagonals(structure: Structure, value: RealArray) -> tuple[RealArray, RealArray]:
    """Values (B, F) of the first B blocks, spread to rows (F, c) and columns (F, r); 0 for other
    blocks.
    """
    rows = np.zeros((value.shape[1], structure.columns))
    columns = np.zeros((value.shape[1], structure.rows))
    places = zip(value, structure.column_slices, structure.row_slices, strict=False)
    for one, row, column in places:
        rows[:, row], columns[:, column] = one[:, None], one[:, None]
    return rows, columns
