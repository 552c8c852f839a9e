"""Evolution strategy with covariance matrix adaptation (CMA-ES), which needs no gradients.

N. Hansen, The CMA evolution strategy: a tutorial, arXiv:1604.00772 (2016): rank-one and rank-mu
updates of the covariance, and control of the step by the length of the evolution path.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from workbench._core.arrays import RealArray
from workbench.executor.clock import time_is_up

FIRST_SPREAD = 0.3
"""Initial standard deviation, in units of the parameters."""
LEAST_SPREAD, LEAST_SPAN = 1e-6, 1e-7
"""The search ends if its largest standard deviation, or the range of a generation's values, is
below this.
"""


def evolution_end(
    function: Callable[[RealArray], float],
    y: RealArray,
    rng: np.random.Generator,
    generations: int,
    spread: float = FIRST_SPREAD,
) -> tuple[RealArray, float]:
    """The best point found from y (k,), and its value; infinite values count as the worst."""
    n = len(y)
    count = 4 + int(3 * math.log(n)) if n > 1 else 6
    kept = count // 2
    weights = np.log((count + 1) / 2) - np.log(np.arange(1, kept + 1))
    weights /= weights.sum()
    mass = 1.0 / float(weights @ weights)
    path_rate = (4 + mass / n) / (n + 4 + 2 * mass / n)
    step_rate = (mass + 2) / (n + mass + 5)
    one_rate = 2 / ((n + 1.3) ** 2 + mass)
    mu_rate = min(1 - one_rate, 2 * (mass - 2 + 1 / mass) / ((n + 2) ** 2 + mass))
    damping = 1 + 2 * max(0.0, math.sqrt((mass - 1) / (n + 1)) - 1) + step_rate
    usual = math.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n**2))  # mean length of a normal vector
    mean, covariance = y.copy(), np.eye(n)
    path, step_path = np.zeros(n), np.zeros(n)
    best, least = y.copy(), function(y)
    for generation in range(1, generations + 1):
        if time_is_up("evolution"):
            break
        sizes, axes = np.linalg.eigh(covariance)
        sizes = np.sqrt(np.maximum(sizes, 1e-30))
        moves = rng.normal(size=(count, n)) * sizes @ axes.T
        values = np.array([function(mean + spread * move) for move in moves])
        order = np.argsort(values)
        if values[order[0]] < least:
            best, least = mean + spread * moves[order[0]], float(values[order[0]])
        finite = values[np.isfinite(values)]
        if finite.size == count and np.ptp(finite) < LEAST_SPAN:
            break
        chosen = moves[order[:kept]]
        drift = weights @ chosen
        mean = mean + spread * drift
        white = axes @ ((axes.T @ drift) / sizes)
        step_path += -step_rate * step_path + math.sqrt(step_rate * (2 - step_rate) * mass) * white
        length = float(np.linalg.norm(step_path))
        known = 1 - (1 - step_rate) ** (2 * generation)
        steady = length / math.sqrt(known) < (1.4 + 2 / (n + 1)) * usual
        path += -path_rate * path + steady * math.sqrt(path_rate * (2 - path_rate) * mass) * drift
        covariance = (
            (1 - one_rate - mu_rate) * covariance
            + one_rate * np.outer(path, path)
            + mu_rate * (chosen.T * weights) @ chosen
        )
        spread *= math.exp(min(1.0, step_rate / damping * (length / usual - 1)))
        if spread * float(sizes.max()) < LEAST_SPREAD:
            break
    return best, least
