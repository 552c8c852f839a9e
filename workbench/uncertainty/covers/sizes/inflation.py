"""How much larger the sets of a cover are than the raw ones, the narrowest sets around the points.

Raw sets about the fitted nominal alone could be cheated: a nominal far from the plants makes them
large. Raw sets with free centres depend on the plants only, but no nominal of low order passes
through all their centres. So both are compared.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.certify.rounding import TINY
from workbench.geometry import Circle, Stadium
from workbench.uncertainty.covers.steps import CoverSteps
from workbench.uncertainty.responses.plants import Responses


class Inflation(NamedTuple):
    """Ratios of the sizes of a cover's sets to those of the raw ones.

    Parameters
    ----------
    about
        Radius plus half-length over that of the narrowest sets about the nominal (F,).
    free
        The same over that of the narrowest sets with free centres (F,).
    rms
        Root mean square of the radius, over log frequency, over that of the sets about the nominal.
    rms_free
        The same over that of the sets with free centres, in units of the plants' root mean square.
    """

    about: RealArray
    free: RealArray
    rms: float
    rms_free: float

    @property
    def largest(self) -> float:
        """Largest ratio, without ``rms``, which a nominal far from the plants makes small."""
        return float(max(self.about.max(), self.free.max(), self.rms_free))


def inflation_of(responses: Responses, points: ComplexArray, answer: CoverSteps) -> Inflation:
    """Ratios of the sizes of a cover's sets to those of the raw ones around points (F, N)."""
    first, second, shares = answer.first, answer.second, responses.shares
    width, length = answer.model.sizes(responses.omega)
    plain = plant_sizes(points)
    scale = np.ones_like(plain)
    if answer.model.form == "multiplicative":
        scale = np.abs(answer.model.nominal.response(responses.axis))
    return Inflation(
        _ratio(width + length, second.radius + second.half_length),
        _ratio(scale * (width + length), extent(first)),
        float(_ratio(_rms(shares, width), _rms(shares, second.radius))),
        float(_ratio(_rms(shares, scale * width / plain), _rms(shares, first.radius / plain))),
    )


def plant_sizes(points: ComplexArray) -> RealArray:
    """Root mean square (F,) of the plants' sizes at each frequency."""
    return np.asarray(np.sqrt(np.mean(np.abs(points) ** 2, axis=1)))


def extent(shape: Circle | Stadium) -> RealArray:
    """Radius plus half-length (F,)."""
    return shape.radius + shape.half_length if isinstance(shape, Stadium) else shape.radius


def _rms(shares: RealArray, size: RealArray) -> RealArray:
    return np.sqrt(shares @ size**2)


def _ratio(size: RealArray, raw: RealArray) -> RealArray:
    """Ratio of sizes, 1 for two sets that are points."""
    return np.asarray(np.maximum(size, TINY) / np.maximum(raw, TINY))
