"""The control problems of a CD drive: plant, uncertainty and weights (sections 6.1 and 6.2).

    x = ACT u       e = w_p + w_u - x       f_en = K_optn AAF e       u = K f_en
    z_p = W_p e     z_u = W_u u

with the uncertainty in ACT, the actuator u [V] -> x [m]. AAF is the anti-aliasing filter; it is
known, and the thesis leaves it out of eq. 6.4. Positions in m, errors f_en in units. Equation
numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import math

import numpy as np

from workbench.errors import InputError
from workbench.fitting import Rational
from workbench.types import StateSpace
from workbench.uncertainty import (
    GeneralisedPlant,
    ParametricModel,
    UncertaintyModel,
    generalised_plant,
)

from ..drive.plants import ANTIALIASING
from ..drive.tables import Axis, check_axis, drives

WEIGHTS = {"focus": (2.0, 0.004, 230.0, 10.0), "radial": (2.0, 0.2 / 70, 145.0, 5.0)}
"""M, A, w_B / 2 pi [Hz] and w_I / 2 pi [Hz] of eq. 6.11. The thesis gives those of the focus loop.
The radial ones follow its reasoning: an error of 0.2 um with a disc that deviates by 70 um and 0.4
m/s^2.
"""
LEAK = 0.001
"""Magnitude of the pole that replaces the integrator of eq. 6.11 [rad/s]."""


def optical_gain(axis: Axis) -> float:
    """K_optn [units/m] of the nominal loop: midrange of the twelve drives (Table A.3)."""
    gains = [drive.K_optn for drive in drives(axis)]
    return (min(gains) + max(gains)) / 2


def performance_weight(axis: Axis, speed: float = 1.0) -> StateSpace:
    """W_p of eq. 6.11, e [m] -> z_p [m]; as `performance_function`."""
    return performance_function(axis, speed).state_space()


def performance_function(axis: Axis, speed: float = 1.0) -> Rational:
    """W_p by its zeros and poles; `speed` is the disc's speed over the nominal one, X.

    Raises InputError for an unknown axis and a speed that is not positive and finite.
    """
    check_axis(axis)
    if not 0.0 < speed < math.inf:
        raise InputError(f"speed is {speed}; it must be positive and finite, 1 for an audio CD's")
    M, A, bandwidth, integral = WEIGHTS[axis]
    w_B, w_I = 2 * np.pi * speed * bandwidth, 2 * np.pi * integral
    zeros = [-w_B * M ** (1 / 3)] * 3 + [-w_I]
    poles = [-w_B * A ** (1 / 3)] * 3 + [-LEAK]
    return Rational(np.array(zeros), np.array(poles), 1 / M)


SIGNAL_UNITS = {"w": "m", "w_p": "m", "w_u": "m", "f_en": "units", "u": "V"}
"""Units of the loop's signals, for figures."""


def control_weight(axis: Axis) -> StateSpace:
    """W_u = 1 / (100 K_optn) of section 6.3, u [V] -> z_u."""
    return _gain(control_gain(axis))


def control_gain(axis: Axis) -> float:
    """The value of the constant weight W_u."""
    return 1 / (100 * optical_gain(axis))


def generalised(
    axis: Axis, uncertainty: UncertaintyModel | ParametricModel, speed: float = 1.0
) -> GeneralisedPlant:
    """The generalised plant (w_p, w_u, u) -> (z_p, z_u, f_en), with the uncertainty's channels
    first.

    Parameters
    ----------
    uncertainty
        Uncertainty of u [V] -> f_en [units] without the anti-aliasing filter. Circles (W_r None)
        bring one complex scalar, stadiums a real one before it (eq. 6.3), whose weights act as in
        figure 6.2; a parametric model its repeated real scalars (figure 6.1).
    speed
        Factor X of eq. 6.11.

    Raises
    ------
    InputError
        As `performance_weight`.
    """
    K_optn = optical_gain(axis)
    return generalised_plant(
        [
            (uncertainty, "u", "f"),
            (_gain(1 / K_optn), "f", "x"),
            (performance_weight(axis, speed), "e", "z_p"),
            (control_weight(axis), "u", "z_u"),
            (_sensor(K_optn), "e", "f_en"),
        ],
        {"e": "w_p + w_u - x"},
        exogenous=["w_p", "w_u"],
        control="u",
        performance=["z_p", "z_u"],
        measurement="f_en",
    )


def _gain(value: float) -> StateSpace:
    import control

    return control.ss([], [], [], [[value]])


def _sensor(K_optn: float) -> StateSpace:
    """Optics and anti-aliasing filter, e [m] -> f_en [units]."""
    import control

    return control.ss(-ANTIALIASING, ANTIALIASING, K_optn, 0.0)
