"""H-infinity synthesis of controllers of an order or a family: mu synthesis without perturbation.

With a full block alone mu is the largest singular value, so the search of method "fixed" for the
least peak of mu is one for the least norm.
"""

from __future__ import annotations

import math
from typing import Any

from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.certify.norms import certified_norm
from workbench.errors import InputError, SolverError
from workbench.executor import Context
from workbench.program import Claim, method
from workbench.synthesis.families.family import asked_of
from workbench.synthesis.families.synthesis import ControllerSynthesis
from workbench.synthesis.h_infinity.methods import LEAST_DISTANCE
from workbench.synthesis.h_infinity.program import HinfController, HinfSynthesis
from workbench.synthesis.h_infinity.riccati import central_of
from workbench.synthesis.h_infinity.settling import level_of_more_known
from workbench.synthesis.mu.program import MuSynthesis
from workbench.systems.generalised_plant import GeneralisedPlant

ASKED = (
    *("order", "family", "stable", "fastest_pole", "start", "random"),
    *("largest_gain", "further_plants"),
)
"""What is asked of the controller, by the same names in all Programs."""


def nothing_asked(program: ControllerSynthesis) -> str | None:
    """Why there is nothing to search for; None where there is."""
    return None if asked_of(program) else "nothing is asked of the controller: give order or family"


def asked_form(program: ControllerSynthesis, order: int) -> dict[str, Any]:
    """What is asked of the controller, by name; an order where no form is told."""
    asked = {name: getattr(program, name) for name in ASKED}
    if program.order is None and program.family is None and program.start is None:
        asked["order"] = order
    return asked


@method(
    HinfSynthesis, "trust_region", optimal=False, unfit=nothing_asked, accuracy=ANY_ACCURACY_ALIKE
)
def by_trust_region(program: HinfSynthesis, context: Context) -> Claim:
    """Steps within a trust region on the linearisations of all frequencies near the peak."""
    given = program.absorbed.plant
    plant = GeneralisedPlant(given.system, None, given.controls, given.measurements)
    asked = asked_form(program, given.system.nstates)
    answer, outcome, said = MuSynthesis(plant, target=program.gamma, **asked).respond(
        "fixed", context
    )
    if answer is None:
        return None, outcome, said
    size = certified_norm(program.loop(answer.K))
    least = least_of_all(program, size) if program.gamma is None else math.nan
    level = size if program.gamma is None else program.gamma
    return HinfController(answer.K, size, level, least=least), outcome, said


def least_of_all(program: HinfSynthesis, reached: float) -> float:
    """A level that no controller of any order reaches, of the plants as given; NaN: none is known.

    That of the plant for which it is largest: a controller for all is one for each. Where a plant
    lacks an assumption it is a level that none reaches that knows states and disturbances, or that
    moves every state: perturbed plants have larger ones.
    """
    others = map(HinfSynthesis, program.further_plants)
    levels = [_least_of_one(one, reached) for one in (program, *others)]
    return max((level for level in levels if not math.isnan(level)), default=math.nan)


def _least_of_one(program: HinfSynthesis, reached: float) -> float:
    if program.scaled is None:
        return level_of_more_known(program, reached)
    try:
        return central_of(program.scaled, LEAST_DISTANCE / 2).lower
    except (SolverError, InputError):
        return math.nan
