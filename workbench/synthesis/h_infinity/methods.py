"""H-infinity synthesis by Riccati equations: the bench's own method and SLICOT's."""

from __future__ import annotations

import math

import numpy as np

from workbench.accuracy import AccuracyRange
from workbench.certify.norms import certified_norm
from workbench.certify.stability import stability_of
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.program import Claim, method
from workbench.solvers import Outcome, slicot_routine, slycot_missing
from workbench.synthesis.h_infinity.levels import CANCELLED_SHARE, level_ends, without_control
from workbench.synthesis.h_infinity.program import CLAIM_TOLERANCE, HinfController, HinfSynthesis
from workbench.synthesis.h_infinity.riccati import MANY_RISES, InfeasibleError, central_of
from workbench.systems.bilinear import to_sampled
from workbench.systems.norms import norm
from workbench.systems.realisation import Matrices, realisation

LEAST_DISTANCE = 1e-3
"""Least relative distance kept above the least level; closer to it, the poles of K become very fast
without any gain."""
LEVEL_ACCURACY = AccuracyRange(finest=LEAST_DISTANCE)
"""The tolerances that make a difference to a level that is kept at this distance."""
NEGLIGIBLE_NORM = 1e-3
"""A norm of the loop below this share of the least level consists of rounding errors."""
CANCELLED_CLAIM = 1e-8
"""Share of w -> z without K that is claimed as norm where K cancels it up to rounding."""


def distance(context: Context) -> float:
    """Relative distance to keep above the least level."""
    return max(context.options.accuracy, LEAST_DISTANCE)


def claimed(
    program: HinfSynthesis,
    K: Matrices,
    size: float,
    gamma: float,
    said: str,
    least: float = math.nan,
) -> Claim:
    """The claim for a controller K of the plant in continuous time; no answer unless it stabilises.

    `size` is the norm of its loop, `gamma` its level, `said` the message so far and `least` a level
    that no controller reaches.
    """
    if not np.isfinite(size):
        return None, Outcome.FAILED, f"{said}; the controller found does not stabilise the plant"
    # Where signals cancel, the remaining norm is a rounding error that cannot be claimed.
    open_loop = without_control(program.scaled.plant)
    if program.gamma is None and size < NEGLIGIBLE_NORM * gamma:
        size = gamma
    elif size < CANCELLED_SHARE * open_loop:
        size = min(gamma, CANCELLED_CLAIM * open_loop)
    plant = program.plant
    dt = float(plant.system.dt or 0.0)
    try:
        matrices = to_sampled(K) if dt else K
    except np.linalg.LinAlgError:
        return None, Outcome.FAILED, f"{said}; the sampled controller found is not causal"
    K_found = plant.named(realisation(matrices, dt))
    # The realised loop may differ from the scaled one that gave the size: the kernel has its norm.
    loop = plant.close(K_found)
    if stability_of(loop).holds:
        proven = certified_norm(loop)
        if np.isfinite(proven) and proven > (1 + CLAIM_TOLERANCE) * size:
            size, gamma = proven, max(gamma, proven)
    if least > (1 + CLAIM_TOLERANCE) * size:
        said, least = f"{said}; its least level {least:.6g} is refuted by this loop", math.nan
    return HinfController(K_found, size, gamma, least), Outcome.SOLVED, said


@method(HinfSynthesis, "riccati", optimal=False, accuracy=LEVEL_ACCURACY)
def _riccati(program: HinfSynthesis, context: Context) -> Claim:
    """Two Riccati equations and bisection of the level; K is made 1e-3 above the least level."""
    try:
        # Half of the distance is for the interval of the least level, half for the step above it.
        found = central_of(program.scaled, distance(context) / 2, program.gamma, MANY_RISES)
    except InfeasibleError as error:
        return None, Outcome.INFEASIBLE, str(error)
    except SolverError as error:
        return None, Outcome.FAILED, str(error)
    said = f"no level below {found.lower:.6g} is feasible" if found.lower else ""
    least = found.lower if program.gamma is None else math.nan
    return claimed(program, found.K, found.norm, found.gamma, said, least)


def _static(program: HinfSynthesis) -> str | None:
    """Why SB10AD cannot take the program; None where it can."""
    if not program.scaled.plant.states:
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
    sb10ad = slicot_routine("sb10ad")

    normal, step = program.scaled, distance(context)
    plant = normal.plant
    sizes = (plant.states, plant.B.shape[1], len(plant.C), plant.controls, plant.measurements)
    matrices = (plant.A, plant.B, plant.C, plant.D)
    gamma, said = program.gamma, f"SB10AD with gamma = {program.gamma}"
    least = math.nan
    try:
        if gamma is None:
            _, ceiling = level_ends(plant)
            least = float(sb10ad(*sizes, ceiling, *matrices, job=1, gtol=step * ceiling)[0])
            said = f"SB10AD: least level {least:.6g}"
            gamma = least * (1.0 + step)
        _, *made = sb10ad(*sizes, gamma, *matrices, job=4)
        K = normal.controller((made[0], made[1], made[2], made[3]))
        return claimed(program, K, norm(normal.given.close(K)), gamma, said, least)
    except (ArithmeticError, SolverError, np.linalg.LinAlgError) as error:
        return None, Outcome.FAILED, f"{said}: {' '.join(str(error).split())}"
