"""Checks of a cover at the given frequencies, and checks of the roots and orders of its
functions.
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certificate import THIS_SYSTEM, Check, worst_value
from workbench.fitting.rational import Rational
from workbench.geometry.enclosing_shape import CONTAINMENT_TOLERANCE
from workbench.second_opinion.responses import plain_response
from workbench.second_opinion.support import reach_beyond
from workbench.uncertainty.covers.sets import CoverForm
from workbench.uncertainty.responses.plants import Responses

REALISED_SUPPORT_TOLERANCE = 1e-6
"""Largest distance of a response beyond its set in the second opinion, relative to the radius.
Responses of realisations in double precision are less accurate than responses from roots. With half
of it a true cover of high order may be contradicted; with double of it a plant 2e-6 of the radius
outside is overlooked.
"""


def realised_support(
    systems: dict[str, StateSpace], form: CoverForm, responses: Responses, leave_out: int
) -> Check:
    """Second opinion on containment: the realised model, by support functions."""
    excess = excess_over_radius(systems, form, responses.omega, responses.values)
    excess = np.where(responses.present, excess, -np.inf)
    counted = np.sort(excess, axis=1)[:, -1 - leave_out]
    value, where = worst_value(counted, lambda i: f"at {responses.place(i[0])}")
    statement = "how far a response reaches beyond the realised set, over the radius"
    limit, over = REALISED_SUPPORT_TOLERANCE, responses.over
    return Check("support", statement, value, limit, where=where, over=over)


def excess_over_radius(
    systems: dict[str, StateSpace], form: CoverForm, omega: RealArray, values: ComplexArray
) -> RealArray:
    """Distance of values (F, N) beyond the sets of a realised model, relative to its radii.

    ``systems`` are the realisations of G, W_c and, for stadiums, W_r.
    """
    of = {name: plain_response(system, omega)[:, 0, 0] for name, system in systems.items()}
    size = of["G"] if form == "multiplicative" else np.ones_like(of["G"])
    segment = size * of.get("W_r", np.zeros_like(size))
    radius = np.abs(size * of["W_c"])
    excess = reach_beyond(values, of["G"], radius, np.abs(segment), np.angle(segment))
    over: RealArray = excess / radius[:, None]
    return over


def given_nominal(nominal: Rational, given: Rational, responses: Responses) -> Check:
    """Check that the nominal is the given one."""
    response = given.response(responses.axis)
    apart = np.abs(nominal.response(responses.axis) - response)
    apart = apart / np.maximum(np.abs(response), np.finfo(float).tiny)
    value, where = worst_value(apart, lambda i: f"at {responses.place(i[0])}")
    statement = "distance of its response from that of the given one, relative"
    over = f"at the {responses.omega.size} given frequencies"
    return Check("nominal given", statement, value, CONTAINMENT_TOLERANCE, where=where, over=over)


def at_most(what: str, name: str, value: int, limit: int) -> Check:
    """Check that a count, such as the order, is at most a limit."""
    statement = f"{what} of {name}, at most what was asked for"
    return Check(f"{what} of {name}", statement, float(value), float(limit))


def left_check(name: str, kind: str, roots: ComplexArray) -> Check:
    """Check that roots lie left of the imaginary axis."""
    value = float(roots.real.max(initial=-np.inf))
    text = f"largest real part of a {kind} [rad/s], negative"
    return Check(name, text, value, -np.finfo(float).tiny, over=THIS_SYSTEM)
