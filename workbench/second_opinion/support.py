"""Containment in circles and stadiums by support functions: no distance of a point is computed."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.executor.effort import tries

DIRECTIONS = 180
"""Number of directions, over the whole turn, in which points and shapes are compared."""


def reach_beyond(
    points: ComplexArray,
    center: ComplexArray,
    radius: RealArray,
    half_length: RealArray,
    angle: RealArray,
) -> RealArray:
    """Distance by which each of the points (..., N) reaches beyond its shape in the worst
    direction.

    A point lies in a convex set if and only if it reaches no further than the set in any direction.
    A stadium reaches radius + half_length |cos t| from its centre in direction angle + t; a circle
    has half-length 0. The shapes are arrays (...).
    """
    found = np.full(points.shape, -np.inf)
    # Subtract first: a point far from 0 must not hide its distance by rounding.
    away = (points - np.asarray(center)[..., None]) * np.exp(-1j * np.asarray(angle))[..., None]
    directions = tries(DIRECTIONS)
    # angle from the direction of the stadium
    for t in 2 * np.pi * np.arange(directions) / directions:
        reach = radius + half_length * np.abs(np.cos(t))
        found = np.maximum(found, (away * np.exp(-1j * t)).real - np.asarray(reach)[..., None])
    return found
