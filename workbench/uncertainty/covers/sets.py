"""Sets of relative or absolute deviations from a nominal, and the shapes around them.

This is the second set of the thesis (sections 5.3.2 and 5.4.2) in the frame of the nominal. The
deviations of plants p are p / G - 1 for a multiplicative model and p - G for an additive one; the
centre is 0, and radius, half-length and angle are in the units of the weights.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.fitting.samples import as_count
from workbench.geometry import Circle, Stadium, narrowest_stadium, smallest_circle
from workbench.geometry.exact_stadium import exact_stadium
from workbench.geometry.hull import convex_hull
from workbench.uncertainty.responses.plants import Responses, filled

CoverForm = Literal["multiplicative", "additive"]
"""Whether a set around a nominal is relative to it, or in the plant's units."""

ZERO_NOMINAL = 1e-9
"""Size of a nominal, relative to its set's largest point, below which it counts as zero. Relative
deviations would be above 1e9. Half or double moves this border.
"""
MAX_LEFT_OUT = 4
"""Largest number of points left out at each frequency; the search grows fourfold with each. Four
take 256 times as long as none. Half refuses what takes a sixteenth of that; double would take
65,536 times as long as none.
"""
DIRECTIONS = 16
"""Larger point sets are reduced to the outermost point in each of this many directions. The
outermost points lie within 2 % of the hull's. With half of them 8 %; double takes longer. All
points count again when radii are computed.
"""
SUPPORT_DISTANCE = 1e-9
"""Distance from the boundary, relative to the radius, within which a point supports the shape. It
is far above the rounding of radii, 1e-12. Half or double: other points count as supports; no set
changes.
"""


def deviations(
    points: ComplexArray, nominal: ComplexArray, form: CoverForm, responses: Responses
) -> ComplexArray:
    """Deviations (F, N) of point sets (F, N) from a nominal response (F,).

    Raises
    ------
    InputError
        The nominal passes through zero, where relative deviations are undefined; the message says
        at which frequency.
    """
    if form == "additive":
        difference: ComplexArray = points - nominal[:, None]
        return difference
    vanishing = np.abs(nominal) <= ZERO_NOMINAL * np.abs(points).max(axis=1)
    if vanishing.any():
        raise InputError(
            f"the nominal passes through zero at {responses.place(int(vanishing.argmax()))}: "
            'relative weights are undefined there, ask for form="additive"'
        )
    ratio: ComplexArray = points / nominal[:, None] - 1
    return ratio


def circles_about_nominal(away: ComplexArray) -> Stadium:
    """Smallest circles centred on the nominal around deviations (F, N); half-lengths are 0."""
    zero = np.zeros(len(away))
    return Stadium(zero.astype(complex), np.abs(away).max(axis=1), zero, zero)


def stadiums_about_nominal(away: ComplexArray, angle: RealArray | None = None) -> Stadium:
    """Narrowest stadiums centred on the nominal around deviations (..., N), globally optimal.

    Angles [rad] are broadcast against the sets; None: free.
    """
    return Stadium(*exact_stadium(away, 0.0, angle))


def kept(responses: Responses, leave_out: int, kind: Literal["circle", "stadium"]) -> ComplexArray:
    """Point sets (F, N) without the ``leave_out`` points that enlarge their first set most.

    A kept point replaces each point that is left out. For circles in general position the choice is
    optimal: a smaller circle must leave out one of the points that support the present one, so a
    tree of supports is searched, with at most 3 branches a level (the LP-type problem with
    violations of Matousek, 1995). For stadiums the same tree is a heuristic, because the narrowest
    width may have more supports.

    Raises
    ------
    InputError
        ``leave_out`` is more than `MAX_LEFT_OUT`, or leaves fewer than two plants at a frequency.
    """
    if as_count("leave_out", leave_out) > MAX_LEFT_OUT:
        raise InputError(
            f"leave_out is {leave_out}; it may be {MAX_LEFT_OUT} at most, "
            "since the search grows fourfold with each"
        )
    count = responses.present.sum(axis=1)
    if count.min() - leave_out < 2:
        raise InputError(
            f"leaving out {leave_out} of the {count.min()} plants at "
            f"{responses.place(int(count.argmin()))} leaves no spread: two or more must stay"
        )
    measure = _circle_support if kind == "circle" else _stadium_support
    return _searched(responses.values, responses.present, leave_out, measure)[0]


def corners(points: ComplexArray) -> ComplexArray:
    """Vertices (F, H) of the convex hulls of the point sets (F, N).

    Smaller hulls are filled up to the largest H with repeated vertices. Circles and stadiums are
    convex, so if they contain the vertices, they contain the sets.
    """
    hulls = [convex_hull(row) for row in points]
    most = max(hull.size for hull in hulls)
    return np.stack([np.resize(hull, most) for hull in hulls])


Support = Callable[[ComplexArray], tuple[RealArray, RealArray, int]]
"""Function: points (F, N) -> radius (F,) of the first set, distance (F, N) of the points from its
boundary, and largest number of points that can support it.
"""


def _searched(
    values: ComplexArray, present: np.ndarray, leave_out: int, measure: Support
) -> tuple[ComplexArray, RealArray]:
    """Point sets (F, N) without the points whose omission helps most, and the radii (F,) of their
    first sets.
    """
    points = filled(values, present)
    radius, room, count = measure(points)
    if leave_out == 0:
        return points, radius
    best, least = points, np.full(len(points), np.inf)
    for branch in _nearest(points, np.where(present, room, np.inf), radius, count):
        fewer = present.copy()
        fewer[np.arange(len(points)), branch] = False
        found, size = _searched(values, fewer, leave_out - 1, measure)
        better = size < least
        best = np.where(better[:, None], found, best)
        least = np.where(better, size, least)
    return best, least


def _circle_support(points: ComplexArray) -> tuple[RealArray, RealArray, int]:
    """`Support` function of the smallest circles."""
    circle: Circle = smallest_circle(points)
    return circle.radius, circle.radius[:, None] - np.abs(points - circle.center[:, None]), 3


def _stadium_support(points: ComplexArray) -> tuple[RealArray, RealArray, int]:
    """`Support` function of the narrowest stadiums, from the distance to their straight sides."""
    stadium = narrowest_stadium(points)
    away = (points - stadium.center[:, None]) * np.exp(-1j * stadium.angle[:, None])
    return stadium.radius, stadium.radius[:, None] - np.abs(away.imag), 4


def _nearest(
    points: ComplexArray, room: RealArray, radius: RealArray, count: int
) -> list[np.ndarray]:
    """Indices of the distinct points that touch the boundary: up to ``count`` arrays (F,).

    If fewer points touch it, the first index is repeated.
    """
    rows, found = np.arange(len(points)), [room.argmin(axis=1)]
    for _ in range(min(count, points.shape[1]) - 1):
        room = np.where(points == points[rows, found[-1]][:, None], np.inf, room)
        nearest = room.argmin(axis=1)
        touching = room[rows, nearest] <= SUPPORT_DISTANCE * radius
        found.append(np.where(touching, nearest, found[0]))
    return found


def outermost(points: ComplexArray) -> ComplexArray:
    """The outermost points (F, DIRECTIONS) of large sets (F, N), one in each of the directions."""
    if points.shape[1] <= DIRECTIONS:
        return points
    away = points - points.mean(axis=1, keepdims=True)
    turn = np.exp(-2j * np.pi * np.arange(DIRECTIONS) / DIRECTIONS)
    farthest = np.stack([(away * t).real.argmax(axis=1) for t in turn], axis=1)
    return np.take_along_axis(points, farthest, axis=1)
