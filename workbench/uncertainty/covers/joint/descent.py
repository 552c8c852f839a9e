"""Quasi-Newton descent of the size of a model, compiled, so that a step costs only its
arithmetic.
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.compiled import unchecked
from workbench.uncertainty.covers.joint.model_size import model_size
from workbench.uncertainty.covers.joint.size_data import SizeData

FALL, RISE = 1e-4, 0.9
"""Constants of the weak Wolfe conditions: least share of the predicted decrease of a step, and
largest share of the slope that may remain at its end. They are the usual ones for quasi-Newton
methods. Half or double: a line search ends a trial earlier or later.
"""
STEP_LENGTHS = 30
"""Largest number of lengths tried for a step. Halving 30 times leaves 1e-9 of a step; then the
slope is rounding. With half of them a search may end early; double changes nothing.
"""


@unchecked
def least_size(
    x: RealArray, unit: RealArray, inverse: RealArray, data: SizeData, power: int, steps: int
) -> tuple[float, RealArray, RealArray]:
    """Size, parameters (P,) and inverse Hessian (P, P) after at most `steps` steps of BFGS.

    Step lengths are bisected until the weak Wolfe conditions hold, which suits a nonsmooth size
    (Lewis and Overton, Mathematical Programming 141, 2013). The search ends if no length lowers the
    size.

    Parameters
    ----------
    x
        Parameters (P,) at the start, in units ``unit`` (P,).
    inverse
        Estimate (P, P) of the inverse Hessian; 0 if nothing is known.
    data, power
        As in `model_size`.
    """
    count = x.size
    inverse = inverse.copy()
    fresh = not inverse.any()
    if fresh:
        _reset(inverse, 1.0)
    value, slope = model_size(x * unit, data, power)
    slope = slope * unit
    for _ in range(steps):
        step = -(inverse @ slope)
        fall = step @ slope
        if not fall < 0.0:  # rounding has spoiled it, so start again
            if fresh:
                break
            _reset(inverse, 1.0)
            fresh = True
            continue
        length = min(1.0, 1 / np.sqrt(step @ step)) if fresh else 1.0
        low, high, met = 0.0, np.inf, False
        new, there, new_slope = value, x, slope
        for _ in range(STEP_LENGTHS):
            there = x + length * step
            new, new_slope = model_size(there * unit, data, power)
            new_slope = new_slope * unit
            left = step @ new_slope
            if not (new <= value + FALL * length * fall and np.isfinite(left)):
                high = length
            elif left < RISE * fall:
                low = length
            else:
                met = True
                break
            length = (low + high) / 2 if high < np.inf else 2 * low
        if not met and not new < value:
            break
        moved, turned = there - x, new_slope - slope
        x, value, slope = there, new, new_slope
        along = moved @ turned
        if along > 0.0:
            if fresh:
                _reset(inverse, along / (turned @ turned))
            bent = inverse @ turned
            more = (1 + turned @ bent / along) / along
            for i in range(count):
                for j in range(count):
                    inverse[i, j] += more * moved[i] * moved[j]
                    inverse[i, j] -= (bent[i] * moved[j] + moved[i] * bent[j]) / along
            fresh = False
    return value, x, inverse


@unchecked
def _reset(inverse: RealArray, size: float) -> None:
    """Set a matrix to a multiple of the identity."""
    inverse[:] = 0.0
    for i in range(len(inverse)):
        inverse[i, i] = size
