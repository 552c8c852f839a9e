"""Methods for the least H-infinity norm over controllers of an order or a family.

All take the same starts and differ in how they go down: by BFGS and sampled gradients, within a
trust region on all linearisations near the peak, by IPOPT on smoothed norms, or by evolution.
Method "fixed" begins with BFGS from every start and goes on from the best. Where its two best ends
differ, it hops and evolves from the best one. For several plants or under a limit of the gain it is
the trust region.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.certify.norms import certified_norm
from workbench.errors import InputError, SolverError, TimeLimitError
from workbench.executor import Context
from workbench.executor.clock import time_is_up
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.synthesis.h_infinity.program import HinfController, HinfSynthesis
from workbench.synthesis.mu.program import MuSynthesis
from workbench.synthesis.mu.structured.least_norm import (
    asked_form,
    by_trust_region,
    least_of_all,
    nothing_asked,
)
from workbench.synthesis.mu.structured.nonsmooth.bfgs import stationarity
from workbench.synthesis.mu.structured.norm import descents
from workbench.synthesis.mu.structured.norm.search import NormPoint, NormSearch
from workbench.synthesis.mu.structured.starts.found import NoStabilisingGainError
from workbench.systems.bilinear import bilinear_sampled
from workbench.systems.generalised_plant import GeneralisedPlant

FINALISTS = 3
"""Starts that go on after the first steps of each."""
HOPS, ROUNDS = 6, 2
"""Hops from the best point before an evolution, and rounds of hops and evolution."""
GAINED = 1e-3
"""Share of the norm by which a round must lower it for another one to follow."""

AGREED = 1e-4
"""Relative difference of the best two ends of descents below which the search goes no further."""

Descent = Callable[[NormPoint, Context], NormPoint]


def _limited(program: HinfSynthesis) -> bool:
    """Whether there are several plants or a limit of the gain, which one norm does not tell."""
    return bool(program.further_plants) or program.largest_gain is not None


def _unfit(program: HinfSynthesis) -> str | None:
    if _limited(program):
        return "it takes one plant and no limit of the gain: ask fixed or trust_region"
    return nothing_asked(program)


@method(HinfSynthesis, "fixed", optimal=False, unfit=nothing_asked, accuracy=ANY_ACCURACY_ALIKE)
def _fixed(program: HinfSynthesis, context: Context) -> Claim:
    """BFGS from several starts; at kinks sampled gradients, random hops and evolution go on."""
    if _limited(program):
        return by_trust_region(program, context)
    return _claim(program, context, _by_bfgs, _on)


@method(HinfSynthesis, "bfgs", optimal=False, unfit=_unfit, accuracy=ANY_ACCURACY_ALIKE)
def _bfgs(program: HinfSynthesis, context: Context) -> Claim:
    """BFGS with a line search by Wolfe's weak conditions, then sampled gradients."""
    return _claim(program, context, _by_bfgs, lambda point, _: point)


@method(HinfSynthesis, "smoothed", optimal=False, unfit=_unfit, accuracy=ANY_ACCURACY_ALIKE)
def _smoothed(program: HinfSynthesis, context: Context) -> Claim:
    """IPOPT, through CasADi, on power means over frequencies that tend to the norm."""
    return _claim(program, context, _by_smoothing, lambda point, _: point)


@method(HinfSynthesis, "evolution", optimal=False, unfit=_unfit, accuracy=ANY_ACCURACY_ALIKE)
def _evolution(program: HinfSynthesis, context: Context) -> Claim:
    """Evolution of a normal distribution (CMA-ES), which takes no slopes."""
    return _claim(program, context, _by_evolution, lambda point, _: point)


def _by_bfgs(point: NormPoint, context: Context) -> NormPoint:
    return descents.along_kinks(descents.by_bfgs(point), context.rng)


def _by_smoothing(point: NormPoint, _: Context) -> NormPoint:
    return descents.by_smoothing(point)


def _by_evolution(point: NormPoint, context: Context) -> NormPoint:
    return descents.by_evolution(point, context.rng)


def _on(point: NormPoint, context: Context) -> NormPoint:
    """The best point of rounds of hops and evolution, while they gain."""
    for _ in range(ROUNDS):
        before = point.value
        point = descents.hopped(point, context.rng, HOPS)
        point = _by_bfgs(descents.by_evolution(point, context.rng), context)
        if not point.value < (1 - GAINED) * before or time_is_up("hops and evolution"):
            break
    return point


def _claim(program: HinfSynthesis, context: Context, descent: Descent, on: Descent) -> Claim:
    """The controller where the best descent ends, with what the other starts reached."""
    given = program.absorbed.plant
    bare = GeneralisedPlant(given.system, None, given.controls, given.measurements)
    stated = MuSynthesis(bare, **asked_form(program, given.system.nstates))
    dt = float(given.system.dt or 0.0)
    search = NormSearch(stated.plane if dt else stated, context)
    try:
        starts = search.starts()
    except NoStabilisingGainError:
        return None, Outcome.INFEASIBLE, ""
    except TimeLimitError:
        raise
    except SolverError as error:
        return None, Outcome.FAILED, str(error)
    ended = _descended(program, context, starts, descent)
    best = ended[0]
    if not (_enough(program, best) or _agreed(ended)):
        best = on(best, context)
    K = bilinear_sampled(best.controller, dt) if dt else best.controller
    try:
        size = certified_norm(given.close(K))
    except (InputError, SolverError) as error:
        return None, Outcome.FAILED, str(error)
    level = size if program.gamma is None else program.gamma
    least = least_of_all(program, size) if program.gamma is None else math.nan
    slope = stationarity(best.scaled, np.zeros(len(best.x)), context.rng)
    reached = tuple(sorted(point.value for point in ended))
    answer = HinfController(K, size, level, least=least, reached=reached, slope=slope)
    return answer, Outcome.SOLVED, f"searched from {len(starts)} starts"


def _descended(
    program: HinfSynthesis, context: Context, starts: Sequence[NormPoint], descent: Descent
) -> list[NormPoint]:
    """Where descents from the best starts end, the best first: first some steps from each."""
    ahead = []
    for start in starts:
        ahead.append(start if time_is_up("first steps") else descents.first_steps(start))
        context.progress("first steps", len(ahead), len(starts))
    ahead.sort(key=lambda point: point.value)
    ended: list[NormPoint] = []
    for number, point in enumerate(ahead[:FINALISTS], start=1):
        late = time_is_up("descents") or (ended and _enough(program, min(ended, key=_value)))
        ended.append(point if late else descent(point, context))
        context.record({"start": number, "norm": ended[-1].value})
        context.progress("descents", number, FINALISTS)
    return sorted([*ended, *ahead[FINALISTS:]], key=_value)


def _value(point: NormPoint) -> float:
    return point.value


def _agreed(ended: Sequence[NormPoint]) -> bool:
    """Whether descents from two starts ended at the same norm, the least."""
    return len(ended) > 1 and ended[1].value <= (1 + AGREED) * ended[0].value


def _enough(program: HinfSynthesis, point: NormPoint) -> bool:
    """Whether the level that is asked for is reached."""
    return program.gamma is not None and point.value <= program.gamma
