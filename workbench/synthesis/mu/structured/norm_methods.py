"""Methods for the least H-infinity norm over controllers of an order or a family.

All have the same starts. They differ in the descent: BFGS and gradient sampling, a trust region on
all linearisations near the peak, IPOPT on smoothed norms, or evolution. Method "fixed" begins with
BFGS from every start and continues from the best ones. If its two best ends differ, it continues
from the other starts and from further random ones; then it uses random hops and evolution from the
best one. For several plants or a limit on the gain, it uses the trust region.
"""

from __future__ import annotations

import math

import numpy as np

from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.certify.norms import certified_norm
from workbench.errors import InputError, SolverError, TimeLimitError
from workbench.executor import Context
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.synthesis.h_infinity.program import HinfController, HinfSynthesis
from workbench.synthesis.mu.structured.least_norm import (
    by_trust_region,
    least_of_all,
    nothing_asked,
    without_perturbation,
)
from workbench.synthesis.mu.structured.nonsmooth.bfgs import stationarity
from workbench.synthesis.mu.structured.norm import descents
from workbench.synthesis.mu.structured.norm.ends import (
    Descent,
    bfgs,
    bfgs_along_kinks,
    hops_and_evolution,
    search_ends,
)
from workbench.synthesis.mu.structured.norm.search import NormPoint
from workbench.synthesis.mu.structured.starts.found import NoStabilisingGainError
from workbench.systems.bilinear import bilinear_sampled


def _limited(program: HinfSynthesis) -> bool:
    """Whether there are several plants or a limit on the gain, which a single norm does not
    describe.
    """
    return bool(program.further_plants) or program.largest_gain is not None


def _unfit(program: HinfSynthesis) -> str | None:
    if _limited(program):
        return "it takes one plant and no limit on the gain: ask fixed or trust_region"
    return nothing_asked(program)


@method(HinfSynthesis, "fixed", optimal=False, unfit=nothing_asked, accuracy=ANY_ACCURACY_ALIKE)
def _fixed(program: HinfSynthesis, context: Context) -> Claim:
    """BFGS from several starts, and more if their ends differ; then hops and evolution at kinks."""
    if _limited(program):
        return by_trust_region(program, context)
    return _claim(program, context, bfgs, hops_and_evolution)


@method(HinfSynthesis, "bfgs", optimal=False, unfit=_unfit, accuracy=ANY_ACCURACY_ALIKE)
def _bfgs(program: HinfSynthesis, context: Context) -> Claim:
    """BFGS with a line search by Wolfe's weak conditions, then gradient sampling."""
    return _claim(program, context)


@method(HinfSynthesis, "smoothed", optimal=False, unfit=_unfit, accuracy=ANY_ACCURACY_ALIKE)
def _smoothed(program: HinfSynthesis, context: Context) -> Claim:
    """IPOPT, through CasADi, on power means over frequencies that tend to the norm."""
    return _claim(program, context, _by_smoothing)


@method(HinfSynthesis, "evolution", optimal=False, unfit=_unfit, accuracy=ANY_ACCURACY_ALIKE)
def _evolution(program: HinfSynthesis, context: Context) -> Claim:
    """Evolution of a normal distribution (CMA-ES), which needs no gradients."""
    return _claim(program, context, _by_evolution)


def _by_smoothing(point: NormPoint, _: Context) -> NormPoint:
    return descents.by_smoothing(point)


def _by_evolution(point: NormPoint, context: Context) -> NormPoint:
    return descents.by_evolution(point, context.rng)


def _claim(
    program: HinfSynthesis,
    context: Context,
    descent: Descent = bfgs_along_kinks,
    on: Descent | None = None,
) -> Claim:
    """The controller at the end of the best descent, with the norms that the other starts
    reached.
    """
    given = program.absorbed.plant
    stated = without_perturbation(program)
    dt = float(given.system.dt or 0.0)
    try:
        found = search_ends(
            stated.plane if dt else stated, context, program.gamma or 0.0, descent, on
        )
    except NoStabilisingGainError:
        return None, Outcome.INFEASIBLE, ""
    except TimeLimitError:
        raise
    except SolverError as error:
        return None, Outcome.FAILED, str(error)
    best = found.best
    K = bilinear_sampled(best.controller, dt) if dt else best.controller
    try:
        size = certified_norm(given.close(K))
    except (InputError, SolverError) as error:
        return None, Outcome.FAILED, str(error)
    level = size if program.gamma is None else program.gamma
    least = least_of_all(program, size) if program.gamma is None else math.nan
    slope = stationarity(best.scaled, np.zeros(len(best.x)), context.rng)
    answer = HinfController(K, size, level, least=least, reached=found.reached, slope=slope)
    return answer, Outcome.SOLVED, f"searched from {found.starts} starts"
