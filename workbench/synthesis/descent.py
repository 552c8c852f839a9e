"""The least level of H-infinity synthesis as a function of scalings, and its descent.

Alternating between controller and scalings stops, or crawls, where neither alone can improve. But
the least level of the scaled plant is itself a function of the scalings' parameters, smooth where
the coupling of the two Riccati equations bounds it; so it is minimised directly.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize

from workbench.errors import InputError, SolverError
from workbench.synthesis.hinf_levels import least_level, level_at
from workbench.synthesis.standard import Real, StandardPlant

EXACT = 1e-7
"""Of the least level, relative: its differences are gradients."""
STEP = 1e-4
"""Of the differences."""
SECANTS = 10
FARTHEST = 0.05
"""Longest step of the secant in log gamma."""
HIGH = 10.0
"""Log level that stands for a plant without one."""


def least_level_near(plant: StandardPlant, guess: float) -> float:
    """The least level of a scaled plant, by a secant of the coupling about a guess.

    By bisection where that does not lead to one, as where no coupling bounds the level.
    """
    at, points = math.log(guess), []
    for _ in range(SECANTS):
        level = level_at(plant, math.exp(at))
        if level is None or level.coupling <= 0.0:
            at += FARTHEST
            continue
        here = (at, math.log(level.coupling))
        if abs(here[1]) < EXACT:
            return math.exp(at)
        points.append(here)
        if len(points) == 1:
            at += math.copysign(1e-3, here[1])
            continue
        (a, f), (b, g) = points[-2:]
        if f == g:
            break
        at = b + min(max(-g * (b - a) / (g - f), -FARTHEST), FARTHEST)
    return least_level(plant, EXACT)[1].gamma


def descended(
    plant_of: Callable[[Real], StandardPlant],
    x: Real,
    steps: int,
    watch: Callable[[Real, float], None],
) -> Real:
    """Parameters near x (k,) with a lower least level.

    Parameters
    ----------
    plant_of
        The scaled plant (`scaling.scaled`) of parameters.
    steps
        Of the quasi-Newton method.
    watch
        Called with the parameters of every step and their least level.
    """
    last = least_level(plant_of(x), EXACT)[1].gamma

    def log_level(y: Real) -> float:
        try:
            return math.log(least_level_near(plant_of(y), last))
        except (SolverError, InputError):
            return HIGH

    def slope(y: Real) -> Real:
        ends = y + STEP * np.vstack([np.eye(len(y)), -np.eye(len(y))])
        above, below = np.split(np.array([log_level(end) for end in ends]), 2)
        return np.asarray((above - below) / (2 * STEP))

    def taken(y: Real) -> None:
        nonlocal last
        last = math.exp(log_level(y))
        watch(y, last)

    found = minimize(
        log_level, x, jac=slope, method="BFGS", callback=taken, options={"maxiter": steps}
    )
    return np.asarray(found.x)
