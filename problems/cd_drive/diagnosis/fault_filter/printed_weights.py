"""The filter's problem with the weights and scalings that section 7.3.2 prints.

    z = epsilon z_f,   z_f = f_sd - u_f,   f_sd = W_sd w_sd,   x_cd = W_p w_p

W_p is that of eq. 6.11 and W_sd that of eq. 7.32. Two readings of epsilon are possible: either
epsilon_1 scales the channel from w_p and epsilon_2 that from w_sd, or both scale the rows of the
duplicated z_f, and each row sees both inputs (section 7.2.1). Equation and section numbers refer to
E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from math import hypot

import numpy as np

from workbench.diagnosis import FaultEstimation, FaultLoop, Requirement
from workbench.systems import response
from workbench.types import RealArray, StateSpace

from ...control.control_problem import performance_weight
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis
from ...laboratory.experiment import Laboratory
from ..defect_kinds import SHOCK_PEAK, voltage_of_force
from .peers import ELECTRONICS, M, defect_weight, nominal_loop

EPSILON = (5e-3, 2e-5)
"""Scalings of section 7.3.2; the second one is printed as another epsilon_1."""
SCALINGS = {"channels": EPSILON, "rows": (hypot(*EPSILON), hypot(*EPSILON))}
"""Factors on the channels from w_p and from w_sd, by reading of epsilon."""
DESIGNS = tuple(SCALINGS)


def shock_weight(axis: Axis) -> StateSpace:
    """Position of the nominal lens under the laboratory's largest shock, over the acceptable error.

    W_p is in these units: 250 at low frequency stands for 500 um, the disc's largest deviation.
    """
    bench = Laboratory(axis, "nominal")
    p = bench.parameters
    volts = (p.m1 + p.m2) * SHOCK_PEAK[axis] * voltage_of_force(bench)
    return volts * bench.coil_gain / ACCEPTABLE_ERROR[axis] * bench.actuator.state_space()


def weights(axis: Axis, design: str) -> dict[str, StateSpace]:
    """Weights of the disc's deviation and of defects, with their scalings."""
    disc, defect = SCALINGS[design]
    return {"disc": disc * performance_weight(axis), "defect": defect * M * defect_weight()}


def nominal_program(axis: Axis, loop: FaultLoop, design: str) -> FaultEstimation:
    """The problem for the nominal plant, with a noise that keeps it regular."""
    noise = Requirement("noise", "n", weight=ELECTRONICS * EPSILON[0])
    wanted = [*_requirements(axis, design, "x_cd", "f_sd"), noise]
    return FaultEstimation(nominal_loop(loop), "f_sd", requirements=wanted)


def robust_program(axis: Axis, loop: FaultLoop, design: str) -> FaultEstimation:
    """The problem for every plant of the loop's set."""
    return FaultEstimation(loop.plant, "f", requirements=_requirements(axis, design, "d", "f"))


def _requirements(axis: Axis, design: str, disturbance: str, fault: str) -> list[Requirement]:
    signals = {"disc": disturbance, "defect": fault}
    every = weights(axis, design)
    return [Requirement(name, signals[name], weight=weight) for name, weight in every.items()]


def least_at_each_frequency(axis: Axis, design: str, omega: RealArray) -> RealArray:
    """Norm (F,) that no filter gets below at omega [rad/s] (F,).

    With T the gain from disturbance and defect to the estimate, |D T, W (1 - T)| is least for
    T = W^2 / (D^2 + W^2), where it is D W / (D^2 + W^2)^(1/2).
    """
    disc, defect = (np.abs(response(W, omega)[:, 0, 0]) for W in weights(axis, design).values())
    least: RealArray = disc * defect / np.hypot(disc, defect)
    return least
