"""Lower bounds on the sizes of circles and stadiums, from the points alone.

They share no code with the methods. A method's answer only tells where to look: every bound holds
for the optimum whatever the answer was.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

EPS = np.finfo(float).eps
BANDS = (1e-9, 1e-6, 1e-4, 1e-2, 1.0)
SUPPORT = 64
"""Points nearest the circle that are weighed; more of them would not sharpen the bound."""


def circle_radius_bound(points: np.ndarray, center: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Lower bound on the radius of any circle around each set.

    For weights lambda >= 0 of sum 1 every enclosing circle has
    ``r^2 >= sum lambda |p|^2 - |sum lambda p|^2``. The weights are those that bring the points
    nearest the given circle closest to balance about its centre.

    Parameters
    ----------
    points : complex, shape (..., N)
    center, radius : shape (...)

    Returns
    -------
    extended-precision array, shape (...)
    """
    away = points.astype(np.clongdouble) - np.asarray(center)[..., None]
    flat = away.reshape(-1, away.shape[-1])
    bounds = [_dual_bound(set_, float(r)) for set_, r in zip(flat, np.ravel(radius), strict=True)]
    return np.array(bounds, dtype=np.longdouble).reshape(points.shape[:-1])


def _dual_bound(away: np.ndarray, radius: float) -> float:
    distance = np.abs(away)
    scale = distance.max()
    if not np.isfinite(scale) or scale == 0:
        return scale * 0
    nearest = np.argsort(distance)[-SUPPORT:]
    away, distance = away[nearest] / scale, distance[nearest] / scale
    best = 0.0
    for band in BANDS:
        support = away[distance >= 1 - band]
        balance = np.vstack([support.real, support.imag, np.ones(len(support))]).astype(float)
        weights, _ = nnls(balance, np.array([0.0, 0.0, 1.0]))
        weights = weights.astype(np.longdouble) / weights.sum()
        spread = weights @ (support.real**2 + support.imag**2) - np.abs(weights @ support) ** 2
        best = max(best, spread)
    return np.sqrt(best) * scale


def least_half_width(away: np.ndarray, relative: float = 1e-11) -> np.ndarray:
    """Lower bound on the half-width of each set over all directions, within ``relative`` of it.

    The angle interval [0, pi) is bracketed. Across direction theta the width is at least that of
    any pair of points, a sinusoid of theta that is concave where positive. On an interval the two
    pairs that are widest at its ends bound it from below: by their smaller end values, and by
    their common value where they cross. Intervals whose bound is not yet within ``relative`` of
    the least width met so far are split, at the crossing if there is one.

    Parameters
    ----------
    away : complex, shape (B, N)
        Points, best given relative to a centre of theirs.

    Returns
    -------
    real, shape (B,)
        Rounded downward.
    """
    sets, count = away.shape
    scale = np.abs(away).max(axis=1)
    scale = np.where(scale > 0, scale, 1.0)
    away = away / scale[:, None]
    chunk = max(1, 4_000_000 // count)

    def widest(index: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """The difference of two points that spans most across each direction."""
        pairs = np.empty(len(index), dtype=complex)
        for start in range(0, len(index), chunk):
            part = slice(start, start + chunk)
            set_ = away[index[part]]
            across = (set_ * np.exp(-1j * theta[part])[:, None]).imag
            row = np.arange(len(set_))
            pairs[part] = set_[row, across.argmax(axis=1)] - set_[row, across.argmin(axis=1)]
        return pairs

    def width(pair: np.ndarray, theta: np.ndarray) -> np.ndarray:
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
        cross = np.angle(pair_l - pair_r)  # where the two pairs are equally wide, modulo pi
        cross = left + np.mod(cross - left, np.pi)
        inside = (cross > left) & (cross < right)
        split = np.where(inside, cross, (left + right) / 2)
        at_split = np.minimum(width(pair_l, split), width(pair_r, split))
        lower = np.minimum(width(pair_l, left), width(pair_r, right))
        lower = np.minimum(lower, np.where(inside, at_split, np.inf))
        # Without a crossing one pair dominates: its smaller end value is the bound.
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
    return np.maximum(bound / 2 - 4 * EPS, 0) * scale
