"""Lower bound on the area of every stadium around a set: branch and bound on angle and radius.

The bound shares no code with the methods. For weights lambda_j >= 0 of points p_j and unit vectors
u_j with sum lambda_j u_j = 0, every stadium of direction d, radius r and half-length l that
contains the points has

    r sum lambda_j + l sum lambda_j |u_j . d| >= sum lambda_j p_j . u_j,

whatever its centre; with the centre given at 0 the weights need not balance. Divided by the sum of
the weights this is a cut, r + b l >= g. If the vectors turn with the direction, b is constant and g
a sinusoid of the angle, so that a cut holds at every angle, and so does a mixture of two. If they
stay, g is constant. On a box of angles and radii the least area that a cut allows is attained at an
end of the box, because the area is a concave function of r where r + b l = g.

The weights come from the shortest stadium in the middle of a box, where they make the cut sharp. A
cut is valid whatever they are, so nothing depends on how well that stadium was found. Where the
area has a kink, the best of two cuts has one too, and a mixture of them that is level in the middle
of the box loses only the square of the box's size.
"""

from __future__ import annotations

import math

import numpy as np

from workbench.arrays import EPS
from workbench.compiled import compiled

FIRST_CLOSENESS = 1e-2
"""Closeness of the first search, relative; each further one is ten times as close.

Depth first, a search crawls where the least area met is not nearly the least of all."""
MAX_BOXES = 400_000
"""Most boxes of one set. The bound reached by then holds too; it is only less tight."""
MAX_WAITING = 2000
"""Most boxes that wait for their turn: each halving leaves one."""
FIRST_ANGLES = 8
"""Number of intervals of angles to begin with."""
BISECTIONS = 60
"""Halvings of the place of a stadium's axis."""
SLANT = 1e-7
"""Least cosine of the angle between a normal that pushes an end back and the direction."""
RADIUS_ROUNDING = 16.0 * EPS
"""Rounding of a cut, relative to the set's size: cuts hold for a radius larger by so much."""
KEPT_CUTS = 12
"""Number of the latest cuts that a new one is mixed with."""
CONTACTS = 5
"""Most points in a cut."""


def least_area(
    away: np.ndarray,
    centred: bool,
    angle: np.ndarray | None,
    area: np.ndarray,
    close: np.ndarray,
) -> np.ndarray:
    """Lower bound (B,) on the area of every stadium around each set.

    Parameters
    ----------
    away : complex, shape (B, N)
        Points of B sets, relative to a place near each set or to the given centre.
    centred
        Whether the centre is given, at 0.
    angle : real, shape (B,)
        Given directions [rad]; None: free.
    area : real, shape (B,)
        Area of an answer. It says where to stop looking, the bound holds whatever it is.
    close : real, shape (B,)
        Distance below the least area met at which a bound is tight enough.

    Returns
    -------
    real, shape (B,)
        The bounds, rounded downward; NaN where a point or the area is not finite.
    """
    lost = ~np.isfinite(away).all(axis=1) | ~np.isfinite(area) | ~np.isfinite(close)
    away = np.where(lost[:, None], 0, away)
    size = np.abs(away).max(axis=1)
    size = np.where(size > 0, size, 1.0)
    bound = np.empty(len(away))
    for i, points in enumerate(away / size[:, None]):
        given = angle is not None
        first = float(angle[i]) if angle is not None else 0.0
        met, near = (
            0.0 if lost[i] else max(float(a[i] / size[i] / size[i]), 0.0) for a in (area, close)
        )
        bound[i] = _least_area(
            np.ascontiguousarray(points.real),
            np.ascontiguousarray(points.imag),
            centred,
            first,
            first if given else np.pi,
            met,
            near,
        )
    return np.where(lost, np.nan, bound * (1 - 16 * EPS) * size * size)


@compiled
def _least_area(
    x: np.ndarray,
    y: np.ndarray,
    centred: bool,
    first: float,
    last: float,
    met: float,
    close: float,
) -> float:
    """Lower bound on the area for one set (N,), (N,) of unit size, angles from first to last."""
    answer, near = met, FIRST_CLOSENESS * met
    while near > close:
        met = _searched(x, y, centred, first, last, met, near)[1]
        near *= 0.1
    least = _searched(x, y, centred, first, last, met, close)[0]
    # the cuts hold for radii larger by their rounding, whose area is larger by that of the margin
    around = 4.0 + 2.0 * math.sqrt(math.pi * answer)
    return max(least - around * RADIUS_ROUNDING, 0.0)


@compiled
def _searched(
    x: np.ndarray,
    y: np.ndarray,
    centred: bool,
    first: float,
    last: float,
    met: float,
    close: float,
) -> tuple[float, float]:
    """Lower bound within ``close`` of the least area met, and that area, depth first."""
    boxes = np.empty((MAX_WAITING, 5))  # from and to angle, from and to radius, bound
    count = 0
    widest = math.sqrt(met / math.pi)
    intervals = FIRST_ANGLES if last > first else 1
    for k in range(intervals):
        boxes[count, 0] = first + (last - first) * k / intervals
        boxes[count, 1] = first + (last - first) * (k + 1) / intervals
        boxes[count, 2], boxes[count, 3], boxes[count, 4] = 0.0, widest, 0.0
        count += 1
    least, made = met, count
    normal = np.empty((CONTACTS, 3))  # weight, normal along and across
    point = np.empty(CONTACTS, dtype=np.int64)
    cuts = np.zeros((KEPT_CUTS, 3))  # b, and the sinusoid as a complex number
    made_cuts = 0
    while count > 0:
        count -= 1
        low, high, small, large = boxes[count, :4]
        bound = boxes[count, 4]
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        across_re, across_im = _width(x, y, centred, middle)
        small = max(small, across_re * math.cos(half) - abs(across_im) * math.sin(half))
        if small > large:
            continue  # no stadium is in the box
        radius = 0.5 * (small + large)
        contacts, wide, half_length = _shortest(x, y, centred, middle, radius, normal, point)
        met = min(met, math.pi * wide * wide + 4.0 * wide * half_length)
        slope, re, im, staying = _cut(x, y, normal, point, contacts, middle, half)
        bound = max(bound, math.pi * small * small)
        bound = max(bound, _on_line(re, staying, small, large))
        bound = max(bound, _turning(slope, re, im, half, small, large))
        # what one cut allows, and what it allows with one of the others
        c, s = math.cos(middle), math.sin(middle)
        for k in range(min(made_cuts, KEPT_CUTS) + 1):
            if k == 0:
                other, other_re, other_im = 0.0, across_re, across_im
            else:
                other = cuts[k - 1, 0]
                other_re = c * cuts[k - 1, 1] + s * cuts[k - 1, 2]
                other_im = c * cuts[k - 1, 2] - s * cuts[k - 1, 1]
            for level in range(3):
                if level == 0:
                    share = 0.0
                elif level == 1:  # level in the angle
                    share = _zero(im, other_im)
                else:  # level in the radius
                    share = _zero(
                        0.5 * math.pi * radius * slope + re - 2.0 * radius,
                        0.5 * math.pi * radius * other + other_re - 2.0 * radius,
                    )
                if share < 0.0 or (k == 0 and level == 0):
                    continue
                found = _turning(
                    share * slope + (1.0 - share) * other,
                    share * re + (1.0 - share) * other_re,
                    share * im + (1.0 - share) * other_im,
                    half,
                    small,
                    large,
                )
                bound = max(bound, found)
        kept = made_cuts % KEPT_CUTS
        cuts[kept, 0], cuts[kept, 1], cuts[kept, 2] = slope, c * re - s * im, s * re + c * im
        made_cuts += 1
        if bound >= met - close or made >= MAX_BOXES or count + 2 > MAX_WAITING:
            least = min(least, bound)
            continue
        if large < across_re:
            turn, split = True, radius  # no stadium is in the middle, only towards an end
        elif large > 16.0 * small:
            turn, split = False, max(0.125 * large, small + 0.25 * (large - small))
        else:
            # split the side that costs the bound more
            for_angle = _turning(slope, re, im, half, radius, radius)
            for_radius = _turning(slope, re, im, 0.0, small, large)
            turn, split = for_angle < for_radius, radius
        if not turn and (large - small) <= 4.0 * EPS * large:
            turn = True
        if turn and (high - low) <= 4.0 * EPS:
            if (large - small) <= 4.0 * EPS * large:
                least = min(least, bound)
                continue
            turn = False
        for half in range(2):
            boxes[count, 0], boxes[count, 1] = low, high
            boxes[count, 2], boxes[count, 3], boxes[count, 4] = small, large, bound
            if turn:
                boxes[count, 1 - half] = middle
            else:
                boxes[count, 3 - half] = split
            count += 1
            made += 1
    return least, met


@compiled
def _zero(at_one: float, at_zero: float) -> float:
    """Share at which a mixture of two values is 0, from 0 to 1; -1 if they have the same sign."""
    if at_one * at_zero >= 0.0:
        return -1.0
    return at_zero / (at_zero - at_one)


@compiled
def _width(x: np.ndarray, y: np.ndarray, centred: bool, angle: float) -> tuple[float, float]:
    """The radius that the points farthest across an angle [rad] ask for, and its derivative.

    It holds at every other angle too, as a sinusoid.
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
def _shortest(
    x: np.ndarray,
    y: np.ndarray,
    centred: bool,
    angle: float,
    radius: float,
    normal: np.ndarray,
    point: np.ndarray,
) -> tuple[int, float, float]:
    """Number of contacts, radius and half-length of the shortest stadium of an angle [rad].

    The radius is the given one, or half the width where that is larger. The weight and the normal
    of each contact, along and across the direction, are written to ``normal`` (CONTACTS, 3), its
    index to ``point``.
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
    # what is left is balanced by a point on a straight side
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
    """As `_shortest`, with the centre at 0: the one contact that asks for the most length."""
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
    """The points that hold the right and the left end of the segment, and its whole length."""
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
    """Across over along of the normal at a point on a round end."""
    h = c * y[i] - s * x[i] - axis
    room = math.sqrt(max((radius - h) * (radius + h), 0.0))
    return h / max(room, SLANT * max(radius, EPS))


@compiled
def _cut(
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
    for vectors that stay.
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
def _turning(slope: float, re: float, im: float, half: float, small: float, large: float) -> float:
    """Least area that a cut of turning vectors allows within ``half`` [rad] of an angle.

    The sinusoid re cos + im sin is least at an end where it is positive, and elsewhere asks for no
    length.
    """
    level = re * math.cos(half) - abs(im) * math.sin(half)
    return _on_line(level, slope, small, large)


@compiled
def _on_line(level: float, slope: float, small: float, large: float) -> float:
    """Least pi r^2 + 4 r l with r + slope l >= level, l >= 0 and small <= r <= large.

    Infinite where that has no solution, which is where slope is 0.
    """
    if slope <= 0.0:
        if large < level:
            return np.inf
        return math.pi * max(small, level) ** 2
    # beyond r = level no length is asked for, and the area grows; before, it is concave
    end = min(large, max(level, small))
    at_small = math.pi * small * small + 4.0 * small * max(level - small, 0.0) / slope
    at_end = math.pi * end * end + 4.0 * end * max(level - end, 0.0) / slope
    return min(at_small, at_end)
