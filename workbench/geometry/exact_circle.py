"""The smallest circle around every set of points, exact up to rounding.

The circle is that of two or three of the points, its basis. The farthest point from the circle
enters the basis, and the smallest circle of the basis and that point is one of at most six; the
radius grows with every exchange until no point is outside. No hull is needed: an exchange costs
one pass over the points, and there are about ten.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import EPS
from workbench._core.compiled import compiled, unchecked_kernel
from workbench.geometry.points import (
    as_batch,
    find_frame,
    length_from_frame,
    point_from_frame,
    to_frame,
)

MAX_BASIS_EXCHANGES = 200
"""Largest number of exchanges of the basis of one set. Only rounding can cause more, in an endless
cycle; then the best centre found is kept.
"""


def exact_circle(points: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Centre (...) and radius (...) of the smallest circle around each set of points (..., N)."""
    batch = as_batch(points)
    center, radius = _circles(batch.sets)
    return center.reshape(batch.shape), radius.reshape(batch.shape)


@compiled
def _circles(sets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre (S,) and radius (S,) of the smallest circle around each set (S, N)."""
    center = np.empty(len(sets), dtype=np.complex128)
    radius = np.empty(len(sets))
    for i, points in enumerate(sets):
        frame = find_frame(points, False, 0j)
        x, y = to_frame(points, frame)
        center[i] = point_from_frame(frame, *_smallest(x, y))
        radius[i] = circle_radius(points, center[i])
    return center, radius


@compiled
def circle_radius(points: np.ndarray, center: complex) -> float:
    """The largest distance of a set (N,) from the centre, rounded upward.

    The relative rounding error is at most 2 eps in a squared distance, hence eps in its root, and
    eps / 2 in the differences.
    """
    frame = find_frame(points, True, center)
    square = 0.0
    for p in points:
        x = (p.real * frame.shrink - frame.x) * frame.zoom
        y = (p.imag * frame.shrink - frame.y) * frame.zoom
        square = max(square, x * x + y * y)
    return rounded_up(length_from_frame(frame, math.sqrt(square) * (1.0 + 2.0 * EPS)))


@unchecked_kernel
def rounded_up(length: float) -> float:
    """The next larger number for a positive length, 0 for 0."""
    return np.nextafter(length, np.inf) if length > 0.0 else 0.0


@compiled
def _smallest(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """The centre (x, y) of the smallest circle around points (N,), (N,) of unit size."""
    first = _farthest(x, y, 0.0, 0.0)[0]
    basis = np.array([first, _farthest(x, y, x[first], y[first])[0], 0, 0])
    size = 2
    center_x = 0.5 * (x[basis[0]] + x[basis[1]])
    center_y = 0.5 * (y[basis[0]] + y[basis[1]])
    best, best_x, best_y = np.inf, center_x, center_y
    for _ in range(MAX_BASIS_EXCHANGES):
        point, square = _farthest(x, y, center_x, center_y)
        if square < best:
            best, best_x, best_y = square, center_x, center_y
        if square <= (1.0 + 4.0 * EPS) * _reach(x, y, basis[:size], center_x, center_y):
            break
        basis[size] = point
        center_x, center_y, size = _exchange(x, y, basis, size)
    return best_x, best_y


@unchecked_kernel
def _farthest(x: np.ndarray, y: np.ndarray, x0: float, y0: float) -> tuple[int, float]:
    """The index and the squared distance of the point farthest from (x0, y0)."""
    index, largest = 0, -1.0
    for i in range(x.size):
        square = (x[i] - x0) ** 2 + (y[i] - y0) ** 2
        if square > largest:
            index, largest = i, square
    return index, largest


@unchecked_kernel
def _reach(x: np.ndarray, y: np.ndarray, some: np.ndarray, x0: float, y0: float) -> float:
    """The largest squared distance from (x0, y0) of the points with indices ``some``."""
    largest = 0.0
    for i in some:
        largest = max(largest, (x[i] - x0) ** 2 + (y[i] - y0) ** 2)
    return largest


@compiled
def _exchange(
    x: np.ndarray, y: np.ndarray, basis: np.ndarray, size: int
) -> tuple[float, float, int]:
    """The smallest circle of basis[:size] and the entering point basis[size].

    The entering point and one or two others lie on this circle. Among the at most six circles of
    that kind, the one is chosen whose centre has the least maximal distance from the points; this
    choice needs no tolerance. The basis is rewritten in place; the centre (x, y) of the circle and
    the new size of the basis are returned.
    """
    group = basis[: size + 1].copy()
    p = group[size]
    best, best_x, best_y, new_size = np.inf, 0.0, 0.0, 2
    for i in range(size):
        for j in range(i, size):
            a, b = group[i], group[j]
            if i == j:
                center_x, center_y = 0.5 * (x[p] + x[a]), 0.5 * (y[p] + y[a])
            else:
                ax, ay, bx, by = x[a] - x[p], y[a] - y[p], x[b] - x[p], y[b] - y[p]
                double_area = ax * by - ay * bx
                if double_area == 0.0:
                    continue
                aa, bb = ax * ax + ay * ay, bx * bx + by * by
                center_x = x[p] + 0.5 * (by * aa - ay * bb) / double_area
                center_y = y[p] + 0.5 * (ax * bb - bx * aa) / double_area
            square = _reach(x, y, group, center_x, center_y)
            if square < best:
                best, best_x, best_y = square, center_x, center_y
                basis[0], basis[1], basis[2] = p, a, b
                new_size = 2 if i == j else 3
    return best_x, best_y, new_size
