"""Sampled loops of an implementation around models of the measured plants."""

from __future__ import annotations

import math

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.executor import Context
from workbench.synthesis.implementation.board_loop import BoardLoop
from workbench.synthesis.implementation.program import Implementation
from workbench.synthesis.operation.stated_plants import stated_corners, without
from workbench.systems.margins import highest_crossover
from workbench.uncertainty import Responses, UncertaintyModel
from workbench.uncertainty.responses.plant_models import measured_plants

TIME_CONSTANTS = 12.0
"""Duration of a simulation in time constants of the slowest motion, which decays to 6e-6."""
MOST_SAMPLES, FEWEST_SAMPLES = 6000, 200
"""Largest and smallest number of samples of a simulation. If that is too short for the loop to
settle, a check says so.
"""
POLE_ROUNDING = 1e-9
"""Poles of a state space this near to the imaginary axis, relative to the largest, count as on
it.
"""


def measured_models(
    responses: Responses, task: Implementation, K: StateSpace, context: Context
) -> tuple[list[StateSpace], RealArray]:
    """A continuous model of each measured plant, and the relative error of each model.

    For a corner of a stated spread it is the real plant that has the corner's direction at the
    crossover with the sampled controller K.
    """
    model = task.loop.model
    if isinstance(model, UncertaintyModel):
        order, poles, least = model.nominal.order, model.nominal.poles, 0.0
    else:
        order, poles = 2, task.loop.nominal[0].poles()
        least = POLE_ROUNDING * float(np.abs(poles).max(initial=0.0))
    right = int((poles.real > least).sum())
    turned = stated_corners(responses)
    kept = [k for k in range(len(responses.plants)) if k not in turned]
    fitted, apart = measured_plants(without(responses, turned), order, right, context)
    found = dict(zip(kept, (one.state_space() for one in fitted), strict=True))
    errors = dict(zip(kept, apart, strict=True))
    references = {corner.reference for corner in turned.values()}
    omega = {one: _crossover(responses, task, K, found[one]) for one in references}
    for k, corner in turned.items():
        found[k] = corner.plant(found[corner.reference], omega[corner.reference])
        errors[k] = errors[corner.reference]
    return [found[k] for k in sorted(found)], np.array([errors[k] for k in sorted(found)])


def _crossover(
    responses: Responses, task: Implementation, K: StateSpace, plant: StateSpace
) -> float:
    """Highest frequency [rad/s] at which the loop gain is 1; else the middle of the band."""
    (loop,) = loops_around([plant], task)
    found = 2 * math.pi * highest_crossover(loop.loop_of(K).held(), K)
    ends = responses.axis[[0, -1]]
    return found if 0.0 < found < math.inf else float(np.sqrt(ends[0] * ends[1]))


def loops_around(models: list[StateSpace], task: Implementation) -> list[BoardLoop]:
    """The sampled loop around each plant."""
    sign = task.loop.nominal[1]
    return [BoardLoop(one, task.dt, task.delay_samples, task.anti_aliasing, sign) for one in models]


def samples_to_settle(slowest: float) -> int:
    """Number of samples of a simulation whose slowest motion shrinks by `slowest` in a sample."""
    wanted = math.ceil(TIME_CONSTANTS / -math.log(min(slowest, 1 - 1e-12)))
    return int(np.clip(wanted, FEWEST_SAMPLES, MOST_SAMPLES))
