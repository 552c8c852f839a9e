"""Performance of both loops together, as a system that a coupling closes.

    e = w - G u,    u = K AAF K_optn e      with both axes in each, and K diagonal,

    z_F = W_F e_F,  z_R = W_R e_R,          w_F = d_F D_F,  w_R = d_R D_R,

with the weights W of eq. 6.11. D is the Red Book's largest deviation at each frequency, and each z
is divided by its own D, so that without coupling z_F / d_F = W_F S_F and z_R / d_R = W_R S_R, as in
chapter 6. Only the ratio D_F / D_R matters: 7.1 at rest, and 25 above the frequencies at which the
accelerations limit the deviations. The loops keep their performance if the largest singular value
from d to z stays below 1 at every frequency. Equation numbers refer to E. Vidal Sanchez, Robust
and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import math
from typing import Literal, get_args

import numpy as np

from workbench.structure import Full, Structure
from workbench.types import ComplexArray, RealArray, StateSpace

from ...control.control_problem import performance_weight
from ...drive.plants import ANTIALIASING, controller
from ...drive.tables import AXES, red_book
from ..paths import TwoAxes

Place = Literal["force", "reading"]
PLACES: tuple[Place, ...] = get_args(Place)
"""Where an unknown coupling acts: a share of each control voltage reaches the other coil; a share
of each error reaches the diodes of the other axis.
"""
COUPLING = Structure([Full(1, 1), Full(1, 1)])
"""Any stable coupling from radial to focus, and any from focus to radial."""
CLOSED = COUPLING.with_performance(2, 2)
PERFORMANCE = 2
"""Number of the performance block in CLOSED."""


def deviation_ratio() -> StateSpace:
    """D_F / D_R, the disc's vertical over its radial deviation by frequency (Tables 2.3, 2.4)."""
    import control

    focus, radial = (red_book(axis) for axis in AXES)
    low, high = (math.sqrt(one.acceleration / one.deviation) for one in (radial, focus))
    at_rest = focus.deviation / radial.deviation
    return control.ss(control.zpk([-low] * 2, [-high] * 2, at_rest * (high / low) ** 2))


def performance_system(two: TwoAxes, place: Place) -> StateSpace:
    """System from (coupling, d_F, d_R) to (coupling, z_F, z_R), which is stable if the loops are.

    The coupling's outputs come first from radial to focus, then from focus to radial, as COUPLING
    has its blocks. The couplings of `two` itself are part of the system.
    """
    import control

    ratio = deviation_ratio()
    discs = control.append(control.ss([], [], [], 1.0), 1.0 / ratio)
    weights = [control.ss(performance_weight(axis)) for axis in AXES]
    sensors = [control.ss(-ANTIALIASING, ANTIALIASING, one.K_optn, 0.0) for one in two.axes]
    acts = place == "force"
    one, none = np.eye(2), np.zeros((2, 2))
    # errors by (coupling, d, u), below them these inputs
    e = discs * np.hstack([none, one, none]) - two.actuator * np.hstack([acts * one, none, one])
    seen = control.ss(
        e.A, e.B, np.vstack([e.C, np.zeros((6, e.nstates))]), np.vstack([e.D, np.eye(6)])
    )
    told = control.append(control.ss([], [], [], one), weights[0], ratio * weights[1], *sensors)
    wired = np.block(
        [
            [none if acts else one, none, none, one if acts else none],
            [one, none, none, none],
            [two.optics, none if acts else one, none, none],
        ]
    )
    K = control.append(*(control.ss(controller(axis)) for axis in AXES))
    return ((told * wired * seen).lft(K))[[1, 0, 2, 3], :]


def error_response(two: TwoAxes, omega: RealArray) -> ComplexArray:
    """Response (F, 2, 2) from w to e at frequencies [rad/s] (F,), without state space."""
    s = 1j * omega
    K = _diagonal(*(controller(axis)(s) for axis in AXES))
    gains = np.diag([one.K_optn for one in two.axes])
    lag = (1.0 / (1.0 + s / ANTIALIASING))[:, None, None]
    loop = two.response(omega) @ K @ (lag * (gains @ two.optics))
    return np.asarray(np.linalg.inv(np.eye(2) + loop), complex)


def performance_response(two: TwoAxes, omega: RealArray) -> ComplexArray:
    """Response (F, 2, 2) from d to z at frequencies [rad/s] (F,), without state space."""
    s = 1j * omega
    ratio, (focus, radial) = deviation_ratio()(s), (performance_weight(axis)(s) for axis in AXES)
    told, discs = _diagonal(focus, ratio * radial), _diagonal(np.ones_like(s), 1.0 / ratio)
    found: ComplexArray = told @ error_response(two, omega) @ discs
    return found


def largest_gain(two: TwoAxes, omega: RealArray) -> float:
    """Largest singular value from d to z at frequencies [rad/s] (F,)."""
    return float(np.linalg.svd(performance_response(two, omega), compute_uv=False).max())


def _diagonal(first: ComplexArray, second: ComplexArray) -> ComplexArray:
    """Diagonal matrices (F, 2, 2)."""
    found = np.zeros((len(first), 2, 2), complex)
    found[:, 0, 0], found[:, 1, 1] = first, second
    return found
