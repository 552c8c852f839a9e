"""Methods of the rational model fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from workbench.accuracy import ANY_ACCURACY_ALIKE, DEFAULT_TOLERANCE, AccuracyRange
from workbench.executor import Context
from workbench.identification.rational_models.point import FitPoint
from workbench.identification.rational_models.program import RationalModelFit
from workbench.identification.rational_models.sections import section_descent
from workbench.identification.rational_models.starts import first_points
from workbench.identification.rational_models.steps import gauss_newton_minimum, linear_step
from workbench.identification.rational_models.storage import RationalModels
from workbench.program import Claim, method
from workbench.solvers import Outcome

REFINED_STARTS = 6
"""Number of starts of each order that are refined, the cheapest first."""
SHARES = tuple(0.5**k for k in range(12))
"""Fractions of a regression's change that are tried until the cost decreases."""
MOST_REGRESSIONS = 200
"""Most regressions with instruments from one start."""
SETTLED_COST = 1e-12
"""Relative change of the cost at which regressions with instruments end."""
NEGLIGIBLE_RISE = 1e-6
"""Largest relative rise of the cost at which a zero is dropped because the delay has the same
effect.
"""

Refinement = Callable[[FitPoint], FitPoint]

IPOPT_ACCURACY_RANGE = AccuracyRange(1e-8, DEFAULT_TOLERANCE)
"""Tolerances of IPOPT; with coarser ones the answers are not stationary enough to be certified."""


@method(RationalModelFit, "levenberg-marquardt", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _levenberg_marquardt(program: RationalModelFit, context: Context) -> Claim:
    """Damped Gauss-Newton steps of the poles from several starts, numerators eliminated."""
    return _by_order(program, context, gauss_newton_minimum, REFINED_STARTS)


def _unfit_for_instruments(program: RationalModelFit) -> str | None:
    """The reason why regressions cannot answer a program; None if they can."""
    if program.delay_bounds is not None:
        return "a delay is not linear in any equation error; give it, or take another method"
    return None


@method(
    RationalModelFit,
    "instruments",
    optimal=False,
    unfit=_unfit_for_instruments,
    accuracy=ANY_ACCURACY_ALIKE,
)
def _instruments(program: RationalModelFit, context: Context) -> Claim:
    """Linear regressions with refined instruments, repeated until they settle."""
    return _by_order(program, context, _by_instruments, REFINED_STARTS)


@method(RationalModelFit, "ipopt", optimal=False, accuracy=IPOPT_ACCURACY_RANGE)
def _ipopt(program: RationalModelFit, context: Context) -> Claim:
    """Nonlinear program in second-order sections, with exact second derivatives."""
    return _by_order(program, context, lambda point: section_descent(point, context), 2)


def _by_order(
    program: RationalModelFit, context: Context, refine: Refinement, starts: int
) -> Claim:
    """The refined point of least cost for each order; each is a start for the next order."""
    found: list[FitPoint] = []
    for order in context.track(list(program.orders), "orders"):
        points = first_points(program.structure, order, starts, found[-1:])
        refined = [refine(point) for point in points]
        best = min(refined, key=lambda point: point.cost)
        fewer = _without_a_zero(best, refine)
        as_good = fewer is not None and fewer.cost <= best.cost * (1 + NEGLIGIBLE_RISE)
        found.append(fewer if fewer is not None and as_good else best)
    if not all(np.isfinite(point.cost) for point in found):
        return None, Outcome.FAILED, "no start gives a model with finite errors"
    models = tuple(point.model() for point in found)
    return RationalModels(models, program.choose(models)), Outcome.SOLVED, ""


def _without_a_zero(point: FitPoint, refine: Refinement) -> FitPoint | None:
    """The minimum with one zero less in each entry, if a delay is fitted.

    To first order a delay and a zero at infinity change a response in the same way. A minimum of
    the larger model with its zeros at infinity is therefore singular, and steps only approach it
    slowly.
    """
    structure = point.structure
    if not structure.free_delay or (structure.excess >= point.poles.size).any():
        return None
    fewer = replace(structure, excess=structure.excess + 1)
    return refine(FitPoint(fewer, point.poles, point.delay))


def _by_instruments(point: FitPoint) -> FitPoint:
    """The point reached by regressions with the model's own slopes, with decreasing cost."""
    for _ in range(MOST_REGRESSIONS if point.poles.size else 0):
        instruments = point.slopes[:, : point.poles.size]
        tried = (linear_step(point, instruments, share) for share in SHARES)
        after = next((each for each in tried if each and each.cost < point.cost), None)
        if after is None:
            break
        settled = point.cost - after.cost <= SETTLED_COST * point.cost
        point = after
        if settled:
            break
    return point
