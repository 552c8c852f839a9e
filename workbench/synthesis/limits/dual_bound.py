"""A level of mu that no stabilising controller reaches, proven by an integral over all frequencies.

Theorem. Let G be a proper rational plant that falls at high frequency, K any linear time-invariant
controller, rational or not, that stabilises the loop, and T = L / (1 + L). Then T = G K S is in H2:
K S is in H-infinity, and T is 0 at the zeros and 1 at the poles of G in the right half-plane. Let h
be in H2 with real coefficients, except for simple poles at some of these points. Then Cauchy's
theorem gives

    integral over omega from 0 to infinity of Re(T(j omega) h(j omega)) = - pi sum of residues of h,

where the sum runs over the unstable poles of G. If mu of the loop is at most a level at every
frequency, T(j omega) lies in the sets of `allowed_sets`. So no controller reaches the level if the
integral of the largest Re(T h) over these sets is less than the right side. (G need not be stable.
If it is stable and has no zeros in the right half-plane, every analytic T in these sets belongs to
some K.)

Any h that satisfies this is a proof, wherever it comes from. The integral is bounded from above on
each cell of frequency, on [0, lowest] and on [highest, infinity), including all rounding. On a
cell, the sets are contained in those of the least weights, and h is replaced by its tangent. The
largest Re(T h) is convex in h, so the trapezoidal rule bounds its mean. The cells that improve the
bound most are halved.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.synthesis.limits.allowed_sets import largest_modulus, largest_projections
from workbench.synthesis.limits.analytic_basis import AnalyticBasis
from workbench.synthesis.limits.intervals import Interval, up
from workbench.synthesis.limits.loop_functions import LoopFunctions
from workbench.synthesis.limits.rational_bounds import FrequencyCells

START_CELLS = 400
"""Number of cells of the band before any is halved."""
MOST_CELLS = 10_000
"""Halving ends when there are more cells than this."""
MOST_ROUNDS = 80
"""Largest number of rounds of halving. A resonance with damping 1e-6 needs about twenty."""
HALVED_SHARE = 0.7
"""Share of the total expected gain of halving that belongs to the cells halved in one round."""
HOPELESS = 1.5
"""The proof is given up if the bound exceeds this many times the total expected gain of halving."""
TAIL_SHARE = 0.1
"""The highest frequency grows while the tail exceeds this share of the total expected gain of
halving.
"""
TAIL_FACTOR = 4.0
"""Factor by which the highest frequency grows."""
ENDS_ROUNDING = 2.0**-50
"""Relative rounding error of h at the ends of a cell: two products and two sums."""
SLACK_SHARE, LEAST_SLACK = 0.3, 3e-4
"""Slack of the largest Re(T h) over a cell, relative to the cell's relative radius, and its least
value. The change of the weights over a cell costs more than this slack.
"""
PI = Interval(np.asarray(np.pi), up(np.pi))


@dataclass(frozen=True, eq=False)
class DualCertificate:
    """A function h that proves that no stabilising controller has mu <= level at all frequencies.

    ``coefficients`` (N,) are those of h in ``basis``. It proves the ``level`` for a loop where
    `excess` is negative.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.executor import Context
    >>> from workbench.fitting import Rational
    >>> from workbench.synthesis import AnalyticBasis, LoopFunctions, highest_certificate
    >>> loop = LoopFunctions(Rational([], [], 0.1), Rational([], [], 1.0), Rational([], [1.0], 1.0))
    >>> basis = AnalyticBasis(np.geomspace(0.05, 20.0, 12), (1e-3, 1e3), poles=[1.0])
    >>> found = highest_certificate(loop, basis, 1.0, 3.0, Context())
    >>> found.excess(loop) < 0
    True
    """

    level: float
    coefficients: RealArray
    basis: AnalyticBasis

    def h(self, omega: RealArray) -> ComplexArray:
        """Response of h at frequencies [rad/s] (F,)."""
        found: ComplexArray = self.basis.response(omega) @ self.coefficients
        return found

    @np.errstate(all="ignore")
    def excess(self, loop: LoopFunctions) -> float:
        """Upper bound on the integral of the largest allowed Re(T h), less the integral of any
        controller.

        If it is negative, no stabilising linear time-invariant controller has mu <= level at every
        frequency. It is minus infinity if some frequency allows no T at all.

        Raises
        ------
        InputError
            The basis has a zero or pole in the right half-plane that the plant does not have.
        """
        self._check(loop)
        ends = 2 * np.pi * np.geomspace(*self.basis.band_hz, START_CELLS)
        cells, highest = FrequencyCells(np.append(0.0, ends[:-1]), ends), float(ends[-1])
        bound, gain = self._cell_integrals(loop, cells), np.full(START_CELLS, np.inf)
        total = np.inf
        for _ in range(MOST_ROUNDS):
            if (bound == -np.inf).any():
                return -np.inf
            tail = self._tail_integral(loop, highest)
            total = self._excess_of(bound, tail)
            if total < 0.0 or len(bound) > MOST_CELLS or total > HOPELESS * gain.sum():
                break
            chosen = _cells_to_halve(gain)
            halves = cells.at(chosen).halved
            found = self._cell_integrals(loop, halves)
            each = (bound[chosen] - found.reshape(2, -1).sum(axis=0)) / 2
            each = np.tile(np.where(np.isnan(each), np.inf, np.maximum(each, 0.0)), 2)
            cells = cells.at(~chosen).joined(halves)
            bound, gain = np.append(bound[~chosen], found), np.append(gain[~chosen], each)
            if tail > TAIL_SHARE * gain.sum():
                beyond = FrequencyCells(np.array([highest]), np.array([TAIL_FACTOR * highest]))
                highest = float(beyond.high[0])
                cells = cells.joined(beyond)
                bound, gain = (
                    np.append(bound, self._cell_integrals(loop, beyond)),
                    np.append(gain, np.inf),
                )
        return total

    def _check(self, loop: LoopFunctions) -> None:
        plant = {"zeros": loop.plant.zeros, "poles": loop.plant.poles}
        for name, other in (("zeros", "poles"), ("poles", "zeros")):
            for point in getattr(self.basis, name):
                if point not in plant[name] or point in plant[other]:
                    raise InputError(
                        f"h has a pole at {point:.6g} as at one of the plant's {name}, "
                        f"but these are {plant[name]}"
                    )

    def _excess_of(self, bound: RealArray, tail: float) -> float:
        """Sum of the cells' integrals and the tail, less the known integral of any controller."""
        if not np.isfinite(bound).all():
            return np.inf
        known = Interval.of(0.0)
        for each, x in zip(self.basis.known, self.coefficients, strict=True):
            known = known + Interval.of(each) * x
        return float(up(math.fsum([*bound, tail, float((-(known * PI)).high)])))

    def _cell_integrals(self, loop: LoopFunctions, cells: FrequencyCells) -> RealArray:
        """Upper bounds (F,) on the integral over each cell; -inf where no T is allowed."""
        weights, h = loop.over(cells), self.basis.tangent(self.coefficients, cells)
        along = h.slope * cells.radius
        ends = np.stack([h.value - along, h.value + along], axis=1)
        slack = np.maximum(SLACK_SHARE * cells.radius / cells.middle, LEAST_SLACK)
        first, last = map(Interval.of, largest_projections(weights, self.level, ends, slack).T)
        # The chord between middle - radius and middle + radius, at the mean frequency of the cell.
        middle, radius = Interval.of(cells.middle), Interval.of(cells.radius)
        aside = ((cells.high - middle) - (middle - cells.low)) / (radius * 2)
        mean = (first + last + (last - first) * aside) / 2
        rounding = ENDS_ROUNDING * (np.abs(h.value) + np.abs(along))
        error = (Interval.of(h.error) + rounding) * largest_modulus(weights, self.level)
        whole = (cells.width * (mean + error)).high
        empty = (first.high == -np.inf) | (last.high == -np.inf)
        return np.where(empty, -np.inf, np.where(np.isnan(whole), np.inf, whole))

    def _tail_integral(self, loop: LoopFunctions, lowest: float) -> float:
        """An upper bound on the integral above a frequency: |T h| <= c / omega^(k + 1)."""
        c = Interval.of(loop.largest_beyond(lowest, self.level))
        c = c * self.basis.decay(self.coefficients, lowest)
        power = Interval.of(1.0)
        for _ in range(loop.falls):
            power = power * lowest
        return float((c / (power * loop.falls)).high)


def _cells_to_halve(gain: RealArray) -> NDArray[np.bool_]:
    """Mask of the cells with the largest gains, which together have HALVED_SHARE of the sum."""
    order = np.argsort(-gain)
    sizes = gain[order]
    count = (
        np.isinf(sizes).sum() or np.searchsorted(np.cumsum(sizes), HALVED_SHARE * sizes.sum()) + 1
    )
    chosen = np.zeros(gain.shape, bool)
    chosen[order[:count]] = True
    return chosen
