"""The narrowest stadium around every set of points, exact up to rounding.

A stadium is all points within `radius` of a segment with the given centre, half-length and
direction. Narrowest is least radius, and among those least half-length. In coordinates t along
and h across the direction:

* the radius is half the width of the set across the direction, with the axis in the middle; with
  a given centre it is the largest |h - h_c|, half the width of the set and its mirror image in
  the centre together;
* the least width over all directions is attained in the direction of an edge of the convex hull,
  so only these directions need to be tried;
* a point (t, h) is within the radius of the segment [a, b] of the axis if a <= t + s and
  b >= t - s, s = sqrt(radius^2 - h^2).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import EPS
from workbench._core.compiled import compiled, unchecked_kernel
from workbench.geometry.exact_circle import circle_radius, rounded_up
from workbench.geometry.hull import cross, hull_indices
from workbench.geometry.points import (
    Frame,
    as_batch,
    find_frame,
    length_from_frame,
    length_to_frame,
    point_from_frame,
    selected,
    to_frame,
)

WIDTH_TIE = 64.0 * EPS
"""Relative difference up to which widths count as equal; half-length then decides between edges."""
MAX_POINT_VISITS = 2**22
"""Largest number of point visits in the comparison of half-lengths for one set."""
MIN_EDGES_COMPARED = 4
"""Number of edges of equal width whose half-lengths are compared, however many points they take."""


def exact_stadium(
    points: ArrayLike, center: ArrayLike | None = None, angle: ArrayLike | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Centre, radius, half-length and angle [rad], each (...), of the narrowest stadiums.

    The sets are (..., N); a given centre or angle broadcasts with the leading axes. Angles are in
    [0, pi). A set of coincident points gets angle 0 unless an angle is given.
    """
    batch = as_batch(points, center, angle)
    answers = _stadiums(
        batch.sets, batch.which, center is not None, batch.center, angle is not None, batch.angle
    )
    found = tuple(answer.reshape(batch.shape) for answer in answers)
    return found[0], found[1], found[2], found[3]


@compiled
def _stadiums(
    sets: np.ndarray,
    which: np.ndarray,
    centered: bool,
    given_center: np.ndarray,
    directed: bool,
    given_angle: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Centre, radius, half-length and angle, each (A,), of A stadiums around the sets (S, N).

    ``which`` (A,) holds the index of the set of each stadium; ``centered`` and ``directed`` say
    whether the given centres (A,) and angles (A,) are used.
    """
    center = given_center.copy()
    angle = given_angle.copy()
    radius, half_length = np.empty(which.size), np.empty(which.size)
    for i, chosen in enumerate(which):
        points = sets[chosen]
        # Several directions may be asked for one set: quantities that they share are computed once.
        if i == 0 or not directed or chosen != which[i - 1] or center[i] != given_center[i - 1]:
            frame = find_frame(points, centered, center[i])
            x, y = to_frame(points, frame)
        if not directed:
            vertices = hull_indices(x, y)
            x, y = selected(x, vertices), selected(y, vertices)
            angle[i] = _narrowest_angle(x, y, centered)
        c, s = math.cos(angle[i]), math.sin(angle[i])
        along, across, _, half = _narrowest(x, y, c, s, centered)
        if not centered:
            center[i] = point_from_frame(frame, c * along - s * across, s * along + c * across)
        half_length[i] = length_from_frame(frame, half)
        if centered and directed and half_length[i] > 0.0:
            radius[i] = _radius(x, y, frame, half_length[i], c, s)
        else:
            radius[i] = stadium_radius(points, center[i], half_length[i], angle[i])
    return center, radius, half_length, angle


@compiled
def stadium_radius(points: np.ndarray, center: complex, half_length: float, angle: float) -> float:
    """The largest distance of a set (N,) from the segment, rounded upward.

    The rotation into t and h has a rounding error of at most 2.5 eps of its terms: differences and
    products are accurate to eps / 2, sine and cosine to eps.
    """
    if half_length == 0.0:
        return circle_radius(points, center)
    frame = find_frame(points, True, center)
    x, y = to_frame(points, frame)
    return _radius(x, y, frame, half_length, math.cos(angle), math.sin(angle))


@unchecked_kernel
def _radius(
    x: np.ndarray, y: np.ndarray, frame: Frame, half_length: float, c: float, s: float
) -> float:
    """As `stadium_radius`, for a set given by its coordinates (N,), (N,) relative to the centre.

    The angle is given by its cosine c and sine s.
    """
    half = length_to_frame(frame, half_length)
    square = 0.0
    for i in range(x.size):
        beyond = abs(c * x[i] + s * y[i]) + 2.5 * EPS * (abs(c * x[i]) + abs(s * y[i])) - half
        aside = abs(c * y[i] - s * x[i]) + 2.5 * EPS * (abs(c * y[i]) + abs(s * x[i]))
        square = max(square, aside * aside + max(beyond, 0.0) ** 2)
    return rounded_up(length_from_frame(frame, math.sqrt(square) * (1.0 + 4.0 * EPS)))


@unchecked_kernel
def _narrowest(
    x: np.ndarray, y: np.ndarray, c: float, s: float, centered: bool
) -> tuple[float, float, float, float]:
    """The narrowest stadium of one set (N,), (N,) in a direction, by its cosine c and sine s.

    Returns the coordinates of the centre along and across the direction, the radius and the
    half-length. With `centered` the centre is the origin.
    """
    low, high = np.inf, -np.inf
    for i in range(x.size):
        h = c * y[i] - s * x[i]
        low, high = min(low, h), max(high, h)
    across = 0.0 if centered else 0.5 * (low + high)
    radius = max(high - across, across - low)
    start, end = np.inf, -np.inf
    for i in range(x.size):
        t, h = c * x[i] + s * y[i], c * y[i] - s * x[i] - across
        slack = math.sqrt(max((radius - h) * (radius + h), 0.0))
        start, end = min(start, t + slack), max(end, t - slack)
    if centered:
        return 0.0, 0.0, radius, max(0.0, max(end, -start))
    return 0.5 * (start + end), across, radius, max(0.0, 0.5 * (end - start))


@compiled
def _narrowest_angle(x: np.ndarray, y: np.ndarray, centered: bool) -> float:
    """The angle [rad] of the narrowest stadium around a hull of vertices (M,), (M,).

    The vertices are in counter-clockwise order. Where several edges give the least width, the one
    with the least half-length is taken.
    """
    edges_x, edges_y = x, y
    if centered:
        edges_x, edges_y = _with_mirrored(x), _with_mirrored(y)
        vertices = hull_indices(edges_x, edges_y)
        edges_x, edges_y = selected(edges_x, vertices), selected(edges_y, vertices)
    if edges_x.size == 1:
        return 0.0
    width = _widths(edges_x, edges_y)
    least = np.inf
    for i in range(width.size):
        least = min(least, width[i])
    limit = (1.0 + WIDTH_TIE) * least
    left_to_try = max(MIN_EDGES_COMPARED, MAX_POINT_VISITS // x.size)
    angle, shortest = 0.0, np.inf
    for i in range(width.size):
        if width[i] <= limit and left_to_try > 0:
            left_to_try -= 1
            j = (i + 1) % width.size
            tried = _direction(edges_x[j] - edges_x[i], edges_y[j] - edges_y[i])
            c, s = math.cos(tried), math.sin(tried)
            half_length = _narrowest(x, y, c, s, centered)[3]
            if half_length < shortest:
                angle, shortest = tried, half_length
    return angle


@compiled
def _with_mirrored(x: np.ndarray) -> np.ndarray:
    """Coordinates (2 N,) of points (N,) and of their mirror images in the origin."""
    both = np.empty(2 * x.size)
    for i in range(x.size):
        both[i], both[x.size + i] = x[i], -x[i]
    return both


@compiled
def _widths(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The width (M,) of a hull (M,), (M,), M >= 2, across each of its edges.

    The method is rotating calipers (Shamos, "Computational geometry", 1978).
    """
    width = np.empty(x.size)
    far = np.int64(1)  # a literal 1 would make Numba compile everything anew
    for i in range(x.size):
        j = (i + 1) % x.size
        # the opposite vertex advances as long as the next one is farther from the edge
        for _ in range(x.size):
            k = (far + 1) % x.size
            if cross(x, y, i, j, far, k) <= 0.0:
                break
            far = k
        width[i] = cross(x, y, i, j, i, far) / math.hypot(x[j] - x[i], y[j] - y[i])
    return width


@unchecked_kernel
def _direction(x: float, y: float) -> float:
    """The angle in [0, pi) of a line along the vector (x, y)."""
    angle = math.atan2(y, x)
    if angle < 0.0:
        angle += math.pi
    return angle if angle < math.pi else 0.0
