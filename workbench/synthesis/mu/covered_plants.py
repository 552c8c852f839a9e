"""Plants about a nominal and a real weight, and how large a circular weight they need."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from workbench._core.arrays import ComplexArray, IntegerArray, RealArray
from workbench.uncertainty import Responses
from workbench.uncertainty.covers.weights import needed_radius, segment_distances

RESPONSE_ROUNDING = 1e-9
"""Rounding of a response, relative to the plants, that radii are increased by."""
LOG_OF_NOTHING = -700.0
"""Logarithm of a radius that counts for nothing."""


@dataclass(frozen=True, eq=False)
class CoveredPlants:
    """Responses of plants at the frequencies (F,) of a cover.

    known
        Plants (F, N) that are known as systems.
    given
        All plants (n, M) at the n frequencies that they are given for; none if all are known.
    at
        Places (n,) of these frequencies among those of the cover.
    lines
        Weights (F, n) of straight lines between logarithms at these frequencies.
    """

    known: ComplexArray
    given: ComplexArray
    at: IntegerArray
    lines: RealArray

    @classmethod
    def of(cls, responses: Responses, omega: RealArray) -> CoveredPlants:
        """The plants of responses, at frequencies [rad/s] (F,) that hold those of the responses."""
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
        """|W_c| (F,) that is needed: exact for known plants, else on lines between the responses.

        Parameters
        ----------
        nominal, end
            Responses (F,) of the nominal, and of the real weight, the end of its segment.
        """
        known, given = self.logs(nominal, end)
        return np.exp(np.maximum(known, self.between(given)))

    def logs(self, nominal: ComplexArray, end: ComplexArray) -> tuple[RealArray, RealArray]:
        """Logs of the |W_c| that known plants need (F,), and all plants where they are given (n,).

        With none known the first count for nothing; with all known there are none of the second.
        """
        known, given = np.full(nominal.size, LOG_OF_NOTHING), np.zeros(0)
        if self.known.size:
            known = np.log(_needed(self.known, nominal, end))
        if self.given.size:
            given = np.log(_needed(self.given, nominal[self.at], end[self.at]))
        return known, given

    def between(self, given: RealArray) -> RealArray:
        """Logs (F,) on straight lines between those (n,) where plants are given."""
        return self.lines @ given if given.size else np.full(len(self.lines), LOG_OF_NOTHING)

    def farthest(self, nominal: ComplexArray, end: ComplexArray) -> CoveredPlants:
        """At each frequency the plant alone that is farthest from its segment."""
        return replace(
            self,
            known=_farthest(self.known, nominal, end),
            given=_farthest(self.given, nominal[self.at], end[self.at]),
        )


def _needed(plants: ComplexArray, nominal: ComplexArray, end: ComplexArray) -> RealArray:
    """|W_c| (F,) that plants (F, N) need, with the rounding errors of their responses."""
    away = plants / nominal[:, None] - 1
    rounding = RESPONSE_ROUNDING * (1 + np.abs(plants).max(axis=1) / np.abs(nominal))
    return np.asarray(needed_radius(away, end) + rounding)


def _farthest(plants: ComplexArray, nominal: ComplexArray, end: ComplexArray) -> ComplexArray:
    if not plants.size:
        return plants
    distance = segment_distances(plants / nominal[:, None] - 1, end)
    return np.take_along_axis(plants, distance.argmax(axis=1)[:, None], axis=1)
