"""The search for the focus: the lens ramps through the s-curve until the loop can be closed.

The thesis starts its experiments with the loop closed and does not describe how it is closed. This
is the usual way (G. Bouwhuis et al., Principles of Optical Disc Systems, 1985). The lens draws
back, waits and advances. If the sum of the diodes shows light and the error crosses zero, the
controller takes over from the ramp's voltage, without a bump.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from workbench.simulation import Cascade, Controller, Part, blender, kernel, tracking_controller
from workbench.types import RealArray

from ..drive.actuator import SERIES_RESISTANCE
from ..drive.plants import controller
from ..laboratory.bench_setup import PERIOD, coil_gain, find_drive
from ..laboratory.experiment import MEASUREMENTS

BEGIN, END = -1.3e-3, 0.8e-3
"""Positions of the lens [m] between which it advances, relative to its rest: from below the surface
of a disc in the middle, to above its layer.
"""
RETREAT = 20e-3
"""Speed [m/s] at which the lens draws back."""
WAIT = 0.1
"""Time [s] in which a lens that was drawn back comes to rest."""
FOLLOWING = 5000.0
"""Rate [1/s] at which the controller follows the ramp's voltage, which still grows."""


def volts_per_metre() -> float:
    """Control voltage that holds the nominal lens one metre from its rest [V/m]."""
    p = find_drive("focus", "nominal")
    return (p.R + SERIES_RESISTANCE) * p.k / (p.Bl * coil_gain(p))


@dataclass(frozen=True)
class Search:
    """A search for the focus, in voltages that suit the nominal drive.

    speed: speed of the advancing lens [m/s]. light: sum of the diodes [V] above which the focus is
    near. patience: time [s] of darkness after which a closed loop counts as lost, and the search
    begins anew. closed: whether it begins with the loop closed.
    """

    speed: float
    light: float
    patience: float = math.inf
    closed: bool = False

    @property
    def law(self) -> Controller:
        """Part that reads f_en and the sum; it returns w, which is 1 with the loop closed, and the
        voltage of the ramp.
        """
        volts = volts_per_metre()
        steps = RETREAT * volts * PERIOD, self.speed * volts * PERIOD
        ends = BEGIN * volts, END * volts
        times = WAIT / PERIOD, self.patience / PERIOD
        parameters = np.array([*ends, *steps, *times, self.light])
        state = np.array([3.0 if self.closed else 0.0, 0.0, 0.0, 0.0, 0.0])
        return Controller(_search, state, parameters, outputs=2, reads=2, dt=PERIOD)

    @property
    def cascade(self) -> Cascade:
        """The search and the reference controller, only one of which gives the command at a
        time.
        """
        follower = tracking_controller(controller("focus"), PERIOD, FOLLOWING)
        parts = [
            Part("search", self.law, inputs=["f_en", "sum"], outputs=["closed", "ramp"]),
            Part("seen", blender(), inputs=["closed", "f_en"]),
            Part("K", follower, inputs=["seen", "closed", "u_last"], outputs=["u_k"]),
            Part("u", blender(), inputs=["closed", "u_k", "ramp"]),
        ]
        return Cascade(MEASUREMENTS, parts)


@kernel
def _search(state: RealArray, parameters: RealArray, given: RealArray, told: RealArray) -> None:
    """Step of `Search`.

    The state holds the phase (0 drawing back, 1 waiting, 2 advancing, 3 closed), the voltage, the
    number of samples of waiting or of darkness, the last error, and whether there was light.
    """
    begin, end, back, forth, wait, patience, light = parameters
    error, lit = given[0], given[1] > light
    phase, volts, count = state[0], state[1], state[2]
    if phase == 0.0:
        volts = max(volts - back, begin)
        if volts == begin:
            phase, count = 1.0, 0.0
    elif phase == 1.0:
        count += 1.0
        if count >= wait:
            phase = 2.0
    elif phase == 2.0:
        volts += forth
        if lit and state[4] == 1.0 and error * state[3] <= 0.0:
            phase, count = 3.0, 0.0
        elif volts >= end:
            phase = 0.0
    else:
        count = 0.0 if lit else count + 1.0
        if count >= patience:
            phase = 0.0
    state[0], state[1], state[2], state[3] = phase, volts, count, error
    state[4] = 1.0 if lit else 0.0
    told[0] = 1.0 if phase == 3.0 else 0.0
    told[1] = volts
