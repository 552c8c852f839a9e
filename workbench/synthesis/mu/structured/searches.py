"""Searches over a family for Programs with several plants or with limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from workbench._core.heavy_types import StateSpace
from workbench.certify.norms import NORM_TOLERANCE
from workbench.errors import InputError, SolverError
from workbench.executor import Context
from workbench.synthesis.families.demands import Shippable
from workbench.synthesis.families.family import Family
from workbench.synthesis.families.modal import Modal
from workbench.synthesis.families.synthesis import ControllerSynthesis
from workbench.synthesis.mu.program import PEAK_TOLERANCE, MuSynthesis
from workbench.synthesis.mu.rounds import Iterate
from workbench.synthesis.mu.structured.limited import (
    SearchPoint,
    best_descent,
    drawn_points,
    first_point,
)
from workbench.synthesis.mu.structured.problem import PeakProblem
from workbench.synthesis.mu.structured.starts.search import Start
from workbench.synthesis.mu.structured.terms import PeakTerm, Term, gain_term
from workbench.systems.bilinear import from_continuous_plane, in_continuous_plane

INSIDE = 1.0 - 2.0 * NORM_TOLERANCE
"""A search stays below this share of a limit, so that the proven norm satisfies the limit."""
NO_NORM = "no start was found whose loops are stable and have finite norms"
"""Message if there is no start."""
NOT_MET = "no controller within the limits was found; the nearest exceeds one by"
"""Message if a limit does not hold."""

Terms = Callable[[Family], Sequence[Term]]
"""Function: family -> the terms of a search in the family's parameters."""


def peak_terms(program: MuSynthesis, family: Family) -> list[Term]:
    """Terms for the peak of mu of each plant and for the limit on the controller's gain."""
    asked = program.demands.without_gain
    peaks = [
        PeakTerm(PeakProblem(plant, plant.performance_structure, family, asked))
        for plant in program.plants
    ]
    return [*peaks, *gain_limit(program, family)]


def gain_limit(program: MuSynthesis | ControllerSynthesis, family: Family) -> list[Term]:
    """The term for the limit on the controller's gain, if there is a limit."""
    gain = program.demands.gain
    if gain is None:
        return []
    plant = program.plants[0]
    return [gain_term(family, plant.measurements, plant.controls, INSIDE * gain)]


def limited_search(
    program: MuSynthesis, starts: Sequence[Start], context: Context
) -> tuple[list[Iterate], str]:
    """Rounds that lower the largest peak over all plants within the limit on the gain."""
    rules = [start.rule for start in starts]
    target = (program.target or 0.0) / (1 + PEAK_TOLERANCE)
    places, said, number = _best_descent_from(
        program,
        [start.K for start in starts],
        lambda family: peak_terms(program, family),
        context,
        target,
        program.random,
    )
    rounds = [
        Iterate(place.norm, math.nan, math.nan, place.family.system(place.x))
        for place in places
        if place.excess == 0.0
    ]
    if not rounds:
        raise SolverError(f"{NOT_MET} {places[-1].excess:.2%}")
    for count, each in enumerate(rounds, start=1):
        context.record(each.row(count))
    rule = rules[number] if number < len(rules) else "a random start"
    return rounds, f"started from {rule}; {said}"


def searched(
    program: ControllerSynthesis, starts: Sequence[StateSpace], terms_of: Terms, context: Context
) -> tuple[StateSpace | None, str]:
    """The best controller found, in the plant's time, and a message; None if none was found."""
    try:
        places, said, _ = _best_descent_from(program, starts, terms_of, context, 0.0, 0)
    except SolverError as error:
        return None, str(error)
    last = places[-1]
    if last.excess > 0.0:
        return None, f"{NOT_MET} {last.excess:.2%}"
    context.record({"norm": last.norm})
    dt = float(program.plant.system.dt or 0.0)
    return from_continuous_plane(last.family.system(last.x), dt), said


def _best_descent_from(
    program: MuSynthesis | ControllerSynthesis,
    starts: Sequence[StateSpace],
    terms_of: Terms,
    context: Context,
    target: float,
    random: int,
) -> tuple[list[SearchPoint], str, int]:
    """The best descent, the reason for its end, and the index of its start. Raises SolverError
    without a start.
    """
    places: list[SearchPoint] = []
    numbers = []
    for number, K in enumerate(starts):
        try:
            family, x = (program.family or Modal(K.nstates)).about(in_continuous_plane(K))
            places.append(first_point(family, terms_of, x))
        except (InputError, SolverError):  # it is no member, or its norm is not finite
            continue
        numbers.append(number)
    if not places:
        raise SolverError(NO_NORM)
    drawn = list(drawn_points(places[0], random, context.rng))
    numbers += [len(starts)] * len(drawn)
    demands: Shippable = program.demands
    history, said, won = best_descent(
        [*places, *drawn],
        lambda family: family.halfspaces(demands.stable, demands.fastest),
        context,
        target,
    )
    return history, said, numbers[won]
