"""Globally optimal magnitude fits by differential correction: a convex program each step.

|W|^2 = N / D in x = omega^2. A worst error e asks for l(e)^2 m^2 D <= N <= h(e)^2 m^2 D and
N, D > 0: linear in N and D. At the error e_k of (N_k, D_k) a step maximises t with

    h^2 m^2 D - N >= t (h^2)' m^2 D_k,    N - l^2 m^2 D >= -t (l^2)' m^2 D_k

over all positive N, D; t = 0 proves e_k optimal, and otherwise the error falls, in the end
quadratically (Barrodale, Powell and Roberts, SIAM J. Numerical Analysis 9, 1972, where l and h are
linear).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import RealArray
from workbench.executor import Context
from workbench.fitting.magnitude.gain import Target, finished, target_of
from workbench.fitting.magnitude.program import MagnitudeFit
from workbench.fitting.magnitude.sanathanan_koerner import sanathanan_koerner
from workbench.fitting.magnitude.squared import SquaredBasis, stable_roots
from workbench.fitting.rational import Rational

RETREATS = 2
"""Orders by which the search for a better start goes down."""
EXCHANGES = 4
"""Rounds in which points are added between the data of a cover."""
STEPS = 40
"""Steps at most; a few are usual."""
FINE = 1e-10
"""Depth between the data up to which a cover is left to the last rounding."""
LEAST_SHARE = 1e-3
"""Least share of a step that is tried."""
PLAIN = 4
"""Plain corrections in a row."""
OPTIMAL = 1e-10
"""Relative fall of the error still possible at which it counts as least."""
STALLED = 1e-4
"""Relative distance from what is unreachable at which a stalled search ends."""
MATCHED = 1e-12
"""Error at which data count as matched."""


@dataclass(frozen=True)
class Step:
    """One linear program over positive polynomials relative to the current ones.

    Rows of ``upper`` and ``lower`` act on the coefficients of N and D: their product is at least
    t times ``upper_slope`` and ``lower_slope``. ``mean`` of D is 1.
    """

    numerator: SquaredBasis
    denominator: SquaredBasis
    upper: RealArray
    upper_slope: RealArray
    lower: RealArray
    lower_slope: RealArray
    mean: RealArray


Solver = Callable[[Step], tuple[RealArray, RealArray, float] | None]
"""Coefficients of N and D and the t reached; None where there is no answer."""


def minimax(
    program: MagnitudeFit, solver: Solver, context: Context, retreats: int = RETREATS
) -> Rational:
    """The best fit; where its alternation does not prove that, also from a fit of lower order.

    ``retreats`` limits how many orders lower that goes.
    """
    target = target_of(program)

    def corrected(start: Rational) -> Rational:
        fit = _covering_correction(target, start, solver, context)
        return finished(target, fit.zeros, fit.poles)

    def proven(fit: Rational) -> bool:
        return abs(program.gap(fit)[1]) <= context.options.accuracy

    fit = corrected(sanathanan_koerner(target, program.order))
    if program.order == 0 or retreats == 0 or proven(fit):
        return fit
    lower = minimax(program.with_order(program.order - 1), solver, context, retreats - 1)
    if proven(lower):  # a degenerate optimum: it has no use for the order
        return lower
    middle = -np.sqrt(target.omega[0] * target.omega[-1])
    grown = corrected(
        Rational(np.append(lower.zeros, middle), np.append(lower.poles, middle), lower.gain)
    )
    return min((fit, lower, grown), key=program.error)


def _covering_correction(
    target: Target, start: Rational, solver: Solver, context: Context
) -> Rational:
    """The best fit; of a cover with points between the data added where it is too low."""
    fit = _differential_correction(replace(target, cover=False), start, solver, context)
    if not target.cover:
        return fit
    for _ in range(EXCHANGES):
        target, least = target.with_valleys(fit)
        fit = _differential_correction(target, fit, solver, context)
        if least > (1 - FINE) * target.ratio(fit).min():
            break
    return fit


def _differential_correction(
    target: Target, start: Rational, solver: Solver, context: Context
) -> Rational:
    """The best fit with as many roots as the start has."""
    error, fit = target.best(start)
    unreachable, plain, lost = 0.0, 0, 0
    for _ in context.track(range(STEPS), "differential correction"):
        if error <= MATCHED:
            break
        # far from the optimum corrections may be slow: then ask for half of what may be left
        asked = error if plain < PLAIN else (error + unreachable) / 2
        step = _step(target, fit, error, asked)
        found = solver(step)
        if found is None:
            break
        new_error, new_fit = _along(target, error, step, found)
        if asked < error:
            plain = 0
            unreachable = asked if found[2] < 0 else unreachable
        else:
            plain += 1
            if found[2] < OPTIMAL:
                break
            if error - new_error < found[2] * error / 2:
                plain = PLAIN
        lost = 0 if new_error < error else lost + 1
        if lost > 2 or (lost and unreachable > error * (1 - STALLED)):
            break
        if not lost:
            error, fit = new_error, new_fit
    return fit


def _along(
    target: Target, error: float, step: Step, found: tuple[RealArray, RealArray, float]
) -> tuple[float, Rational]:
    """The fit found, or one on the way to it, where the error is less too by quasi-convexity."""
    bases, share = (step.numerator, step.denominator), 1.0
    while True:
        zeros, poles = (
            stable_roots(
                basis.zeros(share * new + (1 - share) * basis.columns.mean(axis=0)), target.omega
            )
            for basis, new in zip(bases, found[:2], strict=True)
        )
        new_error, fit = target.best(Rational(zeros, poles, 1.0))
        if new_error < error or share < LEAST_SHARE:
            return new_error, fit
        share /= 4


def _step(target: Target, fit: Rational, error: float, asked: float) -> Step:
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
    return Step(
        numerator,
        denominator,
        np.hstack([-top[bounded], h**2 * bottom[bounded]]) / error,
        2 * h[:, 0] / weight,
        np.hstack([top, -(low[:, None] ** 2) * bottom]) / error,
        slope / error,
        bottom.mean(axis=0),
    )
