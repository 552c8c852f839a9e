"""H2 synthesis by Riccati equations: SciPy's and SLICOT's."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.linalg import LinAlgError, solve_continuous_are

from workbench._core.arrays import RealArray
from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.program import Claim, method
from workbench.solvers import Outcome, slicot_routine, slycot_missing
from workbench.synthesis.h2.direct import cancelling_gain, with_D22, without_D22, without_direct
from workbench.synthesis.h2.program import H2Synthesis
from workbench.synthesis.h2.separation import Separated, separated_controller
from workbench.synthesis.h_infinity.normalised import Scaled, normalised_plant
from workbench.synthesis.h_infinity.singular_plants.regularised import on_regular
from workbench.systems.balancing import balanced
from workbench.systems.equations.riccati import sampled_solution
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.realisation import realisation
from workbench.systems.standard_plant import StandardPlant

Step = Callable[[StandardPlant], Separated]
"""Function: plant -> its controller. The plant has no direct term u -> y, and in continuous time
none w -> z.
"""


def claim_of_step(program: H2Synthesis, step: Step) -> Claim:
    """The claim of a method for the plant, or for a perturbed plant where the assumptions fail."""
    given, regular = program.standard, bool(program.plant.system.dt) or program.scaled is not None
    try:
        made = (
            _sampled_controller(given, step)
            if given.dt
            else _continuous_controller(given, step, regular)
        )
        K = with_D22(made.K, given.D22)
    except (LinAlgError, ArithmeticError, SolverError) as error:
        return None, Outcome.FAILED, " ".join(str(error).split())
    answer = program.answer(realisation(K, given.dt), least=made.norm if regular else math.nan)
    if answer is None:
        return None, Outcome.FAILED, "the controller found does not stabilise the plant"
    said = "" if regular else "of a plant perturbed to meet the assumptions"
    return answer, Outcome.SOLVED, said


def _continuous_controller(given: StandardPlant, step: Step, regular: bool) -> Separated:
    """Controller and norm for a plant without D22; unless `regular`, for a perturbed plant."""
    Dk = cancelling_gain(given)
    plant = without_direct(given, Dk)

    def made(normal: Scaled) -> Separated:
        (A, B, C, D), norm = step(normal.plant)
        A, B, C, D = normal.controller((A, B, C, D))
        return Separated((A, B, C, D + Dk), math.sqrt(normal.rate) * norm)

    if regular:
        return made(normalised_plant(plant))
    system = realisation((plant.A, plant.B, plant.C, plant.D), 0.0)
    return on_regular(GeneralisedPlant(system, None, plant.controls, plant.measurements), made)


def _sampled_controller(given: StandardPlant, step: Step) -> Separated:
    """Controller and norm for a plant without D22, computed with balanced states."""
    A, B, C = balanced(given.A, given.B, given.C)
    return step(replace(without_D22(given), A=A, B=B, C=C))


@method(H2Synthesis, "riccati", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _riccati(program: H2Synthesis, context: Context) -> Claim:
    """Solve two Riccati equations: one of the control problem, one of the estimation problem."""
    return claim_of_step(program, riccati_step)


def riccati_step(plant: StandardPlant) -> Separated:
    """The controller for a plant without direct terms, from both Riccati equations."""
    return separated_controller(plant, _root(plant), _root(plant.dual))


def _root(plant: StandardPlant) -> RealArray:
    """The stabilising solution of the Riccati equation of the control problem."""
    if not plant.states:
        return np.zeros((0, 0))
    C, D = plant.C1, plant.D12
    try:
        if plant.dt:
            return sampled_solution(plant.A, plant.B2, C, D)
        X: RealArray = solve_continuous_are(plant.A, plant.B2, C.T @ C, D.T @ D, s=C.T @ D)
    except (LinAlgError, ValueError) as error:
        raise SolverError(f"a Riccati equation is singular or nearly so: {error}") from None
    return X


def _unfit(program: H2Synthesis) -> str | None:
    """Why SB10HD cannot solve the program; None where it can."""
    if program.plant.system.dt:
        return "SB10HD is for continuous time"
    if not program.plant.system.nstates:
        return "SB10HD needs a plant with states"
    return slycot_missing()


@method(H2Synthesis, "sb10hd", optimal=False, unfit=_unfit, accuracy=ANY_ACCURACY_ALIKE)
def _sb10hd(program: H2Synthesis, context: Context) -> Claim:
    """SLICOT SB10HD on the scaled plant."""
    sb10hd = slicot_routine("sb10hd")

    def step(plant: StandardPlant) -> Separated:
        sizes = (plant.states, plant.B.shape[1], len(plant.C), plant.controls, plant.measurements)
        A, B, C, D, _ = sb10hd(*sizes, plant.A, plant.B, plant.C, plant.D)
        return Separated((A, B, C, D), riccati_step(plant).norm)

    return claim_of_step(program, step)
