"""Weights of a CD drive's loop, for closed forms of mu and for bounds on every controller."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from workbench.fitting import Rational
from workbench.mu import RankOneLoop
from workbench.synthesis import AnalyticBasis, ControlCover, LoopWeights
from workbench.types import RealArray, StateSpace
from workbench.uncertainty import Responses, UncertaintyModel

from ..drive.plants import ANTIALIASING
from ..drive.tables import Axis
from .control_problem import LEAK, control_weight, generalised, optical_gain, performance_weight

CHANNELS = {"disturbance": ("w_p", "z_p"), "control": ("w_u", "z_u")}
"""Exogenous input and performance output of each channel."""
NONE = np.empty(0, complex)
BASIS = AnalyticBasis(2 * np.pi * np.geomspace(30.0, 3e5, 24), (1e-3, 1e7))
"""Basis functions for proofs that no controller reaches a level; its band is in Hz."""


def loop_weights(
    axis: Axis, model: UncertaintyModel, speed: float, omega: ArrayLike
) -> LoopWeights:
    """Weights of w_p -> (z_p, z_u) with circles or stadiums, at frequencies [rad/s] (F,)."""
    omega = np.asarray(omega, dtype=float)
    s = 1j * omega
    actuator = model.nominal.response(omega) / optical_gain(axis)
    performance = performance_weight(axis, speed)(s)
    return LoopWeights.of(model, performance, control_weight(axis)(s) / actuator, omega)


def unit_uncertainty(nominal: Rational) -> UncertaintyModel:
    """A plant u -> f_en with a multiplicative uncertainty of size 1 at every frequency."""
    return UncertaintyModel(nominal, Rational(NONE, NONE, 1.0))


def channel_of(
    axis: Axis, nominal: Rational, K: StateSpace, name: str, speed: float, omega: RealArray
) -> RankOneLoop:
    """A channel of CHANNELS about a nominal plant u -> f_en, at frequencies [rad/s] (F,)."""
    exogenous, performance = CHANNELS[name]
    plant = generalised(axis, unit_uncertainty(nominal), speed)
    return RankOneLoop.of(plant, K, performance, exogenous, omega)


def control_cover(
    axis: Axis, speed: float, responses: Responses, complex_order: int
) -> ControlCover:
    """Covers of measured drives u [V] -> f_en [units], chosen for the loop from w_p."""
    return ControlCover(
        responses,
        complex_order,
        performance=lambda omega: performance_weight(axis, speed)(1j * omega),
        # w_p is in m, f_en in units.
        control=lambda omega: np.abs(control_weight(axis)(1j * omega)) * optical_gain(axis),
        sensor=lambda omega: 1 / (1 + 1j * omega / ANTIALIASING),
        lowest=LEAK / 10,
    )
