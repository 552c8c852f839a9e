"""H-infinity synthesis over controllers of an order or a family: mu synthesis without perturbation.

With only a full block, mu is the largest singular value. So the search of method "fixed" for the
least peak of mu finds the least norm.
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
from workbench.synthesis.mu.structured.fixed import trust_region_claim
from workbench.systems.bilinear import bilinear_sampled
from workbench.systems.generalised_plant import GeneralisedPlant

ASKED = (
    *("order", "family", "stable", "fastest_pole", "start", "random"),
    *("largest_gain", "further_plants"),
)
"""Names of the demands on the controller; they are the same in all Programs."""


def nothing_asked(program: ControllerSynthesis) -> str | None:
    """The reason why there is nothing to search; None if there is something."""
    return None if asked_of(program) else "no demand on the controller: give order or family"


def asked_form(program: ControllerSynthesis, order: int) -> dict[str, Any]:
    """The demands on the controller by name; with an order if no form is given."""
    asked = {name: getattr(program, name) for name in ASKED}
    if program.order is None and program.family is None and program.start is None:
        asked["order"] = order
    return asked


@method(
    HinfSynthesis, "trust_region", optimal=False, unfit=nothing_asked, accuracy=ANY_ACCURACY_ALIKE
)
def by_trust_region(program: HinfSynthesis, context: Context) -> Claim:
    """Trust region steps on the linearisations at all frequencies near the peak."""
    stated, dt = without_perturbation(program), float(program.plant.system.dt or 0.0)
    answer, outcome, said = trust_region_claim(stated.plane if dt else stated, context)
    if answer is None:
        return None, outcome, said
    K = bilinear_sampled(answer.K, dt) if dt else answer.K
    size = certified_norm(program.loop(K))
    least = least_of_all(program, size) if program.gamma is None else math.nan
    level = size if program.gamma is None else program.gamma
    return HinfController(K, size, level, least=least), outcome, said


def without_perturbation(program: HinfSynthesis) -> MuSynthesis:
    """The synthesis as one of mu, whose only block is that of the performance."""
    given = program.absorbed.plant
    plant = GeneralisedPlant(given.system, None, given.controls, given.measurements)
    return MuSynthesis(plant, target=program.gamma, **asked_form(program, given.system.nstates))


def least_of_all(program: HinfSynthesis, reached: float) -> float:
    """A level that no controller of any order reaches with the given plants; NaN if none is known.

    It is the largest of the levels for each plant, since a controller for all plants is a
    controller for each. For a plant that does not meet an assumption, it is a level that no
    controller reaches even if it measures all states and disturbances, moves every state, or may
    have any response at a single frequency. The least level of a perturbed plant is no such bound,
    since it is larger than that of the given plant.
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
