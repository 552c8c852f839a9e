"""The procedures of the thesis for circles and stadiums, as printed (sections 5.3.1, 5.4.1, 5.4.2).

They serve for comparison with the exact answers. Where the text is ambiguous, it is read as
follows:

* 5.3.1 "geometric center": the mean of the points. An angle is acute if it is less than a right
  angle; if two angles are not, the one at P_1 is treated first.
* 5.4.2, first candidate: a side of the polygon and its mirror image in the given centre; valid if
  all vertices lie between the two.
* 5.4.2, second candidate: "all the median points of the polygon" are the midpoints of its sides,
  or those of all pairs of its vertices, which the optimum requires. In figure 5.9, a triangle, they
  are the same.
* A set of coincident points has no sides, so the stadium's procedures have no candidate.

Radius and half-length of the chosen direction are those of the exact kernel: with a given angle
(5.4.3, "a trivial task") the two methods are the same.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import EPS
from workbench.geometry.exact_circle import circle_radius
from workbench.geometry.exact_stadium import exact_stadium
from workbench.geometry.hull import hull_indices
from workbench.geometry.points import (
    as_batch,
    canonical_angle,
    find_frame,
    point_from_frame,
    to_frame,
)

Medians = Literal["sides", "pairs"]
"""Which midpoints are the median points of a polygon: those of its sides or of all pairs of
vertices.
"""
BETWEEN_SLACK = 64.0 * EPS
"""Largest distance, in units of the set's size, of a vertex outside the strip of a candidate; it
allows for rounding only.
"""


def thesis_circle(points: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Centre (...) and radius (...) of the circles of 5.3.1; NaN if the loop does not end."""
    batch = as_batch(points)
    center = np.empty(len(batch.sets), dtype=np.complex128)
    radius = np.empty(len(batch.sets))
    for i, points_ in enumerate(batch.sets):
        frame = find_frame(points_, False, 0j)
        x, y = to_frame(points_, frame)
        found = _shrunk_center(x + 1j * y)
        center[i] = point_from_frame(frame, found.real, found.imag)
        radius[i] = circle_radius(points_, center[i]) if np.isfinite(found) else np.nan
    return center.reshape(batch.shape), radius.reshape(batch.shape)


def thesis_stadium(
    points: ArrayLike,
    center: ArrayLike | None = None,
    angle: ArrayLike | None = None,
    *,
    medians: Medians = "sides",
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Centre, radius, half-length and angle, each (...), of the stadiums of 5.4.1 and 5.4.2.

    Without a valid candidate radius, half-length and angle are NaN, and so is a free centre.
    medians: the midpoints that 5.4.2 tries with a given centre, those of sides or of all pairs of
    vertices.
    """
    if angle is not None:
        return exact_stadium(points, center, angle)
    batch = as_batch(points, center)
    chosen = np.empty(batch.which.size)
    for i, which in enumerate(batch.which):
        set_ = batch.sets[which]
        frame = find_frame(set_, center is not None, batch.center[i])
        x, y = to_frame(set_, frame)
        vertices = hull_indices(x, y)
        polygon = x[vertices] + 1j * y[vertices]
        candidates = _first_set(polygon) if center is None else _second_set(polygon, medians)
        chosen[i] = min(candidates, default=(np.inf, np.nan))[1]
    chosen = chosen.reshape(batch.shape)
    failed = np.isnan(chosen)
    found = exact_stadium(points, center, np.where(failed, 0.0, chosen))
    middle = np.where(failed, np.nan, found[0]) if center is None else found[0]
    radius, half_length, direction = (np.where(failed, np.nan, part) for part in found[1:])
    return middle, radius, half_length, direction


def _shrunk_center(points: np.ndarray) -> complex:
    """Final centre of the procedure of 5.3.1 for a set (N,) of unit size; NaN without an end."""
    center = points.mean()
    first = points[np.argmax(np.abs(points - center))]
    if np.all(points == first):
        return complex(first)
    # from the centre towards P_1: a point q comes to lie on the circle at this distance from P_1
    inward = (center - first) / abs(center - first)
    others = points[points != first]
    offset = others - first
    distance = np.abs(offset) ** 2 / (2.0 * (offset * inward.conjugate()).real)
    met = np.argmax(distance)
    second, center = others[met], first + distance[met] * inward
    # without rounding each turn discards a point for good, so the loop ends
    for _ in range(10 * points.size):
        middle, half = 0.5 * (first + second), 0.5 * abs(second - first)
        normal = 1j * (second - first) / (2.0 * half)
        height = ((center - middle) * normal.conjugate()).real
        if height < 0.0:
            normal, height = -normal, -height
        # along the bisector: only points on the centre's side of P_1 P_2 can be met
        aside = ((points - middle) * normal.conjugate()).real
        others = points[(aside > 0.0) & (points != first) & (points != second)]
        aside = ((others - middle) * normal.conjugate()).real
        level = (np.abs(others - middle) ** 2 - half**2) / (2.0 * aside)
        if not np.any(level > 0.0):
            return complex(middle)
        met = np.argmax(level)
        third, center = others[met], middle + min(level[met], height) * normal
        if ((second - first) * (third - first).conjugate()).real <= 0.0:
            first = third
        elif ((first - second) * (third - second).conjugate()).real <= 0.0:
            second = third
        else:
            return complex(center)
    return complex(np.nan, np.nan)


def _sides(polygon: np.ndarray) -> Iterator[tuple[complex, complex]]:
    """Start and end of each side of a polygon (M,); none for a single point."""
    if polygon.size > 1:
        yield from zip(polygon, np.roll(polygon, -1), strict=True)


def _first_set(polygon: np.ndarray) -> Iterator[tuple[float, float]]:
    """5.4.1: (width, angle) of every side whose most distant point is valid."""
    for start, end in _sides(polygon):
        height = _heights(polygon - start, end - start)
        width = np.abs(height).max()
        if height.min() >= -BETWEEN_SLACK:
            yield width, float(canonical_angle(np.angle(end - start)))


def _second_set(polygon: np.ndarray, medians: Medians) -> Iterator[tuple[float, float]]:
    """5.4.2: (radius, angle) of the valid candidates of both cases; the origin is the centre."""
    for start, end in _sides(polygon):
        distance = np.abs(_heights(start, end - start))
        if np.abs(_heights(polygon, end - start)).max() <= distance + BETWEEN_SLACK:
            yield float(distance), float(canonical_angle(np.angle(end - start)))
    for start, end in _sides(polygon) if medians == "sides" else combinations(polygon, 2):
        middle = 0.5 * (start + end)
        if middle != 0.0:
            distance = np.abs(_heights(start, middle))
            if np.abs(_heights(polygon, middle)).max() <= distance + BETWEEN_SLACK:
                yield float(distance), float(canonical_angle(np.angle(middle)))


def _heights(points: np.ndarray | complex, along: complex) -> np.ndarray:
    """Signed distances of points from the line through the origin along a direction."""
    return np.imag(points * np.conj(along)) / np.abs(along)
