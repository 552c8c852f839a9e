"""The task of Table 5.1 for a CD drive: one plant in the form that each synthesis method needs.

Equation, section and table numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

import numpy as np

from workbench.synthesis import DesignTask
from workbench.types import StateSpace
from workbench.uncertainty import ParametricModel, UncertaintyModel

from ...drive.plants import ANTIALIASING, controller, nominal_parameters, plant, total_gain
from ...drive.tables import Axis
from ..control_problem import control_weight, generalised, optical_gain, performance_weight
from ..design import synthesis_plant

CHANNELS = ("z_p", "z_u")
SIGNAL_SIZES = tuple(np.geomspace(1e-8, 1e2, 31))
"""Factors on the perturbation's signals that are tried with a full block."""
FULL_ORDER = ("LQG", "mixed sensitivity", "loop shaping", "full block", "D-K", "(mu,D)-K")
"""Methods whose controllers have at least the order of the plant with its weights."""


def design_task(axis: Axis, uncertain: UncertaintyModel | ParametricModel) -> DesignTask:
    """The task of an axis with an uncertainty of u [V] -> f_en [units].

    Controllers are judged on w_p to (z_p, z_u), and made for the same with a little noise. The
    reference controller, eq. 6.12 or its radial variant, was made by hand after reduction. It has
    an integrator and a lead, as positioning servos do, and serves as the weight of loop shaping.

    For LQG, w_p is white up to the corner of the anti-aliasing filter: without that limit, z_p
    would have infinite variance, since W_p passes all frequencies. In mixed sensitivity W_u acts on
    f_en [units] instead of e [m].
    """
    import control

    regular = synthesis_plant(axis, uncertain)
    limit = control.ss(-ANTIALIASING, ANTIALIASING, 1.0, 0.0)
    return DesignTask(
        plant=generalised(axis, uncertain).channel(performance=CHANNELS, exogenous="w_p"),
        regular=regular,
        quadratic=regular.nominal().weighted(exogenous=[limit]),
        nominal=nominal_system(axis, uncertain),
        W_S=performance_weight(axis),
        W_KS=float(control_weight(axis).D[0, 0]) * optical_gain(axis),
        reference=control.ss(controller(axis)),
        sizes=SIGNAL_SIZES,
    )


def nominal_system(axis: Axis, uncertain: UncertaintyModel | ParametricModel) -> StateSpace:
    """Nominal plant u [V] -> f_en [units], with the anti-aliasing filter."""
    import control

    if isinstance(uncertain, ParametricModel):
        return plant(nominal_parameters(axis), total_gain(axis))
    filtered = control.ss(-ANTIALIASING, ANTIALIASING, 1.0, 0.0)
    return filtered * uncertain.systems()["G"]
