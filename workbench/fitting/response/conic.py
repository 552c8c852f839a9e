"""The numerator with the smallest worst error for given poles: a second-order cone program."""

from __future__ import annotations

import numpy as np

from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.fitting.response.least_peak import EXACT_ERROR
from workbench.fitting.response.numerator import NumeratorBasis, real_over_imaginary, with_numerator
from workbench.fitting.response.program import ResponseFit
from workbench.fitting.response.vector_fitting import vector_fits
from workbench.program import Claim, conic_method
from workbench.solvers import ConicSolver, Outcome, solve_conic


def not_convex(program: ResponseFit) -> str | None:
    """Reason why the numerator is no convex problem; None if it is one."""
    if program.minimum_phase:
        return "minimum phase is not convex in the numerator; use best, ipopt or vector-fitting"
    return None


@conic_method(ResponseFit, cones="second-order", optimal=False, unfit=not_convex)
def _conic(program: ResponseFit, context: Context, solver: ConicSolver) -> Claim:
    """Second-order cone program for the best numerator over the poles of a vector fit."""
    return best_numerator(program, vector_fits(program, context)[0], context, solver)


def best_numerator(
    program: ResponseFit, start: Rational, context: Context, solver: ConicSolver
) -> Claim:
    """The fit with the smallest worst error among those with the poles of ``start``."""
    import cvxpy as cp

    data = program.active
    scale = float(np.sqrt(data.omega[0] * data.omega[-1]))
    basis = NumeratorBasis.over(data.omega / scale, data.weight, start.poles / scale, program.zeros)
    shares = basis.columns.T @ real_over_imaginary(data.weight * start.response(data.omega))
    left = basis.columns @ shares - real_over_imaginary(data.weight * data.response)
    count = data.omega.size
    peak = float(np.hypot(left[:count], left[count:]).max())
    if peak <= EXACT_ERROR * program.size:
        return start, Outcome.SOLVED, "the start is exact to rounding"
    with context.stating():  # corrections in units of the start's worst error
        change, height = cp.Variable(shares.size), cp.Variable()
        error = left / peak + basis.columns @ change
        parts = cp.vstack([error[:count], error[count:]])
        problem = cp.Problem(cp.Minimize(height), [cp.norm(parts, axis=0) <= height])
    outcome, message = solve_conic(problem, solver, context.options, context)
    if change.value is None:
        return None, outcome, message
    answer = with_numerator(basis, shares + peak * change.value, start.poles, scale)
    return answer, outcome, f"{message}; optimal for the poles of its start only"
