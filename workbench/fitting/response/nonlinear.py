"""Poles, zeros and gain together as a nonlinear minimax program for IPOPT."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.fitting.response.conic import best_numerator, not_convex
from workbench.fitting.response.least_peak import sections_of
from workbench.fitting.response.program import ResponseFit
from workbench.fitting.response.vector_fitting import EXACT, vector_fits
from workbench.fitting.sections import REACH
from workbench.program import Claim, method
from workbench.solvers import Outcome, conic_solvers, ipopt, ipopt_outcome

ENOUGH = 1e-4
"""Accuracy at which IPOPT stops: the last digits of a local minimum take the longest."""
FARTHEST = 3.0
"""Bound on each step, in units that change the errors as much as they are large: without one IPOPT
now and then wanders for thousands of iterations."""
NEAR = 1.1
"""Starts are refined whose worst error is at most this many times the least."""


@method(ResponseFit, "ipopt", optimal=False)
def _ipopt(program: ResponseFit, context: Context) -> Claim:
    """Nonlinear program over the coefficients of sections, from the best vector fits."""
    return refined_from(program, vector_fits(program, context), context)


def refined_from(program: ResponseFit, fits: list[Rational], context: Context) -> Claim:
    """The best of the local minimax fits near those given fits that promise one.

    Each first gets the best numerator for its poles, where that is a convex problem.
    """
    starts = sorted(
        (numerator_improved(program, fit, context) for fit in fits),
        key=lambda fit: peak(program, fit),
    )
    near = [fit for fit in starts if peak(program, fit) <= NEAR * peak(program, starts[0])]
    claims = [refined(program, fit, context) for fit in context.track(near, "refinements")]
    return min(claims, key=lambda claim: peak(program, claim[0]))


def numerator_improved(program: ResponseFit, fit: Rational, context: Context) -> Rational:
    """A fit with the best numerator for its poles, if that is a convex problem."""
    solvers = conic_solvers()
    if not_convex(program) or not solvers:
        return fit
    improved = best_numerator(program, fit, context, solvers[0])[0]
    return fit if improved is None else min(fit, improved, key=lambda f: peak(program, f))


def peak(program: ResponseFit, fit: Rational) -> float:
    """The worst weighted error; infinite where it is not a number."""
    error = float(np.max(program.errors(fit)))
    return error if np.isfinite(error) else np.inf


def refined(program: ResponseFit, start: Rational, context: Context) -> Claim:
    """The best fit within bounds around ``start``, which is kept where IPOPT finds none better.

    Least t with |e_i|^2 <= t over steps of the parameters in units in which the errors' Jacobian is
    orthogonal, e in units of the largest error of the start.
    """
    import casadi as ca

    data = program.active
    sections = sections_of(program, start)
    origin = sections.start
    error = data.weight * (sections.response(origin, data.omega) - data.response)
    unit = float(np.abs(error).max())
    if unit <= EXACT * program.size:
        return start, Outcome.SOLVED, "the start is exact to rounding"
    units = _units(data.weight[:, None] * sections.slopes(origin, data.omega) / unit)
    with context.stating():
        step, height = ca.MX.sym("step", origin.size), ca.MX.sym("height")
        vector = ca.DM(origin) + ca.DM(units) @ step
        real, imaginary = sections.products(
            ca.vertsplit(vector),
            ca.DM(data.omega),
            lambda value: ca.exp(ca.fmax(ca.fmin(value, REACH), -REACH)),
        )
        weight = ca.DM(data.weight / unit)
        off = weight * (real - data.response.real), weight * (imaginary - data.response.imag)
        nlp = {
            "x": ca.vertcat(step, height),
            "f": height,
            "g": off[0] ** 2 + off[1] ** 2 - height,
        }
        enough = max(context.options.accuracy, ENOUGH)
        solver = ipopt("response", nlp, replace(context.options, tolerance=enough))
    bound = np.append(np.full(origin.size, FARTHEST), np.inf)
    still = np.append(np.zeros(origin.size), 1.0)
    found = solver(x0=still, lbx=-bound, ubx=bound, ubg=0)["x"].full().ravel()
    _, message = ipopt_outcome(solver)
    vector = origin + units @ found[:-1]
    if np.isfinite(vector[-1]) and np.abs(vector[:-1]).max(initial=0.0) < np.exp(REACH):
        better = sections.rational(vector)  # judged by its errors, not by IPOPT's word
        if peak(program, better) < peak(program, start):
            return better, Outcome.SOLVED, message
    return start, Outcome.INACCURATE, f"{message}, no better than its start, which stands"


def _units(slopes: ComplexArray) -> RealArray:
    """Steps of the parameters that change the errors by one each, and none a parameter by more."""
    stacked = np.concatenate([slopes.real, slopes.imag])
    size = np.linalg.norm(stacked, axis=0)
    size[size == 0] = 1.0
    _, singular, vt = np.linalg.svd(stacked / size, full_matrices=False)
    steps = vt.T / size[:, None] / np.maximum(singular, np.finfo(float).eps * singular[0])
    steps *= np.sqrt(slopes.shape[0])
    return steps / np.maximum(np.abs(steps).max(axis=0), 1.0)
