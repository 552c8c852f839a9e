"""Lower bounds on the error of any magnitude fit of an order, from the alternation of one fit.

De la Vallee Poussin's argument: let |W|^2 = N / D, a competitor |V|^2 = N_1 / D_1 of order n, and
c > 0. If |V| < c|W| and |V| > c|W| hold in turn at k frequencies, then N_1 D - c^2 N D_1 has k - 1
zeros in x = omega^2 > 0, yet its degree is at most n + max(deg N, deg D). So a fit W that
alternates at n + max(deg N, deg D) + 2 frequencies bounds the error of every V from below: a
competitor of error below e is smaller where c|W| / m is above 1 + e / w, and larger where it is
below 1 - e / w (of a cover: at most 1, also between the data). W need not be the answer: roots of
the answer that lie all but at zero, at infinity or on the imaginary axis are put there. At its zero
there no competitor is smaller, at its pole none is larger, so these count as alternations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.fitting.rational import Rational

OUT_OF_REACH = 1e3
"""Factor beyond the frequencies from which a root may be put at zero or infinity."""
UNDAMPED = 1e-5
"""Damping ratio below which a root may be put on the imaginary axis."""
FINE = 10
"""Samples in each interval of the data in search of the lowest points of a cover."""


@dataclass(frozen=True)
class _Points:
    """Ratios |W| / m along the frequencies; 0 and infinity at zeros and poles on the boundary."""

    ratio: RealArray
    weight: RealArray  # 0: only a bound from below counts here
    needed: int


def error_bound(
    omega: RealArray,
    magnitude: RealArray,
    weight: RealArray,
    cover: bool,
    fit: Rational,
    order: int,
) -> float:
    """A worst error that no fit of an order can go below; 0 where the fit proves nothing.

    Parameters
    ----------
    omega, magnitude, weight
        Data (F,): [rad/s], positive, positive.
    cover
        Whether fits must lie above the data, between them too.
    fit
        Whose alternation is used.
    order
        Of the competitors.
    """
    bound = 0.0
    for limits in ((np.inf, 0.0), (OUT_OF_REACH, UNDAMPED)):
        points = _points(omega, magnitude, weight, cover, fit, order, *limits)
        bound = max(bound, _cover_bound(points) if cover else _bound(points))
    return bound


def _bound(points: _Points) -> float:
    gain, best = 1.0, 0.0
    for _ in range(4):
        with np.errstate(invalid="ignore"):
            deviation = points.weight * (gain * points.ratio - 1)
        deviation[points.ratio == 0] = -np.inf  # whatever its weight
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
    """Over all gains that put some low point of the fit just on the data."""
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
    """Largest e with ``needed`` sign changes among deviations beyond e, and the points that do.

    Of each run of one sign the point that deviates most is returned.
    """
    places = np.flatnonzero(deviation)
    size = np.abs(deviation[places])
    levels = np.unique(size[np.isfinite(size)])

    def runs(level: float) -> list[np.ndarray]:
        kept = places[size >= level]
        if not kept.size:
            return []
        return np.split(kept, np.flatnonzero(np.diff(np.sign(deviation[kept]))) + 1)

    low, high = -1, levels.size - 1  # the level of `low` is reached, that of `high` + 1 is not
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if len(runs(levels[middle])) >= needed else (low, middle - 1)
    if low < 0:
        return 0.0, np.zeros(0, dtype=int)
    tops = [run[np.argmax(np.abs(deviation[run]))] for run in runs(levels[low])]
    return float(levels[low]), np.array(tops)


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
    """Roots to be put at infinity, at zero and on the imaginary axis."""

    far: ComplexArray
    near: ComplexArray
    undamped: ComplexArray

    def factor(self, omega: RealArray) -> RealArray:
        """What that does to |prod(j omega - roots)|, up to a constant."""
        s = 1j * omega[:, None]
        return np.asarray(
            np.prod(1 / np.abs(1 - s / self.far), axis=1)
            * np.prod(omega[:, None] / np.abs(s - self.near), axis=1)
            * np.prod(np.abs((s - 1j * self.undamped.imag) / (s - self.undamped)), axis=1)
        )


def _valleys(omega: RealArray, ratio: object) -> RealArray:
    """Frequencies at which the ratio is locally least, between the data too."""
    u = np.log(omega)
    fine = np.interp(np.arange((u.size - 1) * FINE + 1) / FINE, np.arange(u.size), u)
    r = ratio(np.exp(fine))  # type: ignore[operator]
    low = np.flatnonzero((r[1:-1] <= r[:-2]) & (r[1:-1] <= r[2:]))
    a, b = fine[low], fine[low + 2]
    for _ in range(45):  # ternary search
        c, d = a + (b - a) / 3, b - (b - a) / 3
        left = ratio(np.exp(c)) < ratio(np.exp(d))  # type: ignore[operator]
        a, b = np.where(left, a, c), np.where(left, d, b)
    return np.exp((a + b) / 2)
