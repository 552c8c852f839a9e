"""Least squares for parameters: IPOPT with exact derivatives, SciPy without CasADi."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from workbench.executor import Context
from workbench.identification.parameters import ParameterFit
from workbench.program import Claim, method
from workbench.solvers import Outcome, ipopt, ipopt_outcome

PASSES = 4
"""Times that IPOPT starts anew from its answer, in units of the standard deviations there."""

Local = Callable[[np.ndarray], tuple[np.ndarray, float, Outcome, str]]
"""From a start to values, their sum of squares, the outcome and the solver's own words."""


@method(ParameterFit, "ipopt", optimal=False)
def _ipopt(program: ParameterFit, context: Context) -> Claim:
    """Nonlinear program with exact first and second derivatives."""
    import casadi as ca

    count = len(program.names)
    with context.stating():
        x, origin, unit = (ca.MX.sym(name, count) for name in ("x", "origin", "unit"))
        values = ca.MX.sym("values", count)
        parts = [one.expression(program.names, values) for one in program.data]
        residuals = ca.Function("residuals", [values], [ca.vertcat(*parts)])
        cost = ca.sumsqr(residuals(origin + unit * x)) / 2
        nlp = {"x": x, "p": ca.vertcat(origin, unit), "f": cost}
        solver = ipopt("fit", nlp, context.options)
        slope = residuals.jacobian()

    def local(start: np.ndarray) -> tuple[np.ndarray, float, Outcome, str]:
        values, step = start, program.scale
        for _ in range(PASSES):
            found = solver(
                x0=np.zeros(count),
                p=np.concatenate([values, step]),
                lbx=(program.lower - values) / step,
                ubx=(program.upper - values) / step,
            )
            moved = found["x"].full().ravel()
            values = np.clip(values + step * moved, program.lower, program.upper)
            outcome, message = ipopt_outcome(solver)
            if outcome is not Outcome.SOLVED or np.abs(moved).max() < 1e-4:
                break
            # The gradient that IPOPT stops at is then a number of standard deviations.
            derivative = slope(values, residuals(values)).full()
            step = 1 / np.maximum(np.linalg.norm(derivative, axis=0), 1e-9 / program.scale)
        return values, float(np.sum(residuals(values).full() ** 2)), outcome, message

    return _best(program, context, local)


@method(ParameterFit, "scipy", optimal=False)
def _scipy(program: ParameterFit, context: Context) -> Claim:
    """SciPy's trust-region least squares, derivatives by central differences."""
    from scipy.optimize import least_squares

    def local(start: np.ndarray) -> tuple[np.ndarray, float, Outcome, str]:
        scale = program.scale
        # The solver steps inward from a start on a bound.
        found = least_squares(
            lambda x: program.residuals(scale * x),
            start / scale,
            jac="3-point",
            bounds=(program.lower / scale, program.upper / scale),
            x_scale="jac",
            ftol=1e-14,
            xtol=1e-12,
            gtol=1e-14,
            max_nfev=500,
        )
        values = np.clip(scale * found.x, program.lower, program.upper)
        outcome = Outcome.SOLVED if found.status > 0 else Outcome.FAILED
        return values, 2 * float(found.cost), outcome, f"scipy: {found.message}"

    return _best(program, context, local)


def _best(program: ParameterFit, context: Context, local: Local) -> Claim:
    """The least sum of squares from all starts."""
    best, failure = None, (Outcome.FAILED, "no start")
    for start in context.track(program.starting_points(context.rng), "starts"):
        values, cost, outcome, message = local(start)
        if outcome in (Outcome.SOLVED, Outcome.INACCURATE) and np.isfinite(cost):
            if best is None or cost < best[1]:
                best = (values, cost, outcome, message)
        else:
            failure = (outcome, message)
    if best is None:
        return None, *failure
    return best[0], best[2], best[3]
