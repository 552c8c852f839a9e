"""Several descents of a smoothed peak, so that the result hardly depends on rounding.

The peak of mu over the parameters of weights, nominal and controller has long curved valleys and
several minima. The end of one descent depends on the last bits of its start; the best end of
several descents hardly does.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import OptimizeResult, minimize

from workbench._core.arrays import RealArray
from workbench.executor import Context

Smoothed = Callable[[RealArray, int], tuple[float, RealArray]]
"""Function: parameters (n,) and power -> power mean of mu over frequency, and its derivatives
(n,).
"""

POWERS = (8, 32, 128, 512)
"""Powers of the means over frequency that approximate the largest mu, used one after the other."""
LAST_POWERS = (128, 512, 2048)
"""Powers of the final descents, which start near the end of another descent."""
BFGS_STEPS, LAST_STEPS = 300, 1000
"""Largest number of BFGS steps for each power, in the first and in the final descents."""
STALLED_STEPS, STALLED_SHARE = 20, 1e-5
"""A descent ends if this number of steps lowers mu by less than this share. Even the largest number
of steps would then gain less than the tolerance of a certified peak.
"""
LEAST_CURVATURE = 1e-12
"""Least eigenvalue of an inverse Hessian, relative to the largest."""
STARTS, START_SPREAD, MOST_DRAWS = 6, 0.1, 50
"""Number of descents, standard deviation of their starts around the given one in units of the
parameters, and largest number of draws of a start until its loop is stable.
"""
FINISHED, LAST_ROUNDS, LEAST_GAIN = 2, 4, 1e-3
"""Number of ends that are continued, largest number of continuations, and share by which each one
must lower mu.
"""
UNSTABLE_MU = 1e6
"""Mu assigned to an unstable loop. Infinity would give the optimiser no slope."""


class End(NamedTuple):
    """Parameters (n,) at which a descent ended, and the mean of mu there."""

    y: RealArray
    mu: float


def least_of_several(smoothed: Smoothed, y: RealArray, context: Context, words: str) -> RealArray:
    """Parameters (n,) of the least peak found by descents from y and from starts around it.

    Parameters are scaled to about 1. The context's generator draws the starts.
    """
    starts = [y, *(_random_start(smoothed, y, context.rng) for _ in range(STARTS - 1))]
    ends = [_descent(smoothed, start, POWERS, BFGS_STEPS) for start in context.track(starts, words)]
    ends.sort(key=lambda end: end.mu)
    last = [
        _continued_descent(smoothed, end)
        for end in context.track(ends[:FINISHED], f"{words}, finish")
    ]
    return min(last, key=lambda end: end.mu).y


def _random_start(smoothed: Smoothed, y: RealArray, rng: np.random.Generator) -> RealArray:
    """Random parameters around y with a stable loop; y if no draw gives one."""
    for _ in range(MOST_DRAWS):
        drawn = y + START_SPREAD * rng.standard_normal(y.size)
        if smoothed(drawn, POWERS[0])[0] < UNSTABLE_MU:
            return drawn
    return y


def _continued_descent(smoothed: Smoothed, end: End) -> End:
    """The end of repeated descents from an end, while they gain; each starts with the identity as
    curvature.
    """
    best = End(end.y, smoothed(end.y, LAST_POWERS[-1])[0])
    for _ in range(LAST_ROUNDS):
        found = _descent(smoothed, best.y, LAST_POWERS, LAST_STEPS)
        before, best = best, min(best, found, key=lambda each: each.mu)
        if best.mu > (1 - LEAST_GAIN) * before.mu:
            break
    return best


def _descent(smoothed: Smoothed, y: RealArray, powers: tuple[int, ...], steps: int) -> End:
    """The end of BFGS from y with increasing powers; each power starts with the curvature of the
    one before.
    """
    curvature, mu = np.eye(y.size), np.inf
    for power in powers:
        done = minimize(
            smoothed, y, (power,), "BFGS", jac=True, callback=_until_stalled(),
            options={"maxiter": steps, "hess_inv0": curvature},
        )  # fmt: skip
        y, mu, curvature = done.x, float(done.fun), _positive_definite(done.hess_inv)
    return End(y, mu)


def _until_stalled() -> Callable[[OptimizeResult], None]:
    """A callback that ends a descent that no longer gains."""
    found: list[float] = []

    def callback(intermediate_result: OptimizeResult) -> None:
        found.append(float(intermediate_result.fun))
        before = found[-1 - STALLED_STEPS] if len(found) > STALLED_STEPS else np.inf
        if before - found[-1] < STALLED_SHARE * found[-1]:
            raise StopIteration

    return callback


def _positive_definite(inverse: RealArray) -> RealArray:
    """The inverse Hessian, made symmetric and positive definite despite rounding."""
    values, vectors = np.linalg.eigh((inverse + inverse.T) / 2)
    found = (vectors * np.maximum(values, LEAST_CURVATURE * values[-1])) @ vectors.T
    return np.asarray((found + found.T) / 2)
