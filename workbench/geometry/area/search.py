"""Search for the stadium of the smallest area around one set: angles on a grid, then refined.

For a given angle and radius the shortest stadium is found by bisection: its length is a convex
function of the place of its axis. The area is then a function of two numbers, angle and radius,
with many local minima. Angles are tried at the sides of the hull, along the pairs of its corners,
and on a grid; at each angle radii are tried from half the width to that of the smallest circle. The
best few minima are refined by golden sections, one inside the other. The search does not prove that
the best one is among them; that is left to the certificate's bound.
"""

from __future__ import annotations

import math

import numpy as np

from workbench._core.arrays import EPS
from workbench._core.compiled import compiled

GRID_ANGLES = 48
"""Number of angles on the grid, in addition to those of the hull."""
MAX_DIRECTIONS = 200
"""Largest number of hull sides, and of corner pairs, whose directions are tried."""
RADII = 28
"""Number of radii tried at each angle."""
LEAST_STEP = 1e-5
"""First step of those radii, relative to half the width."""
SAME_ANGLE = 16 * EPS
"""Angles [rad] that differ by no more than this count as one."""
FINER = 13
"""Number of angles on a second grid, between the two neighbours of a minimum."""
REFINED = 6
"""Number of local minima over the angle that are refined."""
WORTH_REFINING = 1.5
"""A minimum is refined only if its area is at most this multiple of the least one on the grid."""
AXIS_HALVINGS = 40
"""Number of bisections for the place of the axis, which leave 1e-12 of its interval."""
ANGLE_SECTIONS, RADIUS_SECTIONS = 52, 44
"""Numbers of golden sections of angle and radius, which leave 1e-11 and 1e-9 of an interval."""
SMALLEST = 1e-300
"""Added to keep a slope finite where the room beside a point is 0."""
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


def smallest_area(
    corners: np.ndarray, largest: float, centred: bool, angle: float | None
) -> tuple[complex, float, float]:
    """Centre, half-length and angle [rad] of the stadium of the smallest area that was found.

    Parameters
    ----------
    corners : complex, shape (M,)
        Corners of the hull of a set of unit size, in order; relative to the centre if that is
        given.
    largest
        Radius of the smallest circle around the corners, about the given centre if there is one.
    centred
        Whether the centre is 0.
    angle
        Direction of the stadium [rad]; None: free.
    """
    x, y = np.ascontiguousarray(corners.real), np.ascontiguousarray(corners.imag)
    if angle is None:
        angles = _directions(corners, centred)
        areas = _areas(x, y, centred, largest, angles)
        finer = [_angles_between(angles, k, FINER) for k in _minima(areas)]
        angles = np.unique(np.concatenate([angles, *finer]) % np.pi)
        areas = _areas(x, y, centred, largest, angles)
        best = angles[np.argmin(areas)], areas.min()
        for k in _minima(areas):
            low, high = _angles_between(angles, k, 2)
            best = min(
                best, _refined_angle(x, y, centred, largest, low, high), key=lambda each: each[1]
            )
        found = float(best[0] % np.pi)
    else:
        found = float(angle)
    radius = _over_radius(x, y, centred, largest, found)[1]
    length, along, across = _shortest(x, y, centred, found, radius)
    return complex(along, across) * np.exp(1j * found), length, found


def _directions(corners: np.ndarray, centred: bool) -> np.ndarray:
    """Angles [rad] in [0, pi), in order, at which the search begins."""
    sides = corners - np.roll(corners, -1)
    pairs = corners[:, None] + (corners if centred else -corners)
    rows, columns = np.triu_indices(len(corners), 0 if centred else 1)
    some = (each[:: -(-len(each) // MAX_DIRECTIONS) or 1] for each in (sides, pairs[rows, columns]))
    vectors = np.concatenate([*some])
    angles = np.concatenate(
        [np.angle(vectors[vectors != 0]), np.pi * np.arange(GRID_ANGLES) / GRID_ANGLES]
    )
    return np.unique(np.mod(angles, np.pi))


def _minima(areas: np.ndarray) -> np.ndarray:
    """Indices of the best local minima of areas (A,), with the angles taken as a closed circle."""
    local = (areas <= np.roll(areas, 1)) & (areas <= np.roll(areas, -1))
    worth = np.flatnonzero(local & (areas <= WORTH_REFINING * areas.min()))
    return worth[np.argsort(areas[worth])][:REFINED]


def _angles_between(angles: np.ndarray, k: int, count: int) -> np.ndarray:
    """``count`` angles [rad] from the neighbour before an index to the neighbour after it.

    Neighbours that differ by rounding only are skipped: there is no room for a minimum between
    them.
    """
    away = np.mod(angles - angles[k] + np.pi / 2, np.pi) - np.pi / 2
    before = away[away < -SAME_ANGLE].max(initial=-np.pi / 2)
    after = away[away > SAME_ANGLE].min(initial=np.pi / 2)
    return np.asarray(angles[k] + np.linspace(before, after, count))


@compiled
def _areas(
    x: np.ndarray, y: np.ndarray, centred: bool, largest: float, angles: np.ndarray
) -> np.ndarray:
    """Least areas at angles (A,) [rad]."""
    areas = np.empty(angles.size)
    for k in range(angles.size):
        areas[k] = _over_radius(x, y, centred, largest, angles[k])[0]
    return areas


@compiled
def _refined_angle(
    x: np.ndarray, y: np.ndarray, centred: bool, largest: float, low: float, high: float
) -> tuple[float, float]:
    """The angle [rad] of least area between two angles, by golden sections, and that area."""
    inner, outer = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_inner = _over_radius(x, y, centred, largest, inner)[0]
    at_outer = _over_radius(x, y, centred, largest, outer)[0]
    for _ in range(ANGLE_SECTIONS):
        if at_inner < at_outer:
            high, outer, at_outer = outer, inner, at_inner
            inner = high - GOLDEN * (high - low)
            at_inner = _over_radius(x, y, centred, largest, inner)[0]
        else:
            low, inner, at_inner = inner, outer, at_outer
            outer = low + GOLDEN * (high - low)
            at_outer = _over_radius(x, y, centred, largest, outer)[0]
    return (inner, at_inner) if at_inner < at_outer else (outer, at_outer)


@compiled
def _over_radius(
    x: np.ndarray, y: np.ndarray, centred: bool, largest: float, angle: float
) -> tuple[float, float]:
    """Least area at an angle [rad], and its radius."""
    c, s = math.cos(angle), math.sin(angle)
    low, high = np.inf, -np.inf
    for i in range(x.size):
        h = c * y[i] - s * x[i]
        low, high = min(low, h), max(high, h)
    narrow = max(high, -low) if centred else 0.5 * (high - low)
    room = largest - narrow
    step = max(LEAST_STEP * narrow, EPS * largest)
    if room <= step:
        return _area(x, y, centred, angle, narrow), narrow
    ratio = (room / step) ** (1.0 / (RADII - 2))
    radii, best, least = np.empty(RADII), 0, np.inf
    for k in range(RADII):
        radii[k] = narrow + (step * ratio ** (k - 1) if k > 0 else 0.0)
        area = _area(x, y, centred, angle, radii[k])
        if area < least:
            least, best = area, k
    radius = radii[best]
    start, end = radii[max(best - 1, 0)], radii[min(best + 1, RADII - 1)]
    inner, outer = end - GOLDEN * (end - start), start + GOLDEN * (end - start)
    at_inner = _area(x, y, centred, angle, inner)
    at_outer = _area(x, y, centred, angle, outer)
    for _ in range(RADIUS_SECTIONS):
        if at_inner < at_outer:
            end, outer, at_outer = outer, inner, at_inner
            inner = end - GOLDEN * (end - start)
            at_inner = _area(x, y, centred, angle, inner)
        else:
            start, inner, at_inner = inner, outer, at_outer
            outer = start + GOLDEN * (end - start)
            at_outer = _area(x, y, centred, angle, outer)
    if at_inner < least:
        least, radius = at_inner, inner
    if at_outer < least:
        least, radius = at_outer, outer
    return least, radius


@compiled
def _area(x: np.ndarray, y: np.ndarray, centred: bool, angle: float, radius: float) -> float:
    """Area of the shortest stadium of an angle [rad] and a radius."""
    length = _shortest(x, y, centred, angle, radius)[0]
    return math.pi * radius * radius + 4.0 * radius * length


@compiled
def _shortest(
    x: np.ndarray, y: np.ndarray, centred: bool, angle: float, radius: float
) -> tuple[float, float, float]:
    """Half-length of the shortest stadium, and its centre along and across the direction."""
    c, s = math.cos(angle), math.sin(angle)
    if centred:
        half = 0.0
        for i in range(x.size):
            t, h = c * x[i] + s * y[i], c * y[i] - s * x[i]
            half = max(half, abs(t) - math.sqrt(max((radius - h) * (radius + h), 0.0)))
        return half, 0.0, 0.0
    least, most = np.inf, -np.inf
    for i in range(x.size):
        h = c * y[i] - s * x[i]
        least, most = min(least, h), max(most, h)
    low, high = most - radius, least + radius
    if low > high:
        low = high = 0.5 * (low + high)
    shortest, middle, axis = np.inf, 0.0, low
    for k in range(AXIS_HALVINGS + 2):
        place = low if k == 0 else high if k == 1 else 0.5 * (low + high)
        start, end, slope_start, slope_end = np.inf, -np.inf, 0.0, 0.0
        for i in range(x.size):
            t, h = c * x[i] + s * y[i], c * y[i] - s * x[i] - place
            room = math.sqrt(max((radius - h) * (radius + h), 0.0))
            if t + room < start:
                start, slope_start = t + room, h / max(room, SMALLEST)
            if t - room > end:
                end, slope_end = t - room, h / max(room, SMALLEST)
        if end - start < shortest:
            shortest, middle, axis = end - start, 0.5 * (start + end), place
        if k >= 2:
            if slope_start + slope_end > 0.0:
                low = place
            else:
                high = place
            if high - low <= EPS * radius:
                break
    return max(0.5 * shortest, 0.0), middle, axis
