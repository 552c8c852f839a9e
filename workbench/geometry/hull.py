"""The convex hull of one set of points: Andrew's monotone chain, O(N log N).

Orientation is decided in double precision where its error bound makes that certain (Shewchuk,
"Adaptive precision floating-point arithmetic and fast robust geometric predicates", 1997) and in
doubled precision elsewhere. Rounding can still lose a vertex within a few ulp of an edge, which
changes a width by a few ulp. Containment does not depend on the hull, because every radius is
computed over all points at the end.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import EPS
from workbench._core.compiled import compiled, unchecked_kernel
from workbench.errors import InputError
from workbench.geometry.points import as_points, find_frame, to_frame

THINNED_ABOVE = 200
"""Larger sets lose the points inside an octagon before they are sorted."""
SPLITTER = 134217729.0
"""2^27 + 1, which splits a double-precision number into two halves (Dekker)."""


def convex_hull(points: ArrayLike) -> np.ndarray:
    """The vertices (M,) of the convex hull of one set (N,), in counter-clockwise order.

    No vertex lies on the line between its neighbours.
    """
    values = as_points(points)
    if values.ndim != 1:
        raise InputError(f"points of shape {values.shape}: a hull is of one set (N,)")
    return values[hull_indices(*to_frame(values, find_frame(values, False, 0j)))]


@compiled
def hull_indices(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Indices (M,) of the hull's vertices, in counter-clockwise order.

    The first vertex is the lowest of the leftmost points. The points have coordinates (N,), (N,) of
    unit size (see `find_frame`). Coincident points give one vertex.
    """
    # loops instead of NumPy's indexing, joining and sorting, which take the longest to compile
    kept = np.empty(x.size, dtype=np.int64)
    size = x.size
    if size > THINNED_ABOVE:
        size = _outside_octagon(x, y, kept)
    else:
        for k in range(size):
            kept[k] = k
    lowest, highest = np.empty(size, dtype=np.int64), np.empty(size, dtype=np.int64)
    _merge_sort(x, kept, lowest, size)
    # only the lowest and the highest point on a vertical line can be vertices
    columns = np.int64(0)  # a literal 0 would make Numba compile everything anew
    for k in range(size):
        i = kept[k]
        if columns and x[i] == x[lowest[columns - 1]]:
            if y[i] < y[lowest[columns - 1]]:
                lowest[columns - 1] = i
            if y[i] > y[highest[columns - 1]]:
                highest[columns - 1] = i
        else:
            lowest[columns] = highest[columns] = i
            columns += 1
    for k in range(columns // 2):
        highest[k], highest[columns - 1 - k] = highest[columns - 1 - k], highest[k]
    lower = _keep_chain(x, y, lowest, columns)
    upper = _keep_chain(x, y, highest, columns)
    # the chains meet in a point, or in a vertical edge, at the left and at the right
    last, first = lower, upper
    if lower > 1 and lowest[lower - 1] == highest[0]:
        last -= 1
    if highest[upper - 1] == lowest[0]:
        first -= 1
    vertices = np.empty(last + first, dtype=np.int64)
    for k in range(last):
        vertices[k] = lowest[k]
    for k in range(first):
        vertices[last + k] = highest[k]
    return vertices


@unchecked_kernel
def _merge_sort(x: np.ndarray, order: np.ndarray, spare: np.ndarray, size: int) -> None:
    """Sort the first ``size`` indices of ``order`` by x; equal ones stay as they are."""
    step = 1
    while step < size:
        for start in range(0, size, 2 * step):
            middle, end = min(start + step, size), min(start + 2 * step, size)
            i, j = start, middle
            for k in range(start, end):
                if i < middle and (j == end or x[order[i]] <= x[order[j]]):
                    spare[k] = order[i]
                    i += 1
                else:
                    spare[k] = order[j]
                    j += 1
        for k in range(size):
            order[k] = spare[k]
        step *= 2


@unchecked_kernel
def _keep_chain(x: np.ndarray, y: np.ndarray, order: np.ndarray, count: int) -> int:
    """From a sequence that is strictly monotone in x, keep the points of a chain with left turns
    only.

    The sequence is the first ``count`` of ``order``. Returns how many are kept, in their places.
    """
    size = 0
    for k in range(count):
        i = order[k]
        while size > 1:
            a, b = order[size - 2], order[size - 1]
            if cross(x, y, a, b, a, i) > 0.0:
                break
            size -= 1
        order[size] = i
        size += 1
    return size


@compiled
def _outside_octagon(x: np.ndarray, y: np.ndarray, kept: np.ndarray) -> int:
    """Number of points outside, on or just inside the octagon of the extreme points.

    ``kept`` (N,) receives their indices. The octagon's corners are the extreme points in eight
    directions (Akl and Toussaint, "A fast convex hull algorithm", 1978, with four more directions).
    Points inside it cannot be vertices of the hull.
    """
    corner = np.empty(9, dtype=np.int64)
    value, normal_x, normal_y, offset = np.empty(8), np.empty(8), np.empty(8), np.empty(8)
    for k in range(8):
        corner[k], value[k] = 0, -np.inf
        normal_x[k], normal_y[k], offset[k] = 0.0, 0.0, 1.0
    for i in range(x.size):
        a, b = x[i], y[i]
        plus, minus = a + b, a - b
        if a > value[0]:
            value[0], corner[0] = a, i
        if plus > value[1]:
            value[1], corner[1] = plus, i
        if b > value[2]:
            value[2], corner[2] = b, i
        if -minus > value[3]:
            value[3], corner[3] = -minus, i
        if -a > value[4]:
            value[4], corner[4] = -a, i
        if -plus > value[5]:
            value[5], corner[5] = -plus, i
        if -b > value[6]:
            value[6], corner[6] = -b, i
        if minus > value[7]:
            value[7], corner[7] = minus, i
    corner[8] = corner[0]
    # inside: normal . p < offset for all edges, minus a margin for rounding (|p| <= sqrt 2)
    for k in range(8):
        i, j = corner[k], corner[k + 1]
        if i != j:
            normal_x[k], normal_y[k] = y[j] - y[i], x[i] - x[j]
            margin = 8.0 * EPS * (abs(normal_x[k]) + abs(normal_y[k]))
            offset[k] = normal_x[k] * x[i] + normal_y[k] * y[i] - margin
    size = 0
    for i in range(x.size):
        for k in range(8):
            if normal_x[k] * x[i] + normal_y[k] * y[i] >= offset[k]:
                kept[size] = i
                size += 1
                break
    if size == 0:  # all points coincide: the octagon has no edge
        kept[0], size = corner[0], 1
    return size


@unchecked_kernel
def cross(x: np.ndarray, y: np.ndarray, a: int, b: int, c: int, d: int) -> float:
    """The cross product (b - a) x (d - c) of the points with indices a to d, its sign correct."""
    ux, uy, vx, vy = x[b] - x[a], y[b] - y[a], x[d] - x[c], y[d] - y[c]
    left, right = ux * vy, uy * vx
    if abs(left - right) > 2.0 * EPS * (abs(left) + abs(right)):
        return left - right
    high, low = _product(ux, vy)
    other_high, other_low = _product(uy, vx)
    tails = (ux * _difference_error(y[d], y[c]) + vy * _difference_error(x[b], x[a])) - (
        uy * _difference_error(x[d], x[c]) + vx * _difference_error(y[b], y[a])
    )
    return (high - other_high) + ((low - other_low) + tails)


@unchecked_kernel
def _difference_error(a: float, b: float) -> float:
    """Rounding error of a - b: the exact difference minus the rounded one (Knuth)."""
    difference = a - b
    part = a - difference
    return (a - (difference + part)) + (part - b)


@unchecked_kernel
def _product(a: float, b: float) -> tuple[float, float]:
    """Rounded value of a b and its rounding error; their sum is exact (Dekker)."""
    value = a * b
    c, d = SPLITTER * a, SPLITTER * b
    a_high, b_high = c - (c - a), d - (d - b)
    a_low, b_low = a - a_high, b - b_high
    lost = a_low * b_low - (((value - a_high * b_high) - a_low * b_high) - a_high * b_low)
    return value, lost
