"""Plants for the corners of a stated spread, which can be simulated.

A stated spread puts corners around a measured response: this response times numbers that are not
real. No plant with real coefficients has such a response at all frequencies, and a model fitted to
one has any static gain, even of the other sign. For each corner a real plant of the stated disc is
taken: the measured one times centre + radius A(s), where A is a first order all-pass. |A| = 1, so
the plant lies on the edge of the disc at all frequencies, and at one of them in the corner's
direction.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from workbench._core.arrays import Array, ComplexArray
from workbench._core.heavy_types import StateSpace
from workbench.uncertainty import Responses
from workbench.uncertainty.responses.spread import CORNERS

SAME = 1e-9
"""Largest relative deviation of a ratio of responses that counts as constant, and of a number that
counts as real."""


@dataclass(frozen=True)
class Corner:
    """The plant of the disc next to a corner: plant ``reference`` times ``centre + offset``."""

    reference: int
    centre: float
    offset: complex

    def plant(self, model: StateSpace, omega: float) -> StateSpace:
        """A real plant with this response at omega [rad/s], if ``model`` is the reference's."""
        import control

        angle = math.atan2(self.offset.imag, self.offset.real)
        sign = -1.0 if angle > 0 else 1.0
        corner = omega / math.tan((math.pi - angle if angle > 0 else -angle) / 2)
        all_pass = control.ss(-corner, 1.0, 2.0 * corner, -1.0)  # (corner - s) / (corner + s)
        return model * (self.centre + sign * abs(self.offset) * all_pass)


def stated_corners(responses: Responses) -> dict[int, Corner]:
    """The plants whose responses are those of others times numbers that are not real, by place."""
    ratio = _constant_ratios(responses)
    found = {}
    for reference in set(ratio[0]):
        members = np.flatnonzero(ratio[0] == reference)
        factors = ratio[1][members]
        centre = factors.mean()
        turned = np.abs(factors.imag) > SAME * np.abs(factors)
        if abs(centre.imag) <= SAME * abs(centre):
            for k, factor in zip(members[turned], factors[turned], strict=True):
                # corners are those of a polygon around the disc
                offset = complex(factor - centre.real) * math.cos(math.pi / CORNERS)
                found[int(k)] = Corner(int(reference), float(centre.real), offset)
    return found if len(responses.plants) - len(found) >= 2 else {}


def without(responses: Responses, places: Collection[int]) -> Responses:
    """The responses of all plants but those at these places."""
    if not places:
        return responses
    kept = np.setdiff1d(np.arange(len(responses.plants)), list(places))
    return replace(
        responses,
        values=responses.values[:, kept],
        present=responses.present[:, kept],
        plants=tuple(responses.plants[k] for k in kept),
        variance=None if responses.variance is None else responses.variance[:, kept],
        degrees=np.broadcast_to(responses.degrees, len(responses.plants))[kept],
        ratios=None,
        known=(),
    )


def _constant_ratios(responses: Responses) -> tuple[Array, Array]:
    """For each plant (N,) the first one whose multiple its response is, and the factor."""
    values, present = responses.values, responses.present
    count = len(responses.plants)
    reference, factor = np.arange(count), np.ones(count, complex)
    for k in range(count):
        for j in np.unique(reference[:k]):
            both = present[:, k] & present[:, j]
            ratio: ComplexArray = values[both, k] / values[both, j]
            if ratio.size and np.abs(ratio - ratio.mean()).max() <= SAME * abs(ratio.mean()):
                reference[k], factor[k] = j, ratio.mean()
                break
    return reference, factor
