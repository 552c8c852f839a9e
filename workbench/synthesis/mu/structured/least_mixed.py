"""Mixed H2/H-infinity synthesis over an order or a family, by descent of the H2 norm itself."""

from __future__ import annotations

from workbench._core.heavy_types import StateSpace
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.program import Claim, find_method, method
from workbench.solvers import Outcome
from workbench.synthesis.families.family import Family
from workbench.synthesis.h2.methods import claim_of_step, riccati_step
from workbench.synthesis.h2.program import H2Synthesis
from workbench.synthesis.mixed_norms.conic import least_norm
from workbench.synthesis.mixed_norms.program import H2HinfSynthesis
from workbench.synthesis.mu.program import MuSynthesis
from workbench.synthesis.mu.structured.energy import EnergyProblem
from workbench.synthesis.mu.structured.least_energy import energy_starts
from workbench.synthesis.mu.structured.least_norm import asked_form
from workbench.synthesis.mu.structured.problem import PeakProblem
from workbench.synthesis.mu.structured.searches import INSIDE, gain_limit, searched
from workbench.synthesis.mu.structured.starts.found import NoStabilisingGainError, found_starts
from workbench.synthesis.mu.structured.terms import EnergyTerm, PeakTerm, Term
from workbench.systems.bilinear import from_continuous_plane
from workbench.systems.standard_plant import standard_plant

CONIC = "clarabel"
"""The conic solver that finds a start."""


@method(H2HinfSynthesis, "fixed", optimal=False)
def _fixed(program: H2HinfSynthesis, context: Context) -> Claim:
    """Descent of the H2 norm within the limit, over a family or an order (else the plant's)."""
    limited = _least_limited_norm(program)
    try:
        starts = _starts(program, limited, context)
    except NoStabilisingGainError:
        return None, Outcome.INFEASIBLE, ""

    def terms_of(family: Family) -> list[Term]:
        asked = program.demands.without_gain
        energies: list[Term] = [
            EnergyTerm(EnergyProblem(standard_plant(plant.nominal()), family, asked))
            for plant in program.plants
        ]
        peaks: list[Term] = [
            PeakTerm(
                PeakProblem(plant, plant.performance_structure, family, asked),
                INSIDE * program.gamma,
            )
            for plant in limited.plants
        ]
        return [*energies, *peaks, *gain_limit(program, family)]

    found, said = searched(program, starts, terms_of, context)
    answer = None if found is None else program.answer(found, least=least_norm(program))
    return answer, Outcome.FAILED if answer is None else Outcome.SOLVED, said


def _common_lyapunov(program: H2HinfSynthesis, context: Context) -> list[StateSpace]:
    """The controller found with one Lyapunov matrix for both norms, if it can be a start."""
    n = program.plant.system.nstates
    if program.family is not None or (program.order is not None and program.order < n):
        return []
    free = H2HinfSynthesis(program.plant, program.gamma)
    if find_method(free, CONIC).unfit(free) is not None:
        return []
    answer, *_ = free.respond(CONIC, context)
    return [] if answer is None else [answer.K]


def _least_limited_norm(program: H2HinfSynthesis) -> MuSynthesis:
    """The problem of the least limited norm, as a mu synthesis in continuous time."""
    asked = asked_form(program, program.plant.system.nstates)
    asked["further_plants"] = tuple(one.perturbation() for one in program.further_plants)
    mu = MuSynthesis(program.plant.perturbation(), target=program.gamma, **asked)
    return mu.plane if program.plant.system.dt else mu


def _starts(program: H2HinfSynthesis, mu: MuSynthesis, context: Context) -> list[StateSpace]:
    """The given start; or starts with a small H2 norm, and starts with a small limited norm."""
    if program.start is not None:
        return [program.start]
    asked = asked_form(program, program.plant.system.nstates)
    asked["further_plants"] = tuple(one.nominal() for one in program.further_plants)
    h2 = H2Synthesis(program.plant.nominal(), **asked)
    every, *_ = claim_of_step(h2, riccati_step)
    near = [*energy_starts(h2, every, context), *_common_lyapunov(program, context)]
    dt = float(program.plant.system.dt or 0.0)
    try:
        near += [from_continuous_plane(one.K, dt) for one in found_starts(mu, context)]
    except NoStabilisingGainError:
        raise
    except SolverError:  # other starts may be enough
        pass
    return near
