"""Lower bounds on the sizes of circles and stadiums, from the points alone.

The bounds share no code with the methods. A method's answer only decides where the search for a
bound begins: every bound holds for the optimum, whatever the answer was.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from workbench._core.arrays import EPS

LONG_EPS = np.finfo(np.longdouble).eps
"""Relative spacing of extended-precision numbers."""
MAX_SUPPORT_EXCHANGES = 100
"""Largest number of points that may enter the support of a circle's bound; three or four are usual.
The bound reached by then is returned: it is valid for any support.

The bound reached by then is returned: it holds for any support.
"""


def circle_radius_bound(points: np.ndarray, center: np.ndarray) -> np.ndarray:
    """Lower bound on the radius of any circle around each set, by weak duality.

    For weights lambda >= 0 of sum 1 every enclosing circle has
    ``r^2 >= sum lambda |p|^2 - |sum lambda p|^2``. The support (the points of positive weight) is
    found by ascent: the point farthest from the current weighted mean is added, and the one, two
    or three points that give the largest bound are kept.

    Parameters
    ----------
    points : complex, shape (..., N)
    center : complex, shape (...)
        Centre from which the ascent starts.

    Returns
    -------
    extended-precision array, shape (...)
        The bounds, rounded downward; NaN if the centre is not finite.
    """
    sets = points.reshape(-1, points.shape[-1]).astype(np.clongdouble)
    bounds = [_dual_bound(set_, c) for set_, c in zip(sets, np.ravel(center), strict=True)]
    return np.array(bounds, dtype=np.longdouble).reshape(points.shape[:-1])


def _dual_bound(points: np.ndarray, center: complex) -> np.longdouble:
    """Lower bound on the radius of any circle around one set (N,), by ascent from a centre."""
    if not np.isfinite(center):
        return np.longdouble(np.nan)
    away = points - points[0]
    scale = np.abs(away).max()
    if scale == 0:
        return scale
    away = away / scale
    balance = (np.clongdouble(center) - points[0]) / scale
    support: list[int] = []
    best = np.longdouble(0)
    for _ in range(MAX_SUPPORT_EXCHANGES):
        farthest = int(np.argmax(np.abs(away - balance)))
        if farthest in support:
            break
        support, weights = _heaviest(away, [*support, farthest])
        balance = weights @ away[support]
        best = max(best, weights @ np.abs(away[support] - balance) ** 2)
    return np.sqrt(best) * (1 - 4 * LONG_EPS) * scale


def _heaviest(points: np.ndarray, support: list[int]) -> tuple[list[int], np.ndarray]:
    """Choose, among up to four points, the one, two or three points with the largest bound.

    Returns the indices of the chosen points and their weights.
    """
    candidates = [([support[-1]], np.ones(1, dtype=np.longdouble))]
    candidates += [
        (list(pair), np.full(2, np.longdouble(0.5))) for pair in combinations(support, 2)
    ]
    for trio in combinations(support, 3):
        a, b, c = points[list(trio)]
        side = np.abs(np.array([b - c, c - a, a - b])) ** 2
        # barycentric coordinates of the circumcentre; an obtuse triangle has a negative one, and
        # the two ends of its longest side then give the larger bound
        weights = side * (side.sum() - 2 * side)
        if weights.min() >= 0 and weights.sum() > 0:
            candidates.append((list(trio), weights / weights.sum()))

    def bound(candidate: tuple[list[int], np.ndarray]) -> np.longdouble:
        chosen, weights = candidate
        return weights @ np.abs(points[chosen] - weights @ points[chosen]) ** 2

    return max(candidates, key=bound)


def least_half_width(away: np.ndarray, relative: float = 1e-11) -> np.ndarray:
    """Lower bound on the half-width of each set over all directions, tight within ``relative``.

    The interval [0, pi) of directions theta is divided. The width of a set across theta is at least
    that of any pair of its points, which is a sinusoid of theta and concave where it is positive.
    So on each interval the two pairs that are widest at its ends bound the width from below: by the
    smaller of their values at the ends, and by their common value where the two sinusoids cross.
    Intervals whose bound is not yet within ``relative`` of the least width found so far are split,
    at the crossing if there is one.

    Parameters
    ----------
    away : complex, shape (B, N)
        Points of B sets, preferably relative to a centre of each set.
    relative
        Relative distance allowed between the bound and the least width found.

    Returns
    -------
    real, shape (B,)
        The bounds, rounded downward; NaN where a point is not finite.
    """
    sets, count = away.shape
    lost = ~np.isfinite(away).all(axis=1)
    away = np.where(lost[:, None], 0, away)
    scale = np.abs(away).max(axis=1)
    scale = np.where(scale > 0, scale, 1.0)
    away = away / scale[:, None]
    chunk = max(1, 4_000_000 // count)

    def widest(index: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Difference of the two points of a set that lie farthest apart across a direction."""
        pairs = np.empty(len(index), dtype=complex)
        for start in range(0, len(index), chunk):
            part = slice(start, start + chunk)
            set_ = away[index[part]]
            across = (set_ * np.exp(-1j * theta[part])[:, None]).imag
            row = np.arange(len(set_))
            pairs[part] = set_[row, across.argmax(axis=1)] - set_[row, across.argmin(axis=1)]
        return pairs

    def width(pair: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Extent of each difference of points across a direction."""
        return (pair * np.exp(-1j * theta)).imag

    starts = np.linspace(0, np.pi, 13)
    index = np.repeat(np.arange(sets), 12)
    left, right = np.tile(starts[:-1], sets), np.tile(starts[1:], sets)
    pair_l, pair_r = widest(index, left), widest(index, right)
    least_met = np.full(sets, np.inf)
    bound = np.full(sets, np.inf)
    for _ in range(200):
        np.minimum.at(least_met, index, width(pair_l, left))
        np.minimum.at(least_met, index, width(pair_r, right))
        cross = np.angle(pair_l - pair_r)  # direction [rad, modulo pi] of equal widths
        cross = left + np.mod(cross - left, np.pi)
        inside = (cross > left) & (cross < right)
        split = np.where(inside, cross, (left + right) / 2)
        at_split = np.minimum(width(pair_l, split), width(pair_r, split))
        lower = np.minimum(width(pair_l, left), width(pair_r, right))
        lower = np.minimum(lower, np.where(inside, at_split, np.inf))
        # Without a crossing one pair is wider on the whole interval: its smaller end value is the
        # bound.
        one = np.maximum(
            np.minimum(width(pair_l, left), width(pair_l, right)),
            np.minimum(width(pair_r, left), width(pair_r, right)),
        )
        lower = np.where(inside, lower, one)
        settled = lower >= least_met[index] * (1 - relative) - 4 * EPS
        settled |= (right - left) < 4 * EPS
        np.minimum.at(bound, index[settled], lower[settled])
        if settled.all():
            break
        index, split = index[~settled], split[~settled]
        left, right = left[~settled], right[~settled]
        pair_l, pair_r = pair_l[~settled], pair_r[~settled]
        middle = widest(index, split)
        index = np.concatenate([index, index])
        left, right = np.concatenate([left, split]), np.concatenate([split, right])
        pair_l, pair_r = np.concatenate([pair_l, middle]), np.concatenate([middle, pair_r])
    else:
        np.minimum.at(bound, index, lower)
    return np.where(lost, np.nan, np.maximum(bound / 2 - 4 * EPS, 0) * scale)
