"""Local refinement of a rational function: least squares first, then the smallest worst error."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench.fitting.factored import FactoredRational
from workbench.fitting.rational import Rational
from workbench.fitting.reach import within_reach
from workbench.fitting.response.fit_state import FitState
from workbench.fitting.response.interior_point import least_peak
from workbench.fitting.response.program import ResponseFit

LEAST_SQUARES_STEPS = 40
"""Largest number of Gauss-Newton steps of the least squares."""
REWEIGHTINGS = 8
"""Largest number of reweightings for the least peak, with one Gauss-Newton step each."""
DAMPING_TRIALS = 10
"""Number of dampings tried, each ten times the last, before a point counts as a minimum."""
EXACT_ERROR = 1e-12
"""If the worst error, relative to the largest weighted datum, is below this, only rounding is left
to fit.
"""
ERROR_ROUNDING = 1e-14
"""A worst error below this, relative to the largest weighted datum, is rounding only."""
MIN_LAWSON_WEIGHT = 1e-14
"""Smallest weight of Lawson's iteration, relative to the mean weight."""
FIT_ROOT_REACH = 1e9
"""Largest factor from the first or last frequency to a root."""
REACH_COST = 1e-4
"""Largest relative increase of the worst error that is accepted for bringing far roots within
reach.
"""
MIN_DAMPING = 1e-14
"""Smallest damping of a Gauss-Newton step, relative to the largest curvature."""


def factored(program: ResponseFit, start: Rational) -> FactoredRational:
    """The factored form of a function, with the constraints that the program asks for."""
    omega = program.active.omega
    band = float(omega[0]), float(omega[-1])
    return FactoredRational.of(
        start,
        program.zeros,
        band,
        program.stable or bool(program.unstable_poles),
        program.minimum_phase,
        program.unstable_poles,
    )


def worst_error(program: ResponseFit, fit: Rational) -> float:
    """The worst weighted error of a fit; infinite if it is not finite."""
    error = float(np.max(program.errors(fit)))
    return error if np.isfinite(error) else np.inf


def polished(program: ResponseFit, start: Rational) -> tuple[float, Rational]:
    """Smallest worst error found by a local search from ``start``, and the function that has it.

    The search first takes Levenberg-Marquardt steps to the weighted least squares. It then changes
    the weights by Lawson's rule (each weight is multiplied by its error; fixed points are minimax),
    and ends with the interior-point method at a local optimum.
    """
    form = factored(program, start)
    here = FitState(program, form, form.start)
    best = here
    even = np.ones(here.error.size)
    damping = 1e-6
    for _ in range(LEAST_SQUARES_STEPS):
        moved, damping = _step(here, even, damping)
        if moved is None:
            break
        gained = 1 - moved.square(even) / here.square(even)
        here = moved
        best = min(best, here, key=lambda point: point.peak)
        if gained < 1e-6:
            break
    weight = even
    for _ in range(REWEIGHTINGS):
        if here.peak <= ERROR_ROUNDING * program.size:
            break
        weight = weight * np.abs(here.error)
        weight = np.maximum(weight / weight.mean(), MIN_LAWSON_WEIGHT)
        moved, damping = _step(here, np.sqrt(weight), damping)
        if moved is None:
            break
        here = moved
        best = min(best, here, key=lambda point: point.peak)
    ends = [best]
    if EXACT_ERROR * program.size < best.peak < np.inf:
        ends = [least_peak(best), best]
    for end in ends:  # the first fit whose roots doubles can realise
        found = form.rational(end.vector)
        near = within_reach(found, program.active.omega, FIT_ROOT_REACH)
        peak = worst_error(program, near)
        if peak <= end.peak * (1 + REACH_COST):
            return peak, near
    return best.peak, found


def _step(here: FitState, weight: RealArray, damping: float) -> tuple[FitState | None, float]:
    """A point with a smaller weighted sum of squares, and the next damping.

    The point is None if no damping gives one.
    """
    slopes = weight[:, None] * here.slopes
    matrix = np.concatenate([slopes.real, slopes.imag])
    size = np.linalg.norm(matrix, axis=0)
    size[size == 0] = 1.0
    matrix /= size
    error = weight * here.error
    downhill = matrix.T @ np.concatenate([error.real, error.imag])
    # The Gram matrix is accurate enough and small: only the gradient decides where the steps end.
    curvature, directions = np.linalg.eigh(matrix.T @ matrix)
    curvature = np.maximum(curvature, 0.0)
    along = directions.T @ downhill
    now = here.square(weight)
    for _ in range(DAMPING_TRIALS):
        step = directions @ (along / (curvature + damping * curvature[-1]))
        with np.errstate(all="ignore"):  # a step that overflows is refused
            moved = here.moved(-step / size)
            if moved.square(weight) < now:
                return moved, max(damping / 100, MIN_DAMPING)
        damping = max(10 * damping, 1e-10)
    return None, damping
