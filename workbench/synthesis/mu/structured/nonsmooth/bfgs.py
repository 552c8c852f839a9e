"""BFGS for functions with kinks, and gradients sampled about the place where it ends.

A line search by Wolfe's weak conditions keeps the updates positive definite across kinks, and takes
an infinite value for a step that is too long (A. S. Lewis, M. L. Overton, Nonsmooth optimization
via quasi-Newton methods, Mathematical Programming 141 (2013) 135-163). Where it ends, the least
element in the hull of gradients at points nearby gives directions that lead on along the kink
(J. V. Burke, A. S. Lewis, M. L. Overton, A robust gradient sampling algorithm for nonsmooth,
nonconvex optimization, SIAM J. Optimization 15 (2005) 751-779).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from workbench._core.arrays import RealArray
from workbench.executor.clock import time_is_up
from workbench.synthesis.mu.structured.nonsmooth.hull import least_in_hull

Valued = Callable[[RealArray], tuple[float, RealArray]]
"""A function of parameters y (k,): its value, infinite where it has none, and its slopes (k,)."""

FALL, SLOPE = 1e-4, 0.5
"""Shares of a line search by Wolfe's weak conditions: least fall, and most of the slope left."""
MOST_TRIALS, LONGEST = 40, 500.0
"""Most trials of a line search, and its longest step over the first trial."""
PATIENCE, SETTLED_FALL = 10, 1e-6
"""BFGS is settled where the value falls by less than this within so many steps."""
RADII = (1e-1, 1e-2, 1e-3, 1e-4)
"""Radii in which gradients are sampled, in units of the parameters."""
MOST_SAMPLED_STEPS = 20
"""Most steps with one radius."""
LEAST_SLOPE = 1e-5
"""Length of the least element of the hull below which the radius shrinks."""
LONGEST_STEP, LEAST_STEP = 1.0, 1e-9
"""Longest first trial along a sampled direction, and the shortest trial."""


def bfgs_end(
    valued: Valued, y: RealArray, most_steps: int, enough: float = -math.inf
) -> tuple[RealArray, float]:
    """The end of BFGS from y, where the value is finite, and the value there.

    It ends where it is settled, where a value is `enough`, after the most steps, or with the clock.
    """
    value, slope = valued(y)
    inverse = np.eye(len(y)) / max(float(np.linalg.norm(slope)), 1.0)
    known, values = False, [value]
    for _ in range(most_steps):
        if value <= enough or time_is_up("BFGS"):
            break
        direction = -inverse @ slope
        found = _line_search(valued, y, value, slope, direction, enough)
        if found is None:
            if not known:
                break
            inverse, known = np.eye(len(y)) / max(float(np.linalg.norm(slope)), 1.0), False
            continue
        length, value, turned = found
        step, change = length * direction, turned - slope
        y, slope = y + step, turned
        values.append(value)
        if len(values) > PATIENCE and values[-PATIENCE] - value < SETTLED_FALL:
            break
        seen = float(step @ change)
        if seen > 0:
            if not known:
                inverse, known = np.eye(len(y)) * seen / float(change @ change), True
            turn = np.eye(len(y)) - np.outer(step, change) / seen
            inverse = turn @ inverse @ turn.T + np.outer(step, step) / seen
    return y, value


def sampled_end(
    valued: Valued, y: RealArray, rng: np.random.Generator, radii: tuple[float, ...] = RADII
) -> tuple[RealArray, float]:
    """The end of steps along directions of sampled gradients from y, and the value there."""
    value, slope = valued(y)
    for radius in radii:
        for _ in range(MOST_SAMPLED_STEPS):
            if time_is_up("sampled gradients"):
                return y, value
            near = y + radius * _in_ball(rng, len(y) + 2, len(y))
            slopes = [each for v, each in map(valued, near) if math.isfinite(v)]
            direction = -least_in_hull(np.array([slope, *slopes]))
            size = float(np.linalg.norm(direction))
            if size < LEAST_SLOPE:
                break
            length = LONGEST_STEP / max(size, 1.0)
            while length > LEAST_STEP:
                reached, turned = valued(y + length * direction)
                if reached < value - FALL * length * size**2:
                    break
                length /= 3.0
            else:
                break
            y, value, slope = y + length * direction, reached, turned
    return y, value


def stationarity(
    valued: Valued, y: RealArray, rng: np.random.Generator, radius: float = RADII[-1]
) -> float:
    """Length of the least element in the hull of the gradients within a radius about y.

    Zero at a stationary point as the radius shrinks; an end of a descent is local, whatever it is.
    """
    near = [y, *(y + radius * _in_ball(rng, 2 * len(y) + 2, len(y)))]
    slopes = [slope for value, slope in map(valued, near) if math.isfinite(value)]
    return float(np.linalg.norm(least_in_hull(np.array(slopes))))


def _in_ball(rng: np.random.Generator, count: int, size: int) -> RealArray:
    """Points (count, size) that fill the unit ball evenly."""
    direction = rng.normal(size=(count, size))
    length = rng.uniform(size=(count, 1)) ** (1.0 / size)
    found: RealArray = length * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    return found


def _line_search(
    valued: Valued,
    y: RealArray,
    value: float,
    slope: RealArray,
    direction: RealArray,
    enough: float,
) -> tuple[float, float, RealArray] | None:
    """A length by Wolfe's weak conditions, with value and slopes there; None where none falls.

    It ends too where the value is `enough`, and where a function falls ever on.
    """
    low, high, length = 0.0, math.inf, 1.0
    promised = float(slope @ direction)
    if not promised < 0.0:
        return None
    best = None
    for _ in range(MOST_TRIALS):
        reached, turned = valued(y + length * direction)
        if reached < value + FALL * length * promised:
            best = length, reached, turned
            if turned @ direction >= SLOPE * promised or reached <= enough or length > LONGEST:
                return best
            low = length
        else:
            high = length
        length = 2.0 * low if math.isinf(high) else (low + high) / 2.0
    return best
