"""Arithmetic with stadiums in the complex plane: products with numbers, distances of points.

A circle times a complex number is a circle, and a stadium times a complex number is a stadium,
turned by the number's argument. In this way sets of plants become sets of loops.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import Array, RealArray
from workbench.geometry.enclosing_stadium import Stadium
from workbench.geometry.stadium import NarrowestStadium

SEGMENT_POINTS = 721
"""Number of points of a segment, and of half planes, that bound a distance; refined once around the
best.
"""


def multiplied_sets(factor: ArrayLike, sets: Stadium) -> Stadium:
    """Stadiums (F,) multiplied by complex numbers (F,).

    Examples
    --------
    >>> from workbench.geometry import multiplied_sets, narrowest_stadium
    >>> stadiums = narrowest_stadium([[0, 2, 4, 2 + 1j]])
    >>> multiplied_sets(2j, stadiums).radius.round(6).tolist()  # doubled, turned by 90 deg
    [1.0]
    """
    factor = np.asarray(factor, dtype=complex)
    size = abs(factor)
    angle = np.mod(sets.angle + np.angle(factor), np.pi)
    return Stadium(sets.center * factor, sets.radius * size, sets.half_length * size, angle)


def sets_around_nominal(nominal: Array, relative: Stadium) -> Stadium:
    """The sets nominal * (1 + delta) of relative deviations delta in stadiums (F,).

    nominal: complex (F,).

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.geometry import sets_around_nominal, narrowest_stadium
    >>> deviations = narrowest_stadium([[-0.1, 0.1, 0.05j]])
    >>> sets_around_nominal(np.array([2.0]), deviations).center.shape
    (1,)
    """
    placed = multiplied_sets(nominal, relative)
    return Stadium(nominal + placed.center, placed.radius, placed.half_length, placed.angle)


def signed_distance(point: complex, sets: Stadium) -> RealArray:
    """Distance (F,) of a point from the boundary of each stadium (F,), negative inside.

    Examples
    --------
    >>> from workbench.geometry import narrowest_stadium, signed_distance
    >>> stadiums = narrowest_stadium([[0, 2, 4, 2 + 1j]])
    >>> signed_distance(2 + 0.5j, stadiums).round(6).tolist()
    [-0.5]
    """
    points = NarrowestStadium(np.full((len(sets.radius), 1), point))
    away: RealArray = (points.distance(sets)[:, 0] - sets.radius).astype(float)
    return away


def signed_distance_bounds(point: complex, sets: Stadium) -> tuple[RealArray, RealArray]:
    """Lower and upper bounds (F,) of `signed_distance`, by other formulas.

    A half plane that contains the segment gives a lower bound of the distance, a point of the
    segment an upper bound. Both are refined once around the best.

    Examples
    --------
    >>> from workbench.geometry import narrowest_stadium, signed_distance_bounds
    >>> stadiums = narrowest_stadium([[0, 2, 4, 2 + 1j]])
    >>> low, high = signed_distance_bounds(10 + 0.5j, stadiums)
    >>> bool(low[0] <= high[0])
    True
    """
    away = ((point - sets.center) * np.exp(-1j * sets.angle))[:, None]
    length = sets.half_length[:, None]

    def from_points(t: RealArray) -> RealArray:
        return -abs(away - t * length)

    def from_planes(turn: RealArray) -> RealArray:
        normal = np.exp(-1j * np.pi * turn)
        plane: RealArray = (away * normal).real - length * abs(normal.real)
        return plane

    grid = np.broadcast_to(np.linspace(-1, 1, SEGMENT_POINTS), (len(length), SEGMENT_POINTS))
    high, low = (_refined(value, grid) for value in (from_points, from_planes))
    return low - sets.radius, -high - sets.radius


def _refined(value: Callable[[RealArray], RealArray], grid: RealArray) -> RealArray:
    """Largest value (F,) on a grid (F, N) and on a finer one between the neighbours of the
    maximum.
    """
    best = grid[np.arange(len(grid)), value(grid).argmax(axis=1)][:, None]
    step = grid[:, 1:2] - grid[:, :1]
    finer = np.clip(best + step * np.linspace(-1, 1, SEGMENT_POINTS), -1, 1)
    largest: RealArray = np.maximum(value(finer).max(axis=1), value(best)[:, 0])
    return largest
