"""Upper bounds over frequency as the peak needs them: least only where they are the largest."""

from __future__ import annotations

import math

import numpy as np

from workbench._core.arrays import Array, BoolArray, RealArray
from workbench.certify.band_cover import MAXIMUM_TOLERANCE, FrequencyBounds
from workbench.certify.interval import Multipliers
from workbench.certify.stable_system import StableSystem
from workbench.mu.upper.below import bounds_below, hold_below
from workbench.mu.upper.bound import upper_bound
from workbench.structure import Full, Structure

FIRST_LARGEST, FIRST_SPACING = 8, 16
"""The first level is the largest bound at this many frequencies with the largest responses, and at
every so-manyth frequency. mu is at most the size of the response, so large ones are tried first.
Half or double changes how many bounds lie below the level, that is the time.
"""

FEW_FREQUENCIES = 100
"""Up to this many bounds, saving time is not worthwhile, except with repeated scalars. Half or
double changes the time only.
"""


def with_least_near_top(
    found: FrequencyBounds, structure: Structure, share: float
) -> FrequencyBounds:
    """The bounds, with each bound above a share of the largest replaced by the least one."""
    level = share * float(found.upper.max(initial=0.0))
    loose = ~found.is_least & (found.upper > level)
    if not loose.any():
        return found
    bound = bounds_below(found.M[loose], structure, level)
    parts = found.omega[loose], found.M[loose], bound.value, bound.D_left, bound.D_right, bound.G
    return FrequencyBounds(*parts, least=bound.value > level).joined(found)


class PeakSweep:
    """Bounds at frequencies, of which the largest is the least upper bound; all others are only
    known to be below it.

    Each call takes the largest bound of the calls before as its level.
    """

    def __init__(
        self,
        system: StableSystem,
        structure: Structure,
        band: tuple[float, float] = (0.0, math.inf),
    ) -> None:
        self.system, self.structure, self.band, self.level = system, structure, band, 0.0

    def __call__(self, omega: RealArray) -> FrequencyBounds:
        """Bounds at the increasing frequencies [rad/s] (F,) that lie in the band, and at its ends.

        Frequencies beyond the band are left out: larger bounds there say nothing about the level
        inside.
        """
        low, high = self.band
        omega = omega[(omega >= low) & (omega <= high)]
        if self.level == 0.0:
            omega = np.unique(np.concatenate([omega, self.band]))
        return self._bounded(omega, self.system.response(omega))

    def _bounded(self, omega: RealArray, M: Array) -> FrequencyBounds:
        if self.level > 0.0:
            bound = bounds_below(M, self.structure, self.level)
            least = bound.value > self.level
            self.level = max(self.level, float(bound.value.max()))
            parts = bound.value, bound.D_left, bound.D_right, bound.G
            return FrequencyBounds(omega, M, *parts, least=least)
        first = np.zeros(len(omega), bool)
        largest = np.argsort(-np.linalg.norm(M, axis=(1, 2)))[:FIRST_LARGEST]
        first[::FIRST_SPACING], first[largest] = True, True
        repeated = any(not isinstance(block, Full) and block.rows > 1 for block in self.structure)
        first |= len(omega) <= FEW_FREQUENCIES and not repeated
        bound = upper_bound(M[first], self.structure)
        self.level = float(bound.value.max())
        parts = bound.value, bound.D_left, bound.D_right, bound.G
        found = FrequencyBounds(omega[first], M[first], *parts)
        return found if first.all() else found.joined(self._bounded(omega[~first], M[~first]))

    def settled(self, found: FrequencyBounds) -> BoolArray:
        """Whether the multipliers of one of two neighbouring frequencies hold at both (F - 1,)."""
        place = np.arange(len(found.omega) - 1)
        level = (1 + MAXIMUM_TOLERANCE) * self.level or 1.0
        settled = np.zeros(len(place), bool)
        for own, other in ((0, 1), (1, 0)):
            left = np.flatnonzero(~settled)
            settled[left] = hold_below(
                found.M[left + other],
                self.structure,
                level,
                found.D_right,
                found.G,
                place[left] + own,
            )
        return settled

    def holds(self, M: Array, beta: float, multipliers: Multipliers) -> BoolArray:
        """Whether multipliers prove the bound beta at matrices (F, c, r)."""
        _, D_right, G = (np.asarray(part)[None] for part in multipliers)
        source = np.zeros(len(M), int)
        return hold_below(M, self.structure, beta, D_right, G, source)
