"""Radii that the plants need around the segment of W_r, and their ratios to |W_c|, compiled."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.compiled import unchecked
from workbench.uncertainty.covers.joint.size_data import TINY, SizeData

LEAST_PULL = 1e-18
"""A ratio below this share of the largest one is neglected in the norm. A hundred of them stay
below the rounding of the sum. Half or double changes nothing but the last bit.
"""


@unchecked
def needed_radii(
    nominal: ComplexArray, end: ComplexArray, data: SizeData
) -> tuple[ComplexArray, RealArray, RealArray]:
    """Distance (F, N) of each plant from the nearest point of the segment, the place of that point
    on the segment, and the radius that the plant needs.
    """
    count, plants = data.points.shape
    away = np.empty((count, plants), dtype=np.complex128)
    along = np.empty((count, plants))
    radius = np.empty((count, plants))
    for f in range(count):
        to = end[f] / data.unit[f]
        per_square = 1 / max(to.real * to.real + to.imag * to.imag, TINY)
        scale = 1 / nominal[f] if data.multiplicative else complex(1 / data.unit[f])
        center = complex(1.0) if data.multiplicative else nominal[f] * scale
        for i in range(plants):
            deviation = data.points[f, i] * scale - center
            share = (deviation.real * to.real + deviation.imag * to.imag) * per_square
            along[f, i] = max(-1.0, min(1.0, share))
            away[f, i] = deviation - along[f, i] * to
            size = away[f, i].real ** 2 + away[f, i].imag ** 2
            radius[f, i] = max(np.sqrt(size), TINY) + data.floor[f]
    return away, along, radius


@unchecked
def norm_of_ratios(
    radius: RealArray, width: RealArray, data: SizeData, power: int
) -> tuple[float, RealArray, RealArray]:
    """Norm of the ratios of needed radii to |W_c|, and the derivatives of its logarithm: by the
    logarithms of the radii (F, N), and of |W_c| (R,) less the sign.
    """
    count, plants = radius.shape
    rows, most = data.reached.size, 0.0
    ratio = np.empty((rows, plants))
    for k in range(rows):
        f, onward = data.row[k], data.onward[k]
        scale = data.unit[f] / width[k]
        for i in range(plants):
            ratio[k, i] = radius[f, i] * scale
        if onward > 0.0:
            scale = data.unit[f + 1] / width[k]
            for i in range(plants):
                ratio[k, i] *= (radius[f + 1, i] * scale / ratio[k, i]) ** onward
        for i in range(plants):
            most = max(most, ratio[k, i])
    total, least = 0.0, LEAST_PULL ** (1 / power)
    for k in range(rows):
        for i in range(plants):
            share = ratio[k, i] / most
            ratio[k, i] = to_power(share, power) if share > least else 0.0
            total += ratio[k, i]
    pull, own = np.zeros((count, plants)), np.zeros(rows)
    for k in range(rows):
        f, onward = data.row[k], data.onward[k]
        for i in range(plants):
            ratio[k, i] /= total
            own[k] += ratio[k, i]
            pull[f, i] += (1 - onward) * ratio[k, i]
        if onward > 0.0:
            for i in range(plants):
                pull[f + 1, i] += onward * ratio[k, i]
    return most * total ** (1 / power), pull, own


@unchecked
def to_power(value: float, power: int) -> float:
    """The value raised to a power that is a power of two."""
    while power > 1:
        value *= value
        power //= 2
    return value
