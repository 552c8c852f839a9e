"""Sets of relative or absolute deviations from a nominal, and the shapes around them.

The second set of the thesis (sections 5.3.2 and 5.4.2) in the frame of the nominal: deviations are
p / G - 1 for a multiplicative model and p - G for an additive one, the centre is 0, and radius,
half-length and angle are those of the weights themselves.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from workbench.errors import InputError
from workbench.geometry import Circle, Stadium, narrowest_stadium, smallest_circle
from workbench.geometry.exact_stadium import exact_stadium
from workbench.uncertainty.responses import Complex, Real, Responses

Form = Literal["multiplicative", "additive"]

VANISHING = 1e-9
"""Size of a nominal, relative to its set's largest point, that counts as passing through zero."""
MOST_LEFT_OUT = 4
TOUCHING = 1e-9
"""Relative distance from a boundary within which a point supports it."""


def deviations(points: Complex, nominal: Complex, form: Form, responses: Responses) -> Complex:
    """Deviations (F, N) of point sets (F, N) from a nominal response (F,).

    Raises
    ------
    InputError
        The nominal passes through zero, where a relative deviation has no meaning; it says where.
    """
    if form == "additive":
        difference: Complex = points - nominal[:, None]
        return difference
    vanishing = np.abs(nominal) <= VANISHING * np.abs(points).max(axis=1)
    if vanishing.any():
        raise InputError(
            f"the nominal passes through zero at {responses.place(int(vanishing.argmax()))}: "
            'relative weights are undefined there, ask for form="additive"'
        )
    ratio: Complex = points / nominal[:, None] - 1
    return ratio


def circles_about_nominal(away: Complex) -> Stadium:
    """Smallest circles centred on the nominal around deviations (F, N); half-lengths are 0."""
    zero = np.zeros(len(away))
    return Stadium(zero.astype(complex), np.abs(away).max(axis=1), zero, zero)


def stadiums_about_nominal(away: Complex, angle: Real | None = None) -> Stadium:
    """Narrowest stadiums centred on the nominal around deviations (..., N), globally optimal.

    Angles [rad] are broadcast against the sets; None: free.
    """
    return Stadium(*exact_stadium(away, 0.0, angle))


def kept(points: Complex, leave_out: int, kind: Literal["circle", "stadium"]) -> Complex:
    """Point sets (F, N) without the ``leave_out`` points that cost their first set most.

    What is left out repeats a point that is kept. Of circles the choice is optimal: a smaller
    circle leaves out one of the points that support the present one, so a tree of supports is
    searched (at most 3 branches a level; the LP-type problem with violations of Matousek, 1995).
    Of stadiums the same tree is a heuristic: the narrowest width may have more supports.

    Raises
    ------
    InputError
        More points than the search can take, or than leave two plants.
    """
    if not 0 <= leave_out <= MOST_LEFT_OUT:
        raise InputError(
            f"leave_out is {leave_out}; it must be a whole number up to {MOST_LEFT_OUT}, "
            "since the search grows fourfold with each"
        )
    if points.shape[1] - leave_out < 2:
        raise InputError(f"leaving out {leave_out} of {points.shape[1]} plants leaves no spread")
    measure = _circle_support if kind == "circle" else _stadium_support
    return _searched(points, leave_out, measure)[0]


Support = Callable[[Complex], tuple[Real, np.ndarray]]
"""Radius (F,) of the first set, and indices (F, B) of points that support it."""


def _searched(points: Complex, leave_out: int, measure: Support) -> tuple[Complex, Real]:
    """The best sets with points left out, and their radii."""
    radius, support = measure(points)
    if leave_out == 0:
        return points, radius
    best, least = points, np.full(len(points), np.inf)
    rows = np.arange(len(points))
    for branch in support.T:
        # the point itself and every copy of it: a copy would keep it in the set
        gone = points == points[rows, branch][:, None]
        substitute = points[rows, np.argmin(gone, axis=1)]
        fewer = np.where(gone, substitute[:, None], points)
        found, size = _searched(fewer, leave_out - 1, measure)
        better = size < least
        best = np.where(better[:, None], found, best)
        least = np.where(better, size, least)
    return best, least


def _circle_support(points: Complex) -> tuple[Real, np.ndarray]:
    circle: Circle = smallest_circle(points)
    room = circle.radius[:, None] - np.abs(points - circle.center[:, None])
    return circle.radius, _nearest(points, room, circle.radius, 3)


def _stadium_support(points: Complex) -> tuple[Real, np.ndarray]:
    stadium = narrowest_stadium(points)
    away = (points - stadium.center[:, None]) * np.exp(-1j * stadium.angle[:, None])
    room = stadium.radius[:, None] - np.abs(away.imag)
    return stadium.radius, _nearest(points, room, stadium.radius, 4)


def _nearest(points: Complex, room: Real, radius: Real, count: int) -> np.ndarray:
    """Indices (F, count) of distinct points nearest to the boundary; those inside repeat."""
    order = np.argsort(room, axis=1, kind="stable")[:, : min(count, points.shape[1])]
    inside = np.take_along_axis(room, order, axis=1) > TOUCHING * radius[:, None]
    return np.where(inside, order[:, :1], order)
