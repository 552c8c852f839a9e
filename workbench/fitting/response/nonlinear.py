"""Response fit as a nonlinear minimax program for IPOPT, over poles, zeros and gain together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.accuracy import AccuracyRange
from workbench.executor import Context
from workbench.fitting.factored_values import LARGEST_LOGARITHM
from workbench.fitting.rational import Rational
from workbench.fitting.response.least_peak import EXACT_ERROR, factored, worst_error
from workbench.fitting.response.program import ResponseFit
from workbench.fitting.response.vector_fitting import vector_fits
from workbench.program import Claim, method
from workbench.solvers import Outcome, in_one_thread, ipopt, ipopt_outcome

IPOPT_ACCURACY = 1e-4
"""Smallest accuracy asked of IPOPT: the last digits of a local minimum take the longest time."""
STEP_BOUND = 3.0
"""Largest change of each variable; a change of 1 changes the errors by about their own size.
Without a bound IPOPT sometimes wanders for thousands of iterations.

Without a bound IPOPT sometimes wanders for thousands of iterations.
"""


@method(ResponseFit, "ipopt", optimal=False, accuracy=AccuracyRange(finest=IPOPT_ACCURACY))
def _ipopt(program: ResponseFit, context: Context) -> Claim:
    """Nonlinear program over the coefficients of quadratic factors, from the best vector fit."""
    return refined_fit(program, vector_fits(program, context)[0], context)


@in_one_thread
def refined_fit(program: ResponseFit, start: Rational, context: Context) -> Claim:
    """The fit that IPOPT finds within bounds around ``start``, or ``start`` if that is better.

    The program minimises t subject to |e_i|^2 <= t. The errors e are in units of the start's
    largest error, and the variables are steps of the parameters in units in which the Jacobian of
    the errors is orthogonal.
    """
    import casadi as ca

    data = program.active
    form = factored(program, start)
    origin = form.start
    error = data.weight * (form.response(origin, data.omega) - data.response)
    unit = float(np.abs(error).max())
    if unit <= EXACT_ERROR * program.size:
        return start, Outcome.SOLVED, "the start is exact to rounding"
    units = _units(data.weight[:, None] * form.slopes(origin, data.omega) / unit)
    with context.stating():
        step, height = ca.MX.sym("step", origin.size), ca.MX.sym("height")
        vector = ca.DM(origin) + ca.DM(units) @ step
        real, imaginary = form.products(
            ca.vertsplit(vector),
            (0.0, ca.DM(data.omega)),
            lambda value: ca.exp(ca.fmax(ca.fmin(value, LARGEST_LOGARITHM), -LARGEST_LOGARITHM)),
        )
        weight = ca.DM(data.weight / unit)
        off = weight * (real - data.response.real), weight * (imaginary - data.response.imag)
        nlp = {
            "x": ca.vertcat(step, height),
            "f": height,
            "g": off[0] ** 2 + off[1] ** 2 - height,
        }
        enough = max(context.options.accuracy, IPOPT_ACCURACY)
        wanted = replace(context.options, tolerance=enough)
        # The default barrier pushes the start away from a nearby minimum and takes ten times the
        # steps.
        solver = ipopt("response", nlp, wanted, mu_strategy="adaptive")
    bound = np.append(np.full(origin.size, STEP_BOUND), np.inf)
    still = np.append(np.zeros(origin.size), 1.0)
    found = solver(x0=still, lbx=-bound, ubx=bound, ubg=0)["x"].full().ravel()
    _, message = ipopt_outcome(solver)
    vector = origin + units @ found[:-1]
    if np.isfinite(vector[-1]) and np.abs(vector[:-1]).max(initial=0.0) < np.exp(LARGEST_LOGARITHM):
        better = form.rational(vector)  # the fit is judged by its errors, not by IPOPT's status
        if worst_error(program, better) < worst_error(program, start):
            return better, Outcome.SOLVED, message
    return start, Outcome.INACCURATE, f"{message}, no better than its start, which stands"


def _units(slopes: ComplexArray) -> RealArray:
    """Columns (P, P) of parameter steps, each of which changes the errors by a root mean square of
    1.

    Steps are shortened where they would change a parameter by more than 1.
    """
    stacked = np.concatenate([slopes.real, slopes.imag])
    size = np.linalg.norm(stacked, axis=0)
    size[size == 0] = 1.0
    _, singular, vt = np.linalg.svd(stacked / size, full_matrices=False)
    steps = vt.T / size[:, None] / np.maximum(singular, np.finfo(float).eps * singular[0])
    steps *= np.sqrt(slopes.shape[0])
    return steps / np.maximum(np.abs(steps).max(axis=0), 1.0)
