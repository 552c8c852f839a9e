"""BFGS for nonsmooth functions, and gradient sampling around the point where it ends.

A line search by Wolfe's weak conditions keeps the updates positive definite across kinks; an
infinite value means that the step is too long (A. S. Lewis, M. L. Overton, Nonsmooth optimization
via quasi-Newton methods, Mathematical Programming 141 (2013) 135-163). Where BFGS ends, the
shortest vector in the convex hull of gradients at points nearby gives descent directions along the
kink (J. V. Burke, A. S. Lewis, M. L. Overton, A robust gradient sampling algorithm for nonsmooth,
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
"""Function: parameters y (k,) -> value (infinite where it is not defined) and gradient (k,)."""

FALL, SLOPE = 1e-4, 0.5
"""Constants of Wolfe's weak conditions in a line search: share of the predicted decrease, and share
of the slope that may remain.
"""
MOST_TRIALS, LONGEST = 40, 500.0
"""Largest number of trials of a line search, and its longest step relative to the first trial."""
PATIENCE, SETTLED_FALL = 10, 1e-6
"""BFGS is settled if the value decreases by less than the first number within the second number of
steps.
"""
RADII = (1e-1, 1e-2, 1e-3, 1e-4)
"""Radii within which gradients are sampled, in units of the parameters."""
MOST_SAMPLED_STEPS = 20
"""Largest number of steps with one radius."""
LEAST_SLOPE = 1e-5
"""The radius shrinks if the shortest vector in the hull is shorter than this."""
LONGEST_STEP, LEAST_STEP = 1.0, 1e-9
"""Longest first trial along a sampled direction, and shortest trial."""


def bfgs_end(
    valued: Valued, y: RealArray, most_steps: int, enough: float = -math.inf
) -> tuple[RealArray, float]:
    """The end of BFGS from y, and the value there. The value at y must be finite.

    BFGS ends if it is settled, if a value is at most `enough`, after the largest number of steps,
    or at the time limit.
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
    """Length of the shortest vector in the convex hull of gradients within a radius around y.

    As the radius shrinks, it tends to zero at a stationary point. Such a point is only a local
    result.
    """
    near = [y, *(y + radius * _in_ball(rng, 2 * len(y) + 2, len(y)))]
    slopes = [slope for value, slope in map(valued, near) if math.isfinite(value)]
    return float(np.linalg.norm(least_in_hull(np.array(slopes))))


def _in_ball(rng: np.random.Generator, count: int, size: int) -> RealArray:
    """Random points (count, size), uniform in the unit ball."""
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
    """A step length by Wolfe's weak conditions, with value and gradient there; None if no step
    decreases the value.

    The search also ends if the value is at most `enough`, or if the function decreases without end.
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
