"""Last step of a cover: a complex weight that covers the remaining distances from the real weight.

Known plants give information between the frequencies: how narrow a resonance is, how wide the sets
are.
"""

from __future__ import annotations

import numpy as np

from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.geometry import Circle, Stadium
from workbench.uncertainty.covers.cover import RADIUS_ROUNDING, UncertaintyCover
from workbench.uncertainty.covers.everywhere import (
    covering_weight,
    reaching_known,
    rounded_radius,
)
from workbench.uncertainty.covers.joint.search import FoundModel
from workbench.uncertainty.covers.model import UncertaintyModel
from workbench.uncertainty.covers.steps import CoverSteps
from workbench.uncertainty.covers.weights import damped, reaching, resolved, share_of_size


def fitted_cover(
    program: UncertaintyCover,
    first: Circle | Stadium,
    nominal: Rational,
    third: Stadium,
    W_r: Rational | None,
    context: Context,
) -> CoverSteps:
    """The cover with a complex weight fitted to the radii that it must reach."""
    fine = program if program.leave_out else program.refined()
    W_r = _realisable(W_r, fine)
    W_c = covering_weight(
        fine.responses,
        fine.deviations_from(nominal, fine.points),
        nominal,
        W_r,
        program.form,
        program.complex_order,
        lambda _, radius, extent: share_of_size(radius, extent),
        RADIUS_ROUNDING,
        not program.leave_out,
        context,
    )
    return _steps(program, first, nominal, third, W_r, W_c)


def raised_cover(
    program: UncertaintyCover,
    fine: UncertaintyCover,
    first: Circle | Stadium,
    found: FoundModel,
    everywhere: bool = True,
) -> CoverSteps:
    """The cover from a model whose complex weight is multiplied by a gain until it reaches every
    radius.

    ``fine`` is the program at all frequencies at which the plants are known. With ``everywhere``,
    known plants are also covered between these frequencies.
    """
    omega, nominal = fine.responses.axis, program.realisable(found.nominal)
    W_r = _realisable(found.W_r, fine)
    away = fine.deviations_from(nominal, fine.points)
    radius = rounded_radius(omega, away, nominal, W_r, program.form, RADIUS_ROUNDING)
    W_c = found.W_c.scaled(float((radius / np.abs(found.W_c.response(omega))).max()))
    W_c = reaching(W_c, omega, radius)
    if everywhere and not program.leave_out:
        W_c = reaching_known(fine.responses, nominal, W_c, W_r, program.form)
    third = program.third_set(program.deviations_from(nominal, program.points), W_r)
    return _steps(program, first, nominal, third, W_r, W_c)


def _realisable(W_r: Rational | None, fine: UncertaintyCover) -> Rational | None:
    """The real weight without resonances between the frequencies, and with its poles off the
    axis.
    """
    omega = fine.responses.axis
    return None if W_r is None else damped(resolved(W_r, omega), omega)


def _steps(
    program: UncertaintyCover,
    first: Circle | Stadium,
    nominal: Rational,
    third: Stadium,
    W_r: Rational | None,
    W_c: Rational,
) -> CoverSteps:
    responses = program.responses
    model = UncertaintyModel(
        nominal,
        W_c,
        W_r,
        form=program.form,
        dt=responses.dt,
        tested=responses.tested,
        measured=responses.ends,
    )
    second = program.second_set(program.deviations_from(nominal, program.points))
    return CoverSteps(model, first, second, third)
