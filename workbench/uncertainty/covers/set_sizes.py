"""Mean square size of sets about a nominal and its gradient, compiled."""

from __future__ import annotations

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.compiled import unchecked

TINY = float(np.finfo(float).tiny)
"""Smallest size that is divided by."""


@unchecked
def mean_square_size(
    points: ComplexArray,
    nominal: ComplexArray,
    slopes: ComplexArray,
    end: ComplexArray,
    turns: ComplexArray,
    unit: RealArray,
    shares: RealArray,
    multiplicative: bool,
    length_weight: float,
    power: int,
) -> tuple[float, RealArray]:
    """Weighted mean of radius^2 + length_weight half-length^2, and its gradient (P + Q,).

    Radii are norms over the plants of the distances from the segments -end..end.

    Parameters
    ----------
    points
        Plants (F, N).
    nominal, slopes
        Response (F,) of the nominal, and its derivatives (F, P).
    end, turns
        Response (F,) of the real weight, in units of ``unit``, and its derivatives (F, Q); zeros
        for circles.
    unit
        Unit (F,) of the deviations of an additive model.
    shares
        Weights (F,) of the frequencies.
    multiplicative
        Whether deviations are relative to the nominal.
    power
        Power of the norms over the plants.
    """
    own, other = slopes.shape[1], turns.shape[1]
    value, gradient = 0.0, np.zeros(own + other)
    count = points.shape[1]
    away, size = np.empty(count, dtype=np.complex128), np.empty(count)
    along, share = np.empty(count), np.empty(count)
    for f in range(len(points)):
        square = max(end[f].real ** 2 + end[f].imag ** 2, TINY)
        most = TINY
        for i in range(count):
            if multiplicative:
                away[i] = points[f, i] / nominal[f] - 1
            else:
                away[i] = (points[f, i] - nominal[f]) / unit[f]
            along[i] = (away[i].real * end[f].real + away[i].imag * end[f].imag) / square
            along[i] = max(-1.0, min(1.0, along[i]))
            size[i] = max(np.abs(away[i] - along[i] * end[f]), TINY)
            most = max(most, size[i])
        total = 0.0
        for i in range(count):
            share[i] = (size[i] / most) ** (power - 1)
            total += share[i] * size[i] / most
        norm = total ** (1 / power)
        radius = most * norm
        value += shares[f] * (radius**2 + length_weight * (square if other else 0.0))
        at_nominal, at_end = complex(0.0), complex(0.0)
        for i in range(count):
            beside = away[i] - along[i] * end[f]
            pull = share[i] / norm ** (power - 1) / size[i] * beside.conjugate()
            at_end -= pull * along[i]
            if multiplicative:
                at_nominal -= pull * (1 + away[i]) / nominal[f]
            else:
                at_nominal -= pull / unit[f]
        weight = 2 * shares[f] * radius
        for a in range(own):
            gradient[a] += weight * (at_nominal * slopes[f, a]).real
        at_end = weight * at_end + 2 * shares[f] * length_weight * end[f].conjugate()
        for b in range(other):
            gradient[own + b] += (at_end * turns[f, b]).real
    return value, gradient
