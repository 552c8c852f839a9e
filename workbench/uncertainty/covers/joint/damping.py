"""Penalty for roots of weights with less damping than the frequencies resolve, compiled."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.compiled import unchecked
from workbench.uncertainty.covers.joint.size_data import SizeData
from workbench.uncertainty.covers.weights import SUFFICIENT_DAMPING

RESOLVED_MARGIN = 1.02
"""Least damping of roots of weights, relative to the damping that the frequencies resolve. The
search works on a coarser grid, and a root on the limit would be moved at the end. With half of the
distance from 1 it may still be moved; with double of it roots are damped a little more.
"""


@unchecked
def with_penalty(
    value: float, gradient: RealArray, vector: RealArray, data: SizeData
) -> tuple[float, RealArray]:
    """The size and its gradient with a penalty for roots with less damping than the frequencies
    resolve.
    """
    count = vector.size
    excess, turn = 0.0, np.zeros(count)
    for j in range(len(data.damping)):
        damping, tone = data.damping[j, count], data.tone[j, count]
        for a in range(count):
            damping += data.damping[j, a] * vector[a]
            tone += data.tone[j, a] * vector[a]
        limit = min(_at(tone, data.middle, data.gap) / 2, SUFFICIENT_DAMPING) * RESOLVED_MARGIN
        short = np.log(limit) - damping
        if short > 0.0:
            excess += short**2
            for a in range(count):
                turn[a] -= 2 * short * data.damping[j, a]
    for a in range(count):
        gradient[a] = gradient[a] * (1 + excess) + value * turn[a]
    return value * (1 + excess), gradient


@unchecked
def _at(x: float, places: RealArray, values: RealArray) -> float:
    """Linear interpolation of values at places, constant beyond them."""
    k = np.searchsorted(places, x)
    if k == 0:
        return values[0]
    if k == places.size:
        return values[-1]
    share = (x - places[k - 1]) / (places[k] - places[k - 1])
    return values[k - 1] * (1 - share) + values[k] * share
