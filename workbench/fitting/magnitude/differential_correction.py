"""Globally optimal magnitude fits by differential correction: each step is a convex program.

|W|^2 = N / D in x = omega^2. A worst error e requires l(e)^2 m^2 D <= N <= h(e)^2 m^2 D and
N, D > 0, which is linear in N and D. At the error e_k of (N_k, D_k) a step maximises t subject to

    h^2 m^2 D - N >= t (h^2)' m^2 D_k,    N - l^2 m^2 D >= -t (l^2)' m^2 D_k

over all positive N, D. If t = 0, e_k is proven optimal; otherwise the error falls, at last
quadratically (Barrodale, Powell and Roberts, SIAM J. Numerical Analysis 9, 1972, for linear l, h).
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.fitting.magnitude.gain import Target, target_of, with_best_gain
from workbench.fitting.magnitude.program import MagnitudeFit
from workbench.fitting.magnitude.sanathanan_koerner import sanathanan_koerner
from workbench.fitting.magnitude.sb10yd import fit_with_phase
from workbench.fitting.magnitude.squared import SquaredBasis, stable_roots
from workbench.fitting.rational import Rational

MAX_ORDER_REDUCTIONS = 2
"""Largest number of orders by which the search for a better start is reduced."""
MAX_VALLEY_ROUNDS = 4
"""Largest number of rounds in which points between the data of a cover are added."""
MAX_CORRECTIONS = 40
"""Largest number of steps of differential correction; a few are usual."""
VALLEY_TOLERANCE = 1e-10
"""Largest relative depth of a cover below the data, between them, that the final gain may
repair.
"""
MIN_STEP_SHARE = 1e-3
"""Smallest share of a step that is tried."""
MAX_PLAIN_CORRECTIONS = 4
"""Largest number of plain corrections in a row; after that, half of the possible improvement is
asked for.
"""
OPTIMAL_FALL = 1e-10
"""The error counts as optimal if t, its possible relative decrease, is below this."""
STALLED_DISTANCE = 1e-4
"""A stalled search ends if the error is this close, relative, to an error known to be
unreachable.
"""
EXACT_FIT_ERROR = 1e-12
"""Worst error at or below which the data count as matched."""


@dataclass(frozen=True)
class CorrectionStep:
    """Data of one step: a linear program over positive polynomials N and D.

    N and D are given by coefficients in bases relative to the current polynomials. The rows of
    ``upper`` and ``lower`` times the coefficients of N and D must be at least t times
    ``upper_slope`` and ``lower_slope``; ``mean`` times the coefficients of D must be 1.
    """

    numerator: SquaredBasis
    denominator: SquaredBasis
    upper: RealArray
    upper_slope: RealArray
    lower: RealArray
    lower_slope: RealArray
    mean: RealArray


Solver = Callable[[CorrectionStep], tuple[RealArray, RealArray, float] | None]
"""Function of a step that gives the coefficients of N and D and t; None if it has no answer."""


def minimax(
    program: MagnitudeFit, solver: Solver, context: Context, retreats: int = MAX_ORDER_REDUCTIONS
) -> Rational:
    """The best fit; if it is not proven optimal, the best of several starts.

    The second start is a fit of magnitude and phase; others come from fits of lower order, at most
    ``retreats`` orders lower.
    """
    target = target_of(program)

    def proven(fit: Rational) -> bool:
        return abs(program.gap(fit)[1]) <= context.options.accuracy

    def plain(start: Rational) -> Rational:
        return _differential_correction(replace(target, cover=False), start, solver, context)

    def corrected(start: Rational) -> Rational:
        if not target.cover:
            found = plain(start)
            return with_best_gain(target, found.zeros, found.poles)
        found = _covering_correction(target, start, solver, context)
        fit = with_best_gain(target, found.zeros, found.poles)
        if proven(fit):
            return fit
        # The plain fit may be zero between the data, and from there no correction leads to a cover.
        near = plain(start)
        for end in (near, _covering_correction(target, near, solver, context)):
            fit = min(fit, with_best_gain(target, end.zeros, end.poles), key=program.error)
        return fit

    fit = corrected(sanathanan_koerner(target, program.order))
    if program.order == 0 or proven(fit):
        return fit
    with suppress(SolverError):  # if SLICOT gives no start, there are others
        fit = min((fit, corrected(fit_with_phase(program))), key=program.error)
    if retreats == 0 or proven(fit):
        return fit
    lower = minimax(program.with_order(program.order - 1), solver, context, retreats - 1)
    if proven(lower):  # a degenerate optimum: the higher order gains nothing
        return lower
    middle = -np.sqrt(target.omega[0] * target.omega[-1])
    grown = corrected(
        Rational(np.append(lower.zeros, middle), np.append(lower.poles, middle), lower.gain)
    )
    return min((fit, lower, grown), key=program.error)


def _covering_correction(
    target: Target, start: Rational, solver: Solver, context: Context
) -> Rational:
    """The best cover; points between the data are added where the fit is too low there."""
    fit = start
    known, _ = target.with_valleys(fit)
    for _ in range(MAX_VALLEY_ROUNDS):
        fit = _differential_correction(known, fit, solver, context)
        refined, least = known.with_valleys(fit)
        if least > (1 - VALLEY_TOLERANCE) * known.ratio(fit).min():
            break
        known = refined
    return fit


def _differential_correction(
    target: Target, start: Rational, solver: Solver, context: Context
) -> Rational:
    """The best fit with as many zeros and poles as the start has."""
    error, fit = target.best(start)
    unreachable, plain, lost = 0.0, 0, 0
    for _ in context.track(range(MAX_CORRECTIONS), "differential correction"):
        if error <= EXACT_FIT_ERROR:
            break
        # far from the optimum corrections may be slow: ask for half of the possible improvement
        asked = error if plain < MAX_PLAIN_CORRECTIONS else (error + unreachable) / 2
        step = _step(target, fit, error, asked)
        found = solver(step)
        if found is None:
            break
        new_error, new_fit = _line_search(target, error, step, found)
        if asked < error:
            plain = 0
            unreachable = asked if found[2] < 0 else unreachable
        else:
            plain += 1
            if found[2] < OPTIMAL_FALL:
                break
            if error - new_error < found[2] * error / 2:
                plain = MAX_PLAIN_CORRECTIONS
        lost = 0 if new_error < error else lost + 1
        if lost > 2 or (lost and unreachable > error * (1 - STALLED_DISTANCE)):
            break
        if not lost:
            error, fit = new_error, new_fit
    return fit


def _line_search(
    target: Target, error: float, step: CorrectionStep, found: tuple[RealArray, RealArray, float]
) -> tuple[float, Rational]:
    """Error and fit at the end of a step or, if the error is not smaller there, at a point on the
    way.

    By quasi-convexity the error decreases on the way too.
    """
    bases, share = (step.numerator, step.denominator), 1.0
    while True:
        zeros, poles = (
            stable_roots(
                basis.zeros(share * new + (1 - share) * basis.columns.mean(axis=0)), target.omega
            )
            for basis, new in zip(bases, found[:2], strict=True)
        )
        new_error, fit = target.best(Rational(zeros, poles, 1.0))
        if new_error < error or share < MIN_STEP_SHARE:
            return new_error, fit
        share /= 4


def _step(target: Target, fit: Rational, error: float, asked: float) -> CorrectionStep:
    """Data of the step from a fit of a given error towards an error ``asked``."""
    numerator = SquaredBasis(fit.zeros, target.omega)
    denominator = SquaredBasis(fit.poles, target.omega)
    top = target.ratio(fit)[:, None] ** 2 * numerator.columns
    bottom = denominator.columns
    low, high = target.limits(asked)
    bounded = target.weight > 0
    weight = target.weight[bounded]
    slope = 0 * low if target.cover else 2 * low
    slope[bounded] *= error / weight
    h = high[bounded, None]
    return CorrectionStep(
        numerator,
        denominator,
        np.hstack([-top[bounded], h**2 * bottom[bounded]]) / error,
        2 * h[:, 0] / weight,
        np.hstack([top, -(low[:, None] ** 2) * bottom]) / error,
        slope / error,
        bottom.mean(axis=0),
    )
