"""The gain of a controller that makes both channels of a drive equally bad (section 6.3.2)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.optimize import brentq

from workbench.certify.stability import stability_of
from workbench.mu import Peak, peak
from workbench.uncertainty import GeneralisedPlant

MOST_GAIN = 30.0
"""Largest factor on the controller that is tried."""
COARSE = 1e-2
"""Relative tolerance of the peaks that are compared."""


def performance_peak(plant: GeneralisedPlant, K: Any, tolerance: float) -> Peak | None:
    """The peak of robust performance alone; None where the nominal loop is unstable."""
    assert plant.structure is not None
    loop = plant.close(K)
    if not stability_of(loop).holds:
        return None
    whole = plant.structure.with_performance(plant.performance, plant.exogenous)
    return peak(loop, whole, tolerance)


def equalising_gain(plants: Sequence[GeneralisedPlant], K: Any) -> float:
    """The factor on K that makes the peaks of robust performance of two plants equal.

    The first is the one that a larger gain makes better. NaN where no factor up to MOST_GAIN, or
    to that of instability, does.
    """

    def apart(log_gain: float) -> float:
        bounds = [performance_peak(plant, np.exp(log_gain) * K, COARSE) for plant in plants]
        if bounds[0] is None or bounds[1] is None:  # unstable
            return np.nan
        return float(np.log(bounds[0].upper / bounds[1].upper))

    logs = np.log(np.geomspace(1.0, MOST_GAIN, 12))
    distance = np.array([apart(each) for each in logs])
    crossing = np.flatnonzero((distance[:-1] > 0) & (distance[1:] <= 0))
    if not crossing.size:
        return np.nan
    first = crossing[0]
    return float(np.exp(brentq(apart, logs[first], logs[first + 1], xtol=1e-3)))
