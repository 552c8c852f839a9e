"""Lower bound on the error of every magnitude fit of an order, from the alternation of one fit.

De la Vallee Poussin's argument: let |W|^2 = N / D be the one fit, |V|^2 = N_1 / D_1 a competitor of
order n, and c > 0. If |V| < c|W| and |V| > c|W| hold in turn at k frequencies, then N_1 D - c^2 N
D_1 has k - 1 zeros in x = omega^2 > 0, but its degree is at most n + max(deg N, deg D). So a fit W
that alternates at n + max(deg N, deg D) + 2 frequencies bounds the error of every V from below: a
competitor of error below e has |V| < c|W| where c|W| / m is above 1 + e / w, and |V| > c|W| where
it is below 1 - e / w. (A cover has |V| > c|W| where c|W| / m is below 1, also between the data.)

W need not be the answer itself: roots of the answer that lie very near zero, very far away or very
near the imaginary axis are moved to zero, to infinity or onto the axis. At such a zero of W no
competitor is smaller, and at such a pole none is larger, so these points count as alternations too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.fitting.rational import Rational

REMOTE_ROOT_FACTOR = 1e3
"""A root may be moved to zero or infinity if its distance from the band of the data is more than
this factor.
"""
UNDAMPED_RATIO = 1e-5
"""Damping ratio below which a root may be moved onto the imaginary axis."""
COVER_VALLEY_SAMPLES = 10
"""Number of samples in each interval of the data in the search for the lowest points of a cover."""
ZOOMS = 14
"""Number of fourfold magnifications around each of these points; the point is then found to
rounding.
"""


@dataclass(frozen=True)
class _Points:
    """Ratios |W| / m (P,) at rising frequencies, 0 at zeros of W and infinite at its poles.

    ``weight`` (P,) is 0 where only the lower limit matters; ``needed`` is the number of
    alternations that the bound requires.
    """

    ratio: RealArray
    weight: RealArray
    needed: int


def error_bound(
    omega: RealArray,
    magnitude: RealArray,
    weight: RealArray,
    cover: bool,
    fit: Rational,
    order: int,
) -> float:
    """Lower bound on the worst error of every fit of an order; 0 if ``fit`` proves nothing.

    Parameters
    ----------
    omega, magnitude, weight
        Data (F,): frequencies [rad/s], positive magnitudes, positive weights.
    cover
        Whether fits must lie above the data, also between their frequencies.
    fit
        The fit whose alternation is used.
    order
        Order of the competitors.
    """
    bound, tried = 0.0, [(np.inf, 0.0)]
    if _extreme(fit, omega):
        tried.append((REMOTE_ROOT_FACTOR, UNDAMPED_RATIO))
    for limits in tried:
        points = _points(omega, magnitude, weight, cover, fit, order, *limits)
        bound = max(bound, _cover_bound(points) if cover else _bound(points))
    return bound


def _bound(points: _Points) -> float:
    """Lower bound for fits that may lie on both sides of the data: the best over a few gains."""
    gain, best = 1.0, 0.0
    for _ in range(4):
        with np.errstate(invalid="ignore"):
            deviation = points.weight * (gain * points.ratio - 1)
        deviation[points.ratio == 0] = -np.inf  # even where the weight is 0
        error, chosen = _alternation(deviation, points.needed)
        if not error > 0:
            break
        up = chosen[(deviation[chosen] > 0) & np.isfinite(points.ratio[chosen])]
        down = chosen[(deviation[chosen] < 0) & (points.ratio[chosen] > 0)]
        if not (up.size and down.size):
            break
        # the best gain makes the lowest of the chosen deviations equal
        a, b = points.ratio[up][:, None], points.ratio[down]
        v, w = points.weight[up][:, None], points.weight[down]
        equal = v * w * (a - b) / (v * a + w * b)
        i, j = np.unravel_index(int(np.argmin(equal)), equal.shape)
        best = max(best, error, float(equal[i, j]))
        gain = float((v[i, 0] + w[j]) / (v[i, 0] * a[i, 0] + w[j] * b[j]))
    return best


def _cover_bound(points: _Points) -> float:
    """Lower bound for covers: the best over gains that put a low point of the fit on the data."""
    ratio = points.ratio
    inner = np.flatnonzero((ratio[1:-1] <= ratio[:-2]) & (ratio[1:-1] <= ratio[2:])) + 1
    low = np.unique(ratio[np.concatenate([[0], inner, [ratio.size - 1]])])
    best = 0.0
    for least in low[(low > 0) & np.isfinite(low)][:100]:
        deviation = np.where(
            ratio <= least, -np.inf, np.maximum(points.weight, 0) * np.maximum(ratio / least - 1, 0)
        )
        deviation[np.isinf(ratio)] = np.inf
        best = max(best, _alternation(deviation, points.needed)[0])
    return best


def _alternation(deviation: RealArray, needed: int) -> tuple[float, np.ndarray]:
    """Largest e at which |deviation| >= e alternates in sign at ``needed`` points, and the points.

    The index of the largest deviation is returned for each run of one sign.
    """
    places = np.flatnonzero(deviation)
    size = np.abs(deviation[places])
    levels = np.unique(size[np.isfinite(size)])

    signs = np.sign(deviation[places])

    def starts(level: float) -> np.ndarray:
        """Indices of the first point of each run of one sign at or above a level."""
        kept = np.flatnonzero(size >= level)
        turns = np.flatnonzero(signs[kept[1:]] != signs[kept[:-1]]) + 1
        return kept[np.concatenate([np.zeros(min(kept.size, 1), dtype=int), turns])]

    low, high = -1, levels.size - 1  # invariant: levels[low] is reached, levels[high + 1] is not
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if starts(levels[middle]).size >= needed else (low, middle - 1)
    if low < 0:
        return 0.0, np.zeros(0, dtype=int)
    firsts = starts(levels[low])
    runs = zip(firsts, np.append(firsts[1:], places.size), strict=True)
    # Up to the next run no point of the other sign is as large, so only points of this sign count.
    tops = [
        places[a + np.argmax(np.where(signs[a:b] == signs[a], size[a:b], 0.0))] for a, b in runs
    ]
    return float(levels[low]), np.array(tops)


def _extreme(fit: Rational, omega: RealArray) -> bool:
    """Whether a root is remote or lightly damped, so that it may be moved."""
    roots = np.concatenate([fit.zeros, fit.poles])
    size = np.abs(roots)
    remote = (size > REMOTE_ROOT_FACTOR * omega[-1]) | (size < omega[0] / REMOTE_ROOT_FACTOR)
    return bool((remote | (np.abs(roots.real) < UNDAMPED_RATIO * size)).any())


def _points(
    omega: RealArray,
    magnitude: RealArray,
    weight: RealArray,
    cover: bool,
    fit: Rational,
    order: int,
    reach: float,
    undamped: float,
) -> _Points:
    """Points of possible alternation, after moving roots that are remote or lightly damped.

    ``reach`` is the factor beyond the band, ``undamped`` the damping ratio (see the constants).
    """
    change, marks, degrees = {}, [], []
    far, near = reach * omega[-1], omega[0] / reach
    for name, sign in (("zeros", 1), ("poles", -1)):
        roots = getattr(fit, name)
        change[name] = _Moved(
            roots[np.abs(roots) > far],
            roots[np.abs(roots) < near],
            roots[
                (np.abs(roots.real) < undamped * np.abs(roots))
                & (np.abs(roots) <= far)
                & (np.abs(roots) >= near)
            ],
        )
        degrees.append(roots.size - change[name].far.size)
        marks += [(abs(root), -sign) for root in change[name].undamped if root.imag > 0]
    at_zero = change["zeros"].near.size - change["poles"].near.size

    def ratio(at: RealArray) -> RealArray:
        size = np.abs(fit.response(at))
        size *= change["zeros"].factor(at) / change["poles"].factor(at)
        return size / np.exp(np.interp(np.log(at), np.log(omega), np.log(magnitude)))

    at, weights = omega, weight
    if cover:
        valleys = np.setdiff1d(_valleys(omega, ratio), omega)
        at, weights = np.append(omega, valleys), np.append(weight, np.zeros(valleys.size))
    ratios = ratio(at)
    ratios[: omega.size] = ratio(omega)
    marks += [(0.0, -np.sign(at_zero)), (np.inf, np.sign(degrees[0] - degrees[1]))]
    marks = [(place, sign) for place, sign in marks if sign]
    place = np.append(at, [place for place, _ in marks])
    ratios = np.append(ratios, [np.inf if sign > 0 else 0.0 for _, sign in marks])
    weights = np.append(weights, np.ones(len(marks)))
    along = np.argsort(place)
    return _Points(ratios[along], weights[along], order + max(degrees) + 2)


@dataclass(frozen=True)
class _Moved:
    """Roots [rad/s] to move to infinity, to zero and onto the imaginary axis."""

    far: ComplexArray
    near: ComplexArray
    undamped: ComplexArray

    def factor(self, omega: RealArray) -> RealArray:
        """Factor (F,) by which the move changes |prod(j omega - roots)|, up to a constant."""
        s = 1j * omega[:, None]
        return np.asarray(
            np.prod(1 / np.abs(1 - s / self.far), axis=1)
            * np.prod(omega[:, None] / np.abs(s - self.near), axis=1)
            * np.prod(np.abs((s - 1j * self.undamped.imag) / (s - self.undamped)), axis=1)
        )


def _valleys(omega: RealArray, ratio: object) -> RealArray:
    """Frequencies [rad/s] of the local minima of the ratio, also between the data."""
    u = np.log(omega)
    fine = np.interp(
        np.arange((u.size - 1) * COVER_VALLEY_SAMPLES + 1) / COVER_VALLEY_SAMPLES,
        np.arange(u.size),
        u,
    )
    r = ratio(np.exp(fine))  # type: ignore[operator]
    low = np.flatnonzero((r[1:-1] <= r[:-2]) & (r[1:-1] <= r[2:]))
    at, width = fine[low + 1], np.maximum(fine[low + 1] - fine[low], fine[low + 2] - fine[low + 1])
    start, end = fine[low], fine[low + 2]
    for _ in range(ZOOMS):
        around = np.clip(
            at[:, None] + width[:, None] * np.linspace(-1, 1, 9), start[:, None], end[:, None]
        )
        lowest = ratio(np.exp(around.ravel())).reshape(around.shape).argmin(axis=1)  # type: ignore[operator]
        at, width = around[np.arange(at.size), lowest], width / 4
    return np.exp(at)
