"""Methods of the parameter fit: IPOPT with exact derivatives, and SciPy without CasADi."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.executor import Context
from workbench.identification.parameters.program import ParameterFit
from workbench.program import Claim, method
from workbench.solvers import Outcome, in_one_thread, ipopt, ipopt_outcome

MAX_PASSES = 6
"""Largest number of runs of IPOPT from one start; each continues with the standard deviations as
units.
"""
PROXIMAL_CURVATURE = 1e-6
"""Curvature added to the cost in those units, for directions that the data do not determine."""

Local = Callable[[np.ndarray], tuple[np.ndarray, float, Outcome, str]]
"""Function of a start that gives values, their sum of squares, the outcome and a message."""


@method(ParameterFit, "ipopt", optimal=False)
@in_one_thread
def _ipopt(program: ParameterFit, context: Context) -> Claim:
    """Nonlinear program with exact first and second derivatives."""
    import casadi as ca

    count = len(program.names)
    with context.stating():
        x, origin, unit = (ca.MX.sym(name, count) for name in ("x", "origin", "unit"))
        values = ca.MX.sym("values", count)
        parts = [one.expression(program.names, values) for one in program.data]
        residuals = ca.Function("residuals", [values], [ca.vertcat(*parts)])
        spread = ca.MX.sym("spread")
        misfit = residuals(origin + unit * x) / spread
        # The proximal term is zero at the optimum if a pass ends where it began.
        cost = ca.sumsqr(misfit) / 2 + PROXIMAL_CURVATURE * ca.sumsqr(x) / 2
        nlp = {"x": x, "p": ca.vertcat(origin, unit, spread), "f": cost}
        solver = ipopt("fit", nlp, context.options)
        slope = residuals.jacobian()

    def local(start: np.ndarray) -> tuple[np.ndarray, float, Outcome, str]:
        values, step = start, program.scale
        for number in range(MAX_PASSES):
            left = residuals(values).full()
            # An exact fit leaves only rounding, so the spread needs a lower limit.
            spread = max(float(np.linalg.norm(left)), 1e-12 * program.size) / program.count**0.5
            if number:
                # So the gradient at which IPOPT stops has the standard deviations as its units.
                slopes = np.linalg.norm(slope(values, left).full(), axis=0)
                step = spread / np.maximum(slopes, 1e-9 * spread / program.scale)
            found = solver(
                x0=np.zeros(count),
                p=np.concatenate([values, step, [spread]]),
                lbx=(program.lower - values) / step,
                ubx=(program.upper - values) / step,
            )
            moved = found["x"].full().ravel()
            outcome, message = ipopt_outcome(solver)
            if not np.all(np.isfinite(moved)):
                break
            values = np.clip(values + step * moved, program.lower, program.upper)
            if outcome is not Outcome.SOLVED or (number and np.abs(moved).max() < 1e-4):
                break
        return values, float(np.sum(residuals(values).full() ** 2)), outcome, message

    return _best(program, context, local)


@method(ParameterFit, "scipy", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _scipy(program: ParameterFit, context: Context) -> Claim:
    """SciPy's trust-region least squares, derivatives by central differences."""
    from scipy.optimize import least_squares

    def local(start: np.ndarray) -> tuple[np.ndarray, float, Outcome, str]:
        scale = program.scale
        found = least_squares(
            lambda x: program.residuals(scale * x),
            start / scale,
            jac="3-point",
            bounds=(program.lower / scale, program.upper / scale),
            x_scale="jac",
            ftol=1e-14,
            xtol=1e-12,
            gtol=None,  # this tolerance is absolute, but the residuals may have any unit
            max_nfev=500,
        )
        values = np.clip(scale * found.x, program.lower, program.upper)
        outcome = Outcome.SOLVED if found.status > 0 else Outcome.FAILED
        return values, 2 * float(found.cost), outcome, f"scipy: {found.message}"

    return _best(program, context, local)


def _best(program: ParameterFit, context: Context, local: Local) -> Claim:
    """The answer with the smallest sum of squares from all starts, whatever its outcome.

    If the data do not determine a combination of parameters, the Hessian is singular and the solver
    reports a failure although the point is right; the certificate then names the combination.
    """
    points = program.starting_points(context.rng)
    found = [local(start) for start in context.track(points, "starts")]
    values, cost, outcome, message = min(
        found, key=lambda one: one[1] if np.isfinite(one[1]) else np.inf
    )
    return (values if np.isfinite(cost) else None), outcome, message
