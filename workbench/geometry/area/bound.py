"""Lower bound on the area of every stadium around a set: branch and bound on angle and radius.

The bound shares no code with the methods. For weights lambda_j >= 0 of points p_j and unit vectors
u_j with sum lambda_j u_j = 0, every stadium of direction d, radius r and half-length l that
contains the points has

    r sum lambda_j + l sum lambda_j |u_j . d| >= sum lambda_j p_j . u_j,

whatever its centre; with the centre given at 0 the weights need not balance. Divided by the sum of
the weights, this inequality is a cut, r + b l >= g. If the vectors turn with the direction, b is
constant and g is a sinusoid of the angle, so that the cut holds at every angle; a mixture of two
cuts does too. If the vectors stay fixed, g is constant. On a box of angles and radii the least area
that a cut allows is attained at an end of the box, because the area is a concave function of r
where r + b l = g.

The weights come from the shortest stadium in the middle of a box, where they make the cut sharp. A
cut is valid whatever they are, so nothing depends on how well that stadium was found. Where the
area has a kink, the best of two cuts has one too, and a mixture of them that is level in the middle
of the box loses only the square of the box's size.
"""

from __future__ import annotations

import math

import numpy as np

from workbench._core.arrays import EPS
from workbench._core.compiled import compiled
from workbench.geometry.area.cuts import CONTACTS, cut_of, on_line, shortest, turning, width_across

FIRST_CLOSENESS = 1e-2
"""The first search stops this close, relative, to the least area met; each further search is ten
times as close. A depth-first search is very slow as long as the least area met is far from the true
minimum.

Depth first, a search crawls where the least area met is not nearly the least of all.
"""
MAX_BOXES = 400_000
"""Largest number of boxes for one set. The bound reached by then is valid, only less tight."""
MAX_WAITING = 2000
"""Largest number of boxes that wait for their turn; each halving adds one."""
FIRST_ANGLES = 8
"""Number of intervals of angles at the start."""
RADIUS_ROUNDING = 16.0 * EPS
"""Rounding of a cut, relative to the set's size: cuts hold for a radius that is larger by this."""
KEPT_CUTS = 12
"""Number of the latest cuts that a new one is mixed with."""


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
        met = _bounds_by_search(x, y, centred, first, last, met, near)[1]
        near *= 0.1
    least = _bounds_by_search(x, y, centred, first, last, met, close)[0]
    # the cuts hold for radii that are larger by the rounding; the area grows by that of the margin
    around = 4.0 + 2.0 * math.sqrt(math.pi * answer)
    return max(least - around * RADIUS_ROUNDING, 0.0)


@compiled
def _bounds_by_search(
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
        across_re, across_im = width_across(x, y, centred, middle)
        small = max(small, across_re * math.cos(half) - abs(across_im) * math.sin(half))
        if small > large:
            continue  # no stadium lies in the box
        radius = 0.5 * (small + large)
        contacts, wide, half_length = shortest(x, y, centred, middle, radius, normal, point)
        met = min(met, math.pi * wide * wide + 4.0 * wide * half_length)
        slope, re, im, staying = cut_of(x, y, normal, point, contacts, middle, half)
        bound = max(bound, math.pi * small * small)
        bound = max(bound, on_line(re, staying, small, large))
        bound = max(bound, turning(slope, re, im, half, small, large))
        c, s = math.cos(middle), math.sin(middle)
        cut, width = (slope, re, im), (across_re, across_im)
        known = cuts[: min(made_cuts, KEPT_CUTS)]
        bound = max(bound, _area_of_two_cuts(cut, width, known, (c, s), radius, half, small, large))
        kept = made_cuts % KEPT_CUTS
        cuts[kept, 0], cuts[kept, 1], cuts[kept, 2] = slope, c * re - s * im, s * re + c * im
        made_cuts += 1
        if bound >= met - close or made >= MAX_BOXES or count + 2 > MAX_WAITING:
            least = min(least, bound)
            continue
        if large < across_re:
            turn, split = True, radius  # no stadium lies in the middle, only near an end
        elif large > 16.0 * small:
            turn, split = False, max(0.125 * large, small + 0.25 * (large - small))
        else:
            # split the side that lowers the bound more
            for_angle = turning(slope, re, im, half, radius, radius)
            for_radius = turning(slope, re, im, 0.0, small, large)
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
def _area_of_two_cuts(
    cut: tuple[float, float, float],
    width: tuple[float, float],
    known: np.ndarray,
    turn: tuple[float, float],
    radius: float,
    half: float,
    small: float,
    large: float,
) -> float:
    """Least area that a cut allows in a box together with one other: the width or a known cut.

    A cut is b, g and the derivative of g at the middle of the box, the width g and its derivative;
    ``known`` (K, 3) holds b and the sinusoids as complex numbers, ``turn`` the middle's cosine and
    sine. Two mixtures are tried: the one that is level in the angle and the one that is level in
    the radius.
    """
    slope, re, im = cut
    c, s = turn
    bound = 0.0
    for k in range(len(known) + 1):
        if k == 0:
            other, other_re, other_im = 0.0, width[0], width[1]
        else:
            other = known[k - 1, 0]
            other_re = c * known[k - 1, 1] + s * known[k - 1, 2]
            other_im = c * known[k - 1, 2] - s * known[k - 1, 1]
            bound = max(bound, turning(other, other_re, other_im, half, small, large))
        in_radius = 0.5 * math.pi * radius * slope + re - 2.0 * radius
        other_in_radius = 0.5 * math.pi * radius * other + other_re - 2.0 * radius
        for share in (_zero(im, other_im), _zero(in_radius, other_in_radius)):
            if share >= 0.0:
                rest = 1.0 - share
                found = turning(
                    share * slope + rest * other,
                    share * re + rest * other_re,
                    share * im + rest * other_im,
                    half,
                    small,
                    large,
                )
                bound = max(bound, found)
    return bound


@compiled
def _zero(at_one: float, at_zero: float) -> float:
    """Share at which a mixture of two values is 0, from 0 to 1; -1 if they have the same sign."""
    if at_one * at_zero >= 0.0:
        return -1.0
    return at_zero / (at_zero - at_one)
