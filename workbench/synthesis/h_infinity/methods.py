"""H-infinity synthesis by Riccati equations: the workbench's own method and SLICOT's."""

from __future__ import annotations

import math

import numpy as np

from workbench.accuracy import AccuracyRange
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.program import Claim, method
from workbench.solvers import Outcome, slicot_routine, slycot_missing
from workbench.synthesis.h_infinity.levels import level_ends
from workbench.synthesis.h_infinity.normalised import Scaled
from workbench.synthesis.h_infinity.program import HinfSynthesis
from workbench.synthesis.h_infinity.riccati import MANY_RISES, InfeasibleError, central_of
from workbench.synthesis.h_infinity.settling import Made, answered, settled
from workbench.systems.norms import hinf_norm

LEAST_DISTANCE = 1e-3
"""Smallest relative distance kept above the least level. Closer to it, the poles of K become very
fast, without any benefit.
"""
LEVEL_ACCURACY = AccuracyRange(finest=LEAST_DISTANCE)
"""The range of tolerances that affect a level kept at this distance."""


def distance(context: Context) -> float:
    """Relative distance to keep above the least level."""
    return max(context.options.accuracy, LEAST_DISTANCE)


@method(HinfSynthesis, "riccati", optimal=False, accuracy=LEVEL_ACCURACY)
def _riccati(program: HinfSynthesis, context: Context) -> Claim:
    """Two Riccati equations and bisection of the level; K is made 1e-3 above the least level."""
    near = distance(context) / 2

    def step(normal: Scaled) -> Made:
        try:
            # One half of the distance is the interval of the least level, the other half the step
            # above it.
            found = central_of(normal, near, program.gamma, MANY_RISES)
        except InfeasibleError as error:
            return Made(None, outcome=Outcome.INFEASIBLE, said=str(error))
        except SolverError as error:
            return Made(None, outcome=Outcome.FAILED, said=str(error))
        said = f"no level below {found.lower:.6g} is feasible" if found.lower else ""
        least = found.lower if program.gamma is None else math.nan
        return Made(found.K, found.norm, found.gamma, least, said=said)

    claim = answered(program, context, step)
    if claim[1] is Outcome.FAILED and program.scaled is not None:
        return settled(program, context, step)  # an assumption nearly fails
    return claim


def _static(program: HinfSynthesis) -> str | None:
    """Why SB10AD cannot solve the program; None where it can."""
    if not program.plant.system.nstates:
        return "SB10AD needs a plant with states"
    return slycot_missing()


@method(
    HinfSynthesis,
    "sb10ad",
    optimal=False,
    unfit=_static,
    accuracy=AccuracyRange(finest=LEAST_DISTANCE),
)
def _sb10ad(program: HinfSynthesis, context: Context) -> Claim:
    """SLICOT SB10AD with its own bisection on the scaled plant; K is made 1e-3 above its level."""
    sb10ad, near = slicot_routine("sb10ad"), distance(context)

    def step(normal: Scaled) -> Made:
        plant = normal.plant
        sizes = (plant.states, plant.B.shape[1], len(plant.C), plant.controls, plant.measurements)
        matrices = (plant.A, plant.B, plant.C, plant.D)
        gamma, said = program.gamma, f"SB10AD with gamma = {program.gamma}"
        least = math.nan
        try:
            if gamma is None:
                _, ceiling = level_ends(plant)
                least = float(sb10ad(*sizes, ceiling, *matrices, job=1, gtol=near * ceiling)[0])
                said = f"SB10AD: least level {least:.6g}"
                gamma = least * (1.0 + near)
            _, *made = sb10ad(*sizes, gamma, *matrices, job=4)
            K = normal.controller((made[0], made[1], made[2], made[3]))
            return Made(K, hinf_norm(normal.given.close(K)), gamma, least, said=said)
        except (ArithmeticError, SolverError, np.linalg.LinAlgError) as error:
            words = f"{said}: {' '.join(str(error).split())}"
            return Made(None, outcome=Outcome.FAILED, said=words)

    return answered(program, context, step)
