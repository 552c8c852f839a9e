"""K steps with multipliers: the controller with the least bound that they prove."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import SolverError
from workbench.executor.clock import tick
from workbench.synthesis.h_infinity.levels import level_at
from workbench.synthesis.h_infinity.normalised import normalised_plant
from workbench.synthesis.h_infinity.riccati import (
    LEVEL_RISE_MULTIPLES,
    Central,
    central_controller,
    central_of,
)
from workbench.synthesis.mu.dk import LEVEL_TOLERANCE
from workbench.synthesis.mu.multipliers.functions import Multipliers
from workbench.synthesis.mu.multipliers.scaled_plant import Multiplied, scaled_by_D

if TYPE_CHECKING:
    from workbench.synthesis.mu.program import MuSynthesis


FIRST_FACTOR, SQUARINGS = 1.02, 10
"""First factor between the bounds tried to bracket the least one, and largest number of squarings
of this factor.
"""


def dgk_k_step(
    program: MuSynthesis, multipliers: Multipliers, x: RealArray, near: float
) -> tuple[StateSpace, float]:
    """The best controller for multipliers with parameters x, and the bound proven with it.

    The search starts from the bound `near`. Raises SolverError if no controller is found.
    """
    import control

    plant = program.plant
    if multipliers.real.size:
        beta, made = _least_beta(Multiplied.of(plant, multipliers, x), near)
        return control.ss(*made.K), beta
    system = scaled_by_D(plant, multipliers, x)
    made = central_controller(*system, plant.controls, plant.measurements, LEVEL_TOLERANCE)
    return control.ss(*made.K), made.gamma


def _least_beta(family: Multiplied, near: float) -> tuple[float, Central]:
    """The least beta for which a controller of its plant has norm 1, and this controller."""

    def feasible(beta: float) -> bool:
        tick("H-infinity step")
        level = level_at(normalised_plant(family.plant(beta)).plant, 1.0)
        return level is not None and level.feasible

    low, high = _bracket(feasible, near)
    while high > (1 + LEVEL_TOLERANCE) * low:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if feasible(middle) else (middle, high)
    reached = ""
    for share in LEVEL_RISE_MULTIPLES:
        beta = high * (1 + LEVEL_TOLERANCE * share)
        try:
            return beta, central_of(normalised_plant(family.plant(beta)), LEVEL_TOLERANCE, 1.0)
        except SolverError as error:
            reached = str(error)
    raise SolverError(reached)


def _bracket(feasible: Callable[[float], bool], near: float) -> tuple[float, float]:
    """An infeasible and a feasible beta, found by growing steps away from `near`."""
    factor, beta = FIRST_FACTOR, near
    down = feasible(near)
    for _ in range(SQUARINGS):
        last, beta = beta, beta / factor if down else beta * factor
        if feasible(beta) != down:
            return (beta, last) if down else (last, beta)
        factor = factor**2
    raise SolverError(
        f"from beta = {near:.3g} to {beta:.3g} all are{'' if down else ' not'} feasible"
    )
