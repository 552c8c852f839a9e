"""Several descents of a smoothed peak, so that where they end does not hang on rounding.

The peak of mu over the parameters of weights, nominal and controller has long curved valleys and
several minima. Where one descent stops in them depends on the last bits of its start; the best end
of several hardly does.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import OptimizeResult, minimize

from workbench._core.arrays import RealArray
from workbench.executor import Context

Smoothed = Callable[[RealArray, int], tuple[float, RealArray]]
"""A mean of mu over frequency of some power, and its slopes (n,), by parameters (n,)."""

POWERS = (8, 32, 128, 512)
"""Powers of the means over frequency that stand for the largest mu, one after the other."""
LAST_POWERS = (128, 512, 2048)
"""Powers of the last descents, which begin near an end."""
BFGS_STEPS, LAST_STEPS = 300, 1000
"""Largest numbers of steps of BFGS for each power, of the first and of the last descents."""
STALLED_STEPS, STALLED_SHARE = 20, 1e-5
"""A search ends where this number of steps lowers mu by less than this share of it: even the most
steps would then gain less than a certified peak resolves."""
LEAST_CURVATURE = 1e-12
"""Least eigenvalue of an inverse of second derivatives, over the largest."""
STARTS, START_SPREAD, MOST_DRAWS = 6, 0.1, 50
"""Number of descents, the standard deviation of their starts about the given one, in units of the
parameters, and the most draws of one start until its loop is stable."""
FINISHED, LAST_ROUNDS, LEAST_GAIN = 2, 4, 1e-3
"""Number of ends that descend on, at most how often, and the share that each time must gain."""
UNSTABLE_MU = 1e6
"""Mu assigned to an unstable loop; infinity would leave the optimiser no slope."""


class End(NamedTuple):
    """Parameters (n,) at which a descent ended, and the mean of mu there."""

    y: RealArray
    mu: float


def least_of_several(smoothed: Smoothed, y: RealArray, context: Context, words: str) -> RealArray:
    """Parameters (n,) of the least peak that descents from y and from about it lead to.

    Parameters are in units in which they are about 1. Starts are drawn by the context's generator.
    """
    starts = [y, *(_beside(smoothed, y, context.rng) for _ in range(STARTS - 1))]
    ends = [
        _descended(smoothed, start, POWERS, BFGS_STEPS) for start in context.track(starts, words)
    ]
    ends.sort(key=lambda end: end.mu)
    last = [_finished(smoothed, end) for end in context.track(ends[:FINISHED], f"{words}, finish")]
    return min(last, key=lambda end: end.mu).y


def _beside(smoothed: Smoothed, y: RealArray, rng: np.random.Generator) -> RealArray:
    """Random parameters about y with a stable loop; y where no draw has one."""
    for _ in range(MOST_DRAWS):
        drawn = y + START_SPREAD * rng.standard_normal(y.size)
        if smoothed(drawn, POWERS[0])[0] < UNSTABLE_MU:
            return drawn
    return y


def _finished(smoothed: Smoothed, end: End) -> End:
    """Where descents from an end lead, each of which begins without curvature, while they gain."""
    best = End(end.y, smoothed(end.y, LAST_POWERS[-1])[0])
    for _ in range(LAST_ROUNDS):
        found = _descended(smoothed, best.y, LAST_POWERS, LAST_STEPS)
        before, best = best, min(best, found, key=lambda each: each.mu)
        if best.mu > (1 - LEAST_GAIN) * before.mu:
            break
    return best


def _descended(smoothed: Smoothed, y: RealArray, powers: tuple[int, ...], steps: int) -> End:
    """The end of BFGS from y by means of rising powers; each is curved about as the one before."""
    curvature, mu = np.eye(y.size), np.inf
    for power in powers:
        done = minimize(
            smoothed, y, (power,), "BFGS", jac=True, callback=_until_stalled(),
            options={"maxiter": steps, "hess_inv0": curvature},
        )  # fmt: skip
        y, mu, curvature = done.x, float(done.fun), _definite(done.hess_inv)
    return End(y, mu)


def _until_stalled() -> Callable[[OptimizeResult], None]:
    """A callback that ends a search that no longer gains."""
    found: list[float] = []

    def callback(intermediate_result: OptimizeResult) -> None:
        found.append(float(intermediate_result.fun))
        before = found[-1 - STALLED_STEPS] if len(found) > STALLED_STEPS else np.inf
        if before - found[-1] < STALLED_SHARE * found[-1]:
            raise StopIteration

    return callback


def _definite(inverse: RealArray) -> RealArray:
    """An inverse of second derivatives, symmetric and positive definite despite rounding."""
    values, vectors = np.linalg.eigh((inverse + inverse.T) / 2)
    found = (vectors * np.maximum(values, LEAST_CURVATURE * values[-1])) @ vectors.T
    return np.asarray((found + found.T) / 2)
