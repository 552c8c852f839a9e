"""Methods of covers: the nominal is fitted to centres, or all parts are optimised for small
sets.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.uncertainty.covers.circle_cover import CircleCover
from workbench.uncertainty.covers.cover import UncertaintyCover
from workbench.uncertainty.covers.finish import fitted_cover, raised_cover
from workbench.uncertainty.covers.joint.population import different_models, least_inflations
from workbench.uncertainty.covers.joint.search import FoundModel, smallest_model
from workbench.uncertainty.covers.joint.starts import starts
from workbench.uncertainty.covers.nominal import nominal_fit
from workbench.uncertainty.covers.sides import warn_of_unstable
from workbench.uncertainty.covers.stadium_cover import StadiumCover
from workbench.uncertainty.covers.steps import CoverSteps
from workbench.uncertainty.covers.weights import fitted

TRIAL_FREQUENCIES, TRIAL_POWERS = 100, (4, 16)
"""Largest number of frequencies at which starts are tried, and the powers of the norms there.
Trials only choose where to continue. Half or double: coarser and faster ones, or finer and slower
ones.
"""
FINAL_FREQUENCIES, FINAL_POWERS = 1000, (16, 64, 256)
"""The same for the search that continues from the smallest models found. The last power exceeds the
largest value by 3 %. With half of them peaks between frequencies are covered by the gain; double
takes twice as long.
"""
CONTINUED = 6
"""Number of the smallest models from which the search continues. The smallest after trials is not
always the smallest at the end. With half of them a cover may be larger; double takes twice as long.
"""
DRAWN, DRAWN_SPREAD = 4, 0.5
"""Number of searches from random starts around each of these models, and standard deviation of the
starts in units of the parameters. The end of a single search may depend on the data's last bits.
Half or double of the number: covers that depend more or less on last bits, and the time; of the
spread: starts that lead back, or that are random.
"""
INFLATION_FREQUENCIES = 150
"""Largest number of frequencies at which models of least inflation are sought, if those of known
resonances are among them. Which frequencies lead to the better local optimum differs from case to
case, so the search runs with and without them. Half or double: coarser and faster trials, or finer
and slower ones; all ends are searched at all frequencies.
"""
CLOSE_POWERS = (16, 32, 32, 64, 128, 256, 256)
"""Powers of the norms for the inflation at all frequencies. The raw sets about the nominal are
those at the start of each search, so the last one is repeated. The norm of power 256 exceeds the
largest value by 3 % at most for 2000 terms. Half of all ends 3 % farther; double of all ends at
worse local optima.
"""
CLOSE_STEPS = 60
"""Largest number of quasi-Newton steps in each of these searches. Each search starts near its
optimum. With half of them covers are a little larger; double costs time.
"""
LEAST_CONTINUED = 2
"""Number of models of least inflation that are continued at all frequencies. Which of them covers
best is known only at the end. Half may miss the better one; double takes twice as long.
"""
ALIKE = 1e-3
"""Relative difference of sizes below which two models count as the same local optimum. Searches to
one optimum end within less. With half of it copies may be continued; with double of it neighbours
count as one.
"""


@method(CircleCover, "steps", optimal=False)
@method(StadiumCover, "steps", optimal=False)
def _steps(program: UncertaintyCover, context: Context) -> Claim:
    """The steps of the thesis: the nominal is fitted to the centres of the first set."""
    warn_of_unstable(program.thinned(TRIAL_FREQUENCIES), context)
    first = program.first_set(program.points)
    nominal = program.nominal
    if nominal is None:
        nominal = program.realisable(fitted(nominal_fit(first.center, first, program), context))
    third = program.third_set(program.deviations_from(nominal, program.points))
    W_r = program.real_weight(third, context)
    return fitted_cover(program, first, nominal, third, W_r, context), Outcome.SOLVED, ""


@method(CircleCover, "joint", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
@method(StadiumCover, "joint", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _joint(program: UncertaintyCover, context: Context) -> Claim:
    """Nominal and weights are optimised together for the least mean square size of the sets."""
    warn_of_unstable(program.thinned(TRIAL_FREQUENCIES), context)
    searched = replace(program, zeros=program.useful_zeros)
    tried, said = _tried(_trial(searched), context)
    if not tried:
        return None, Outcome.FAILED, said
    fine = searched.thinned(FINAL_FREQUENCIES).refined()
    continued = different_models(tried, ALIKE)[:CONTINUED]
    found = [smallest_model(fine, start, FINAL_POWERS, context) for start in continued]
    return (
        _smallest_cover(program, found, context, program.refined().objective),
        Outcome.SOLVED,
        said,
    )


def _trial(program: UncertaintyCover) -> UncertaintyCover:
    """The program at few frequencies; if it has fewer, also at the frequencies of known
    resonances.
    """
    few = len(program.responses.omega) < TRIAL_FREQUENCIES
    return (program.refined() if few else program).thinned(TRIAL_FREQUENCIES)


def _tried(program: UncertaintyCover, context: Context) -> tuple[list[FoundModel], str]:
    """The smallest models found from every start, and a message about them."""
    found, said = [], []
    for name, start, failure in starts(program, context):
        if start is None:
            said.append(f"none from {name} ({failure})")
            continue
        model = smallest_model(program, start, TRIAL_POWERS, context)
        said.append(f"{model.size:.4g} from {name}")
        if math.isfinite(model.size):
            found.append(model)
    for model in different_models(found, ALIKE)[:CONTINUED]:
        drawn = [
            smallest_model(program, model, TRIAL_POWERS, context, DRAWN_SPREAD)
            for _ in range(DRAWN)
        ]
        found += [each for each in drawn if math.isfinite(each.size)]
    return found, f"mean square size {'; '.join(said)}"


@method(CircleCover, "inflation", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
@method(StadiumCover, "inflation", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _inflation(program: UncertaintyCover, context: Context) -> Claim:
    """Nominal and weights are optimised together for the least inflation over the raw sets."""
    if isinstance(program, CircleCover) and program.nominal is not None:  # W_c alone: convex
        about = program.second_set(program.deviations_from(program.nominal, program.points))
        cover = fitted_cover(program, program.raw_sets, program.nominal, about, None, context)
        return cover, Outcome.SOLVED, "the best weight about the given nominal"
    warn_of_unstable(program.thinned(TRIAL_FREQUENCIES), context)
    searched = replace(program, zeros=program.useful_zeros)
    fine = searched.thinned(FINAL_FREQUENCIES).refined()
    ranked: list[FoundModel] = []
    ends: list[FoundModel] = []
    for trial in (_trial(searched), searched.refined().thinned(INFLATION_FREQUENCIES)):
        begun = [start for _, start, _ in starts(trial, context) if start is not None]
        tried, said = _tried(trial, context)
        found = least_inflations(
            trial, [*begun, *different_models(tried, ALIKE)[:CONTINUED]], context
        )
        ranked += found
        for model in found[:LEAST_CONTINUED]:
            ends += _ends(fine, model, context)
    if not ranked:
        return None, Outcome.FAILED, said
    cover = _smallest_cover(
        program, ends or ranked, context, lambda cover: program.inflation(cover).largest
    )
    return cover, Outcome.SOLVED, f"{len(ranked)} local optima"


def _ends(program: UncertaintyCover, model: FoundModel, context: Context) -> list[FoundModel]:
    """Models at the ends of the searches from a model, with the inflation of their covers."""
    ends = []
    for power in CLOSE_POWERS:
        model = smallest_model(program, model, (power,), context, 0.0, "inflation", CLOSE_STEPS)
        try:
            cover = raised_cover(program, program, program.raw_sets, model, everywhere=False)
        except SolverError:
            continue
        ends.append(model._replace(size=program.inflation(cover).largest))
    return ends


def _smallest_cover(
    program: UncertaintyCover,
    found: list[FoundModel],
    context: Context,
    measure: Callable[[CoverSteps], float],
) -> CoverSteps:
    """The cover of least measure from the models with raised gains; with a fitted complex weight if
    no gain suffices.
    """
    fine = program if program.leave_out else program.refined()
    ranked = sorted(found, key=lambda model: model.size)
    best, least = None, float("inf")
    for model in ranked:
        if least <= model.size:  # a cover is hardly ever smaller than its model
            break
        try:
            cover = raised_cover(program, fine, program.raw_sets, model)
        except SolverError:
            continue
        size = measure(cover)
        if size < least:
            best, least = cover, size
    if best is not None:
        return best
    nominal, W_r = program.realisable(ranked[0].nominal), ranked[0].W_r
    third = program.third_set(program.deviations_from(nominal, program.points), W_r)
    return fitted_cover(program, program.raw_sets, nominal, third, W_r, context)
