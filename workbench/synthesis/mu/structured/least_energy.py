"""H2 synthesis over controllers of an order or a family, by descent along gradients.

The norm is a smooth function of a stabilising controller. Steps are those of BFGS with a line
search that treats an unstable loop as one with infinite norm (A. S. Lewis, M. L. Overton, Nonsmooth
optimization via quasi-Newton methods, Mathematical Programming 141 (2013) 135-163).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from scipy.linalg import LinAlgError

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.errors import InputError, SolverError, TimeLimitError
from workbench.executor import Context
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.synthesis.families.family import Family
from workbench.synthesis.families.modal import Modal
from workbench.synthesis.h2.methods import claim_of_step, riccati_step
from workbench.synthesis.h2.program import H2Controller, H2Synthesis
from workbench.synthesis.mu.program import MuSynthesis
from workbench.synthesis.mu.structured.energy import EnergyProblem
from workbench.synthesis.mu.structured.least_norm import asked_form, nothing_asked
from workbench.synthesis.mu.structured.minimax_step import known_units
from workbench.synthesis.mu.structured.searches import gain_limit, searched
from workbench.synthesis.mu.structured.starts.found import NoStabilisingGainError, found_starts
from workbench.synthesis.mu.structured.starts.search import DRAWS_PER_START, START_SPREAD
from workbench.synthesis.mu.structured.terms import EnergyTerm, Term
from workbench.synthesis.reduction import truncation
from workbench.synthesis.reduction.kept_part import kept_and_stable
from workbench.systems.bilinear import from_continuous_plane, in_continuous_plane
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.realisation import matrices_of, realisation
from workbench.systems.standard_plant import standard_plant

NO_NORM = "no start was found whose loop is stable and has a finite norm"
"""Message if there is no start. In continuous time w -> z must have no direct term."""
MOST_STEPS = 300
"""Largest number of steps from one start."""
FALL, SLOPE = 1e-4, 0.9
"""Constants of Wolfe's weak conditions in a line search: share of the predicted decrease, and share
of the slope that may remain.
"""
MOST_HALVINGS = 40
"""Largest number of trials in a line search."""
SETTLED_FALL = 1e-9
"""The descent is settled if a step lowers the norm by less than this share."""


@method(H2Synthesis, "fixed", optimal=False, unfit=nothing_asked, accuracy=ANY_ACCURACY_ALIKE)
def _fixed(program: H2Synthesis, context: Context) -> Claim:
    """Quasi-Newton descent over a family or an order, from a given start or found ones."""
    every, *_ = claim_of_step(program, riccati_step)
    try:
        begun = energy_starts(program, every, context)
    except NoStabilisingGainError:
        return None, Outcome.INFEASIBLE, ""
    if program.further_plants or program.largest_gain is not None:
        return _within_gain_limit(program, begun, context)
    best: H2Controller | None = None
    said = NO_NORM
    for K in context.track(begun, "starts"):
        try:
            found, said = _descent(program, K, context)
        except (InputError, LinAlgError):  # it is no member, or its poles cannot form a block
            continue
        except TimeLimitError:
            said = f"the time ended after {len(context.rows)} starts"
            break
        answer = None if found is None else program.answer(found)
        if answer is None:
            continue
        context.record({"norm": answer.norm})
        if best is None or answer.norm < best.norm:
            best = answer
    if best is None:
        return None, Outcome.FAILED, said
    least = math.nan if every is None else every.least
    return H2Controller(best.K, best.norm, least=least), Outcome.SOLVED, said


def _within_gain_limit(
    program: H2Synthesis, starts: Sequence[StateSpace], context: Context
) -> Claim:
    """Minimise the largest norm over all plants within the limit on the controller's gain."""

    def terms_of(family: Family) -> list[Term]:
        asked = program.demands.without_gain
        energies = [
            EnergyTerm(EnergyProblem(standard_plant(plant), family, asked))
            for plant in program.plants
        ]
        return [*energies, *gain_limit(program, family)]

    found, said = searched(program, starts, terms_of, context)
    answer = None if found is None else program.answer(found)
    if answer is None:
        return None, Outcome.FAILED, said
    leasts = [claim_of_step(H2Synthesis(plant), riccati_step)[0] for plant in program.plants]
    least = max((one.least for one in leasts if one is not None), default=math.nan)
    return H2Controller(answer.K, answer.norm, least=least), Outcome.SOLVED, said


def energy_starts(
    program: H2Synthesis, every: H2Controller | None, context: Context
) -> list[StateSpace]:
    """The given start; or the best of all controllers, reduced, and starts with a small H-infinity
    norm.
    """
    if program.start is not None:
        return [program.start, *_random_members(program, program.start, context.rng)]
    near = [] if every is None else list(_in_demanded_form(program, every.K))
    plant, dt = program.plant, float(program.plant.system.dt or 0.0)
    bare = GeneralisedPlant(plant.system, None, plant.controls, plant.measurements)
    mu = MuSynthesis(bare, **asked_form(program, plant.system.nstates))
    try:
        found = [one.K for one in found_starts(mu.plane if dt else mu, context)]
    except NoStabilisingGainError:
        raise
    except SolverError:
        found = []
    near += [from_continuous_plane(K, dt) for K in found]
    return near + [one for K in near[:1] for one in _random_members(program, K, context.rng)]


def _in_demanded_form(program: H2Synthesis, K: StateSpace) -> Iterator[StateSpace]:
    """A controller of any order, approximated by one of the demanded family or order."""
    if program.family is not None:
        dt = float(program.plant.system.dt or 0.0)
        omega = frequencies_of(in_continuous_plane(program.plant.close(K)))
        member = program.family.nearest(in_continuous_plane(K), omega, np.ones(len(omega)))
        if member is not None:
            yield from_continuous_plane(member, dt)
        return
    order = K.nstates if program.order is None else program.order
    if K.nstates <= order:
        yield K
    elif not K.dt:
        for least, way in (
            truncation.balanced_truncation(kept_and_stable(matrices_of(K))),
            truncation.matchdc(kept_and_stable(matrices_of(K))),
        ):
            if least <= order:
                yield realisation(way(order), 0.0)


def _problem(program: H2Synthesis, K: StateSpace) -> tuple[EnergyProblem, RealArray]:
    """The energy as a function of the parameters of the family, or of all controllers of K's
    order.
    """
    family, x = (program.family or Modal(K.nstates)).about(in_continuous_plane(K))
    return EnergyProblem(program.standard, family, program.demands), x


def _random_members(
    program: H2Synthesis, K: StateSpace, rng: np.random.Generator
) -> Iterator[StateSpace]:
    """Random members around a controller with stable loops, as many as the program asks for."""
    if not program.random:
        return
    problem, x = _problem(program, K)
    units, found = problem.family.units(x), 0
    for _ in range(DRAWS_PER_START * program.random):
        member = problem.without_direct(x + START_SPREAD * units * rng.normal(size=x.size))
        if found < program.random and math.isfinite(problem.value(member)):
            found += 1
            yield problem.controller(member)


def _descent(
    program: H2Synthesis, K: StateSpace, context: Context
) -> tuple[StateSpace | None, str]:
    """The controller at the end of a descent from K, and the reason for the end; None without a
    start.
    """
    problem, x = _problem(program, K)
    x = problem.without_direct(x)
    value = problem.value(x)
    if not math.isfinite(value):
        return None, NO_NORM
    free = np.asarray(problem.free_directions(x), dtype=float)
    sizes = known_units(problem.family.units(x), problem.slopes(x)[None], value)
    units = free.T @ (sizes[:, None] * free)
    slope = partial(_free_slope, problem, free)
    inverse, known = units @ units.T, False
    g = slope(x)
    for _ in range(MOST_STEPS):
        context.seconds_left("descent")
        direction = -inverse @ g
        found = _line_search(problem, x, value, g, free, direction)
        fallen = 0.0
        if found is not None:
            length, reached, turned = found
            s, y = length * direction, turned - g
            fallen = 1.0 - math.sqrt(reached / value) if value else 0.0
            x, value, g = x + free @ s, reached, turned
        if found is None or fallen < SETTLED_FALL:
            if not known:
                return problem.controller(x), "settled"
            inverse, known = units @ units.T, False  # old curvature may hide a descent
        elif s @ y > 0:
            if not known:
                inverse, known = inverse * (s @ y) / (y @ inverse @ y), True
            turn = np.eye(len(s)) - np.outer(s, y) / (s @ y)
            inverse = turn @ inverse @ turn.T + np.outer(s, s) / (s @ y)
    return problem.controller(x), f"stopped after {MOST_STEPS} steps"


def _free_slope(problem: EnergyProblem, free: RealArray, x: RealArray) -> RealArray:
    """Derivatives of the energy along the free directions."""
    return np.asarray(free.T @ problem.slopes(x))


def _line_search(
    problem: EnergyProblem,
    x: RealArray,
    value: float,
    g: RealArray,
    free: RealArray,
    direction: RealArray,
) -> tuple[float, float, RealArray] | None:
    """A step length that meets Wolfe's weak conditions, with energy and slopes there; None without
    one.
    """
    low, high, length = 0.0, math.inf, 1.0
    promised = float(g @ direction)
    if not promised < 0.0:
        return None
    best = None
    for _ in range(MOST_HALVINGS):
        there = x + length * (free @ direction)
        reached = problem.value(there)
        if reached < value + FALL * length * promised:
            slope = _free_slope(problem, free, there)
            best = length, reached, slope
            if slope @ direction >= SLOPE * promised:
                return best
            low = length
        else:
            high = length
        length = 2.0 * low if math.isinf(high) else (low + high) / 2.0
    return best
