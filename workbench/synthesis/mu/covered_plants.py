"""The circular weight that plants need around a nominal and a real weight."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from workbench._core.arrays import ComplexArray, IntegerArray, RealArray
from workbench.uncertainty import Responses
from workbench.uncertainty.covers.weights import needed_radius, segment_distances

RESPONSE_ROUNDING = 1e-9
"""Rounding error of a response, relative to the plants; radii are increased by it."""
LOG_OF_NOTHING = -700.0
"""Logarithm of a radius that is negligible."""


@dataclass(frozen=True, eq=False)
class CoveredPlants:
    """Responses of plants at the frequencies (F,) of a cover.

    Unlike `Responses`, it has only arrays, interpolated to the frequencies of a search.

    known
        Plants (F, N) that are known as systems at every frequency.
    given
        All plants (n, M) at the n frequencies where they are given; empty if all are known.
    at
        Indices (n,) of these frequencies among those of the cover.
    lines
        Weights (F, n) of the linear interpolation of logarithms between these frequencies.
    """

    known: ComplexArray
    given: ComplexArray
    at: IntegerArray
    lines: RealArray

    @classmethod
    def of(cls, responses: Responses, omega: RealArray) -> CoveredPlants:
        """The plants of responses, at frequencies [rad/s] (F,) that include those of the
        responses.
        """
        known = [plant.response(omega) for plant in responses.known_plants.values()]
        given = responses.omega[: 0 if len(known) == len(responses.plants) else None]
        lines = [np.interp(np.log(omega), np.log(given), row) for row in np.eye(given.size)]
        return cls(
            np.array(known, complex).reshape(len(known), omega.size).T,
            responses.points[: given.size],
            np.searchsorted(omega, given),
            np.array(lines).reshape(given.size, omega.size).T,
        )

    def radius(self, nominal: ComplexArray, end: ComplexArray) -> RealArray:
        """The |W_c| (F,) needed: exact for known plants, interpolated between the frequencies for
        others.

        Parameters
        ----------
        nominal, end
            Responses (F,) of the nominal, and of the real weight, which is the end of its segment.
        """
        known, given = self.logs(nominal, end)
        return np.exp(np.maximum(known, self.between(given)))

    def logs(self, nominal: ComplexArray, end: ComplexArray) -> tuple[RealArray, RealArray]:
        """Logs of the |W_c| that known plants need (F,), and that all plants need where they are
        given (n,).

        If no plant is known, the first ones are negligible. If all are known, the second array is
        empty.
        """
        known, given = np.full(nominal.size, LOG_OF_NOTHING), np.zeros(0)
        if self.known.size:
            known = np.log(_needed_radius(self.known, nominal, end))
        if self.given.size:
            given = np.log(_needed_radius(self.given, nominal[self.at], end[self.at]))
        return known, given

    def between(self, given: RealArray) -> RealArray:
        """Logs (F,) by linear interpolation between those (n,) where plants are given."""
        return self.lines @ given if given.size else np.full(len(self.lines), LOG_OF_NOTHING)

    def farthest(self, nominal: ComplexArray, end: ComplexArray) -> CoveredPlants:
        """Only the plant that is farthest from the segment, at each frequency."""
        return replace(
            self,
            known=_farthest_plant(self.known, nominal, end),
            given=_farthest_plant(self.given, nominal[self.at], end[self.at]),
        )


def _needed_radius(plants: ComplexArray, nominal: ComplexArray, end: ComplexArray) -> RealArray:
    """The |W_c| (F,) that plants (F, N) need, including the rounding errors of their responses."""
    away = plants / nominal[:, None] - 1
    rounding = RESPONSE_ROUNDING * (1 + np.abs(plants).max(axis=1) / np.abs(nominal))
    return np.asarray(needed_radius(away, end) + rounding)


def _farthest_plant(plants: ComplexArray, nominal: ComplexArray, end: ComplexArray) -> ComplexArray:
    if not plants.size:
        return plants
    distance = segment_distances(plants / nominal[:, None] - 1, end)
    return np.take_along_axis(plants, distance.argmax(axis=1)[:, None], axis=1)
