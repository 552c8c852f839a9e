"""Cuts for the bound on areas: what the contacts of a shortest stadium prove for all others.

The mathematics is that of `workbench.geometry.area.bound`.
"""

from __future__ import annotations

import math

import numpy as np

from workbench._core.arrays import EPS
from workbench._core.compiled import compiled

BISECTIONS = 60
"""Number of bisections for the place of a stadium's axis."""
SLANT = 1e-7
"""Least cosine of the angle between the direction and a normal that holds an end of the segment."""
CONTACTS = 5
"""Largest number of points in a cut."""


@compiled
def width_across(x: np.ndarray, y: np.ndarray, centred: bool, angle: float) -> tuple[float, float]:
    """The radius that the points farthest apart across an angle [rad] require, and its derivative.

    As a sinusoid of the angle, this bound holds at every other angle too.
    """
    c, s = math.cos(angle), math.sin(angle)
    top = bottom = 0
    most, least = -np.inf, np.inf
    for i in range(x.size):
        h = c * y[i] - s * x[i]
        if h > most:
            most, top = h, i
        if h < least:
            least, bottom = h, i
    if not centred:
        dx, dy = 0.5 * (x[top] - x[bottom]), 0.5 * (y[top] - y[bottom])
    elif most >= -least:
        dx, dy = x[top], y[top]
    else:
        dx, dy = -x[bottom], -y[bottom]
    return c * dy - s * dx, -(c * dx + s * dy)


@compiled
def shortest(
    x: np.ndarray,
    y: np.ndarray,
    centred: bool,
    angle: float,
    radius: float,
    normal: np.ndarray,
    point: np.ndarray,
) -> tuple[int, float, float]:
    """Number of contacts, radius and half-length of the shortest stadium of an angle [rad].

    The radius is the given one, or half the width if that is larger. The weight and the normal of
    each contact, along and across the direction, are written to ``normal`` (CONTACTS, 3), its index
    to ``point``.
    """
    c, s = math.cos(angle), math.sin(angle)
    most, least, top, bottom = -np.inf, np.inf, 0, 0
    for i in range(x.size):
        h = c * y[i] - s * x[i]
        if h > most:
            most, top = h, i
        if h < least:
            least, bottom = h, i
    if centred:
        radius = max(radius, max(most, -least))
        return _shortest_centred(x, y, c, s, radius, normal, point)
    radius = max(radius, 0.5 * (most - least))
    low, high = most - radius, least + radius
    for _ in range(BISECTIONS):
        axis = 0.5 * (low + high)
        right, left, _ = _ends(x, y, c, s, axis, radius)
        push = _slope(x, y, c, s, axis, radius, right) + _slope(x, y, c, s, axis, radius, left)
        if push > 0.0:
            low = axis
        else:
            high = axis
    right_low, left_low, length_low = _ends(x, y, c, s, low, radius)
    right_high, left_high, length_high = _ends(x, y, c, s, high, radius)
    axis = 0.5 * (low + high)
    up = _slope(x, y, c, s, axis, radius, right_low) + _slope(x, y, c, s, axis, radius, left_low)
    down = _slope(x, y, c, s, axis, radius, right_high)
    down += _slope(x, y, c, s, axis, radius, left_high)
    share = up / (up - down) if up > 0.0 > down else (0.0 if abs(up) < abs(down) else 1.0)
    balance = (1.0 - share) * up + share * down
    ends = (right_low, left_low, right_high, left_high)
    for k in range(4):
        slope = _slope(x, y, c, s, axis, radius, ends[k])
        point[k] = ends[k]
        normal[k, 0] = share if k >= 2 else 1.0 - share
        normal[k, 1] = 1.0 if k % 2 == 0 else -1.0
        normal[k, 2] = slope
        stretch = math.sqrt(1.0 + slope * slope)
        normal[k, 0] *= stretch
        normal[k, 1] /= stretch
        normal[k, 2] /= stretch
    # the remaining force is balanced by a point on a straight side
    point[4] = top if balance <= 0.0 else bottom
    normal[4, 0], normal[4, 1] = abs(balance), 0.0
    normal[4, 2] = 1.0 if balance <= 0.0 else -1.0
    return 5, radius, max(0.5 * min(length_low, length_high), 0.0)


@compiled
def _shortest_centred(
    x: np.ndarray,
    y: np.ndarray,
    c: float,
    s: float,
    radius: float,
    normal: np.ndarray,
    point: np.ndarray,
) -> tuple[int, float, float]:
    """As `shortest`, with the centre at 0: the one contact that requires the largest length."""
    longest, far = -np.inf, 0
    for i in range(x.size):
        t, h = c * x[i] + s * y[i], c * y[i] - s * x[i]
        length = abs(t) - math.sqrt(max((radius - h) * (radius + h), 0.0))
        if length > longest:
            longest, far = length, i
    slope = _slope(x, y, c, s, 0.0, radius, far)
    stretch = math.sqrt(1.0 + slope * slope)
    point[0], normal[0, 0] = far, 1.0
    normal[0, 1] = (1.0 if c * x[far] + s * y[far] >= 0.0 else -1.0) / stretch
    normal[0, 2] = slope / stretch
    return 1, radius, max(longest, 0.0)


@compiled
def _ends(
    x: np.ndarray, y: np.ndarray, c: float, s: float, axis: float, radius: float
) -> tuple[int, int, float]:
    """The points that touch the right and the left end of the segment, and its whole length."""
    right, left, last, first = 0, 0, -np.inf, np.inf
    for i in range(x.size):
        t, h = c * x[i] + s * y[i], c * y[i] - s * x[i] - axis
        room = math.sqrt(max((radius - h) * (radius + h), 0.0))
        if t - room > last:
            last, right = t - room, i
        if t + room < first:
            first, left = t + room, i
    return right, left, last - first


@compiled
def _slope(
    x: np.ndarray, y: np.ndarray, c: float, s: float, axis: float, radius: float, i: int
) -> float:
    """Ratio of the components across and along the direction of the normal at a point on a round
    end.
    """
    h = c * y[i] - s * x[i] - axis
    room = math.sqrt(max((radius - h) * (radius + h), 0.0))
    return h / max(room, SLANT * max(radius, EPS))


@compiled
def cut_of(
    x: np.ndarray,
    y: np.ndarray,
    normal: np.ndarray,
    point: np.ndarray,
    contacts: int,
    angle: float,
    half: float,
) -> tuple[float, float, float, float]:
    """The cut of some contacts at an angle [rad]: b, g, the derivative of g, and another b.

    The derivative is for vectors that turn. The other b is the largest within ``half`` of the angle
    for vectors that stay fixed.
    """
    c, s = math.cos(angle), math.sin(angle)
    cos_half, sin_half = math.cos(half), math.sin(half)
    total = along = staying = re = im = 0.0
    for k in range(contacts):
        weight, a, b = normal[k, 0], normal[k, 1], normal[k, 2]
        t = c * x[point[k]] + s * y[point[k]]
        h = c * y[point[k]] - s * x[point[k]]
        total += weight
        along += weight * abs(a)
        nearest = 1.0 if abs(b) <= sin_half else abs(a) * cos_half + abs(b) * sin_half
        staying += weight * min(nearest, 1.0)
        re += weight * (t * a + h * b)
        im += weight * (h * a - t * b)
    return along / total, re / total, im / total, staying / total


@compiled
def turning(slope: float, re: float, im: float, half: float, small: float, large: float) -> float:
    """Least area that a cut of turning vectors allows within ``half`` [rad] of an angle.

    Where the sinusoid re cos + im sin is positive, it is least at an end; elsewhere it requires no
    length.
    """
    level = re * math.cos(half) - abs(im) * math.sin(half)
    return on_line(level, slope, small, large)


@compiled
def on_line(level: float, slope: float, small: float, large: float) -> float:
    """Least pi r^2 + 4 r l with r + slope l >= level, l >= 0 and small <= r <= large.

    Infinite if there is no solution, which can only happen for slope = 0.
    """
    if slope <= 0.0:
        if large < level:
            return np.inf
        return math.pi * max(small, level) ** 2
    # beyond r = level no length is required, and the area grows with r; before, it is concave
    end = min(large, max(level, small))
    at_small = math.pi * small * small + 4.0 * small * max(level - small, 0.0) / slope
    at_end = math.pi * end * end + 4.0 * end * max(level - end, 0.0) / slope
    return min(at_small, at_end)
