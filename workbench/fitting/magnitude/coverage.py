"""Proof that a magnitude lies above data, at their frequencies and everywhere between.

The data are interpolated linearly in log-log scale. On u = log omega, h = log|W| - log m has

    |h''| <= sum over zeros and poles of |p| omega / |j omega - p|^2,

so on [a, b] h is above min(h(a), h(b)) - max|h''| (b - a)^2 / 8. Intervals are halved until this
bound proves h >= 0, or until a point with h < 0 is found.
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench.fitting.rational import Rational

MAX_HALVINGS = 60
"""Largest number of halvings of an interval; if it is still undecided then, it counts as not
covered.
"""
LOG_TERM_ROUNDING = 8 * float(np.finfo(float).eps)
"""Largest rounding error of each term of log|W|, absolute."""


def least_margin(omega: RealArray, magnitude: RealArray, fit: Rational) -> tuple[float, float]:
    """Lower bound on log|W| - log m over [omega[0], omega[-1]], and its frequency [rad/s].

    Where the data are not covered the value is negative: the smallest one found.
    """
    u, level = np.log(omega), np.log(magnitude)
    rounding = LOG_TERM_ROUNDING * (fit.zeros.size + fit.poles.size + 2)
    if u.size == 1:
        return float(_log_size(fit, u)[0] - level[0]) - rounding, float(omega[0])
    a, b = u[:-1], u[1:]
    height = _log_size(fit, u) - level - rounding
    if not np.all(np.isfinite(height)):
        return -np.inf, float(omega[np.argmin(np.isfinite(height))])
    at_a, at_b = height[:-1], height[1:]
    level_a, level_b = level[:-1], level[1:]
    margin, where = np.inf, u[0]
    for halving in range(MAX_HALVINGS + 1):
        met = int(np.argmin(np.minimum(at_a, at_b)))
        lowest = float(min(at_a[met], at_b[met]))
        if lowest < 0:
            return lowest, float(np.exp(a[met] if at_a[met] < at_b[met] else b[met]))
        bound = np.minimum(at_a, at_b) - _curvature(fit, a, b) * (b - a) ** 2 / 8
        open_ = ~(bound >= 0)
        done = ~open_ if halving < MAX_HALVINGS else np.ones_like(open_)
        if done.any():
            k = int(np.argmin(np.where(done, bound, np.inf)))
            if bound[k] < margin:
                margin, where = float(bound[k]), a[k]
        if halving == MAX_HALVINGS or not open_.any():
            break
        a, b, at_a, at_b, level_a, level_b = (
            values[open_] for values in (a, b, at_a, at_b, level_a, level_b)
        )
        middle, level_m = (a + b) / 2, (level_a + level_b) / 2
        at_m = _log_size(fit, middle) - level_m - rounding
        a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
        at_a, at_b = np.concatenate([at_a, at_m]), np.concatenate([at_m, at_b])
        level_a, level_b = np.concatenate([level_a, level_m]), np.concatenate([level_m, level_b])
    return margin, float(np.exp(where))


def _log_size(fit: Rational, u: RealArray) -> RealArray:
    """log|W(j e^u)| at logarithms u of the frequencies."""
    s = 1j * np.exp(u)[:, None]
    zeros, poles = np.log(np.abs(s - fit.zeros)), np.log(np.abs(s - fit.poles))
    return np.asarray(np.log(abs(fit.gain)) + zeros.sum(axis=1) - poles.sum(axis=1))


def _curvature(fit: Rational, a: RealArray, b: RealArray) -> RealArray:
    """Bound on |h''| over each interval [a, b] of log omega."""
    low, high = np.exp(a)[:, None], np.exp(b)[:, None]
    roots = np.concatenate([fit.zeros, fit.poles])
    nearest = np.clip(roots.imag, low, high)
    distance = roots.real**2 + (nearest - roots.imag) ** 2
    return np.asarray(np.sum(np.abs(roots) * high / distance, axis=1))
