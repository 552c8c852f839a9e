"""Laws that make the radial lens jump across tracks by pulses of voltage: counted or precomputed.

The thesis' player jumps back to a track that it has lost (section 3.6.1), but it is not said how.
Here the controller continues with the mean error of the last millisecond, so that the lens still
follows the disc, and a pulse is added. The counting law measures by the zeros of the error how long
the lens takes to cover most of half the distance. A free mass under constant force needs a time
proportional to sqrt(distance), so this time tells when to brake, whatever the drive's gain; the
brake lasts as long as the kick. Playing laws take their pulse from a model. All laws add the
voltage that holds the nominal lens at its new position.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.simulation import (
    Cascade,
    Controller,
    Part,
    adder,
    blender,
    kernel,
    linear_controller,
)
from workbench.types import RealArray

from ...drive.actuator import SERIES_RESISTANCE
from ...drive.photo_diodes import TRACK_PITCH
from ...drive.plants import ANTIALIASING, controller
from ...laboratory.bench_setup import PERIOD, coil_gain, find_drive
from ...laboratory.experiment import MEASUREMENTS

HELD = 1e-3 / PERIOD
"""Number of samples over which the error is averaged for the controller during a jump."""
COUNTED = 0.75
"""Share of half the distance over which zeros are counted; the rest leaves time to determine the
brake.
"""
LAG = 1.0 + 1.0 / (ANTIALIASING * PERIOD) + 0.5
"""Samples from a voltage to the zero that it causes, beyond the lens' own motion: the computer's
delay, the anti-aliasing filter, and half a sample until a zero is detected.
"""


def holding_voltage(tracks: int) -> float:
    """Voltage [V] that holds the nominal lens this many tracks from its rest."""
    p = find_drive("radial", "nominal")
    return tracks * TRACK_PITCH * (p.R + SERIES_RESISTANCE) * p.k / (p.Bl * coil_gain(p))


def acceleration(volts: float) -> float:
    """Acceleration [m/s^2] of the nominal lens, moved with its arm by this voltage."""
    p = find_drive("radial", "nominal")
    return volts * coil_gain(p) * p.Bl / ((p.R + SERIES_RESISTANCE) * (p.m1 + p.m2))


@dataclass(frozen=True)
class Jump:
    """A jump across tracks that starts at a time [s], with pulses of at most `volts`."""

    tracks: int
    volts: float
    start: float

    def counted(self, middle: float) -> Controller:
        """Part that counts; middle: sum [V] half way between that on a track and that between two.

        It reads the error and the sum. With 0 for `middle` it counts every zero of the error. It
        returns 1 while the loop is closed, the pulse, and the error for the controller.
        """
        counted = max(1, int(COUNTED * self.tracks))
        parameters = [self.start / PERIOD, self.tracks, self.volts, middle]
        parameters += [holding_voltage(self.tracks), counted, LAG]
        return Controller(
            _counted, np.zeros(8), np.array(parameters), outputs=3, reads=2, dt=PERIOD
        )

    def played(self, pulse: ArrayLike) -> Controller:
        """Part that reads the error, plays a pulse [V] (N,), and returns the same as `counted`."""
        head = [self.start / PERIOD, holding_voltage(self.tracks)]
        parameters = np.concatenate([head, np.asarray(pulse, float)])
        return Controller(_played, np.zeros(2), parameters, outputs=3, reads=1, dt=PERIOD)

    def clocked(self) -> RealArray:
        """Pulse (N,) for the nominal lens as a free mass: kick and brake of equal length."""
        ticks = np.sqrt(self.tracks * TRACK_PITCH / acceleration(self.volts)) / PERIOD
        edges = np.arange(int(np.ceil(2 * ticks)) + 1)
        area = np.minimum(edges, ticks) - np.clip(edges - ticks, 0.0, ticks)
        return self.volts * np.diff(area)  # a sample with an edge has only a part of the pulse

    @staticmethod
    def cascade(law: Controller) -> Cascade:
        """The reference controller with the pulse of a law."""
        parts = [
            Part("jump", law, inputs=["f_en", "sum"], outputs=["closed", "pulse", "held"]),
            Part("seen", blender(), inputs=["closed", "f_en", "held"]),
            Part(
                "K",
                linear_controller(controller("radial"), PERIOD),
                inputs=["seen"],
                outputs=["u_k"],
            ),
            Part("u", adder(), inputs=["u_k", "pulse"]),
        ]
        return Cascade(MEASUREMENTS, parts)


@kernel
def _counted(state: RealArray, parameters: RealArray, given: RealArray, told: RealArray) -> None:
    """Step of `Jump.counted`.

    The state holds the sample, the phase (0 before, 1 counting, 2 still kicking, 3 braking, 4
    after), the samples of the pulse so far and of the kick, the number of half tracks passed, the
    last error, whether the next zero is expected between two tracks, and the mean error.
    """
    start, halves, volts, middle, hold, counted, lag = parameters
    error = given[0]
    if state[1] == 0.0 and state[0] >= start:
        state[1], state[6] = 1.0, 1.0
    elif state[1] == 1.0:
        bright = given[1] > middle
        if error * state[5] <= 0.0 and (middle == 0.0 or bright == (state[6] == 1.0)):
            state[4] += 1.0
            state[6] = 1.0 - state[6]
        if state[4] >= counted:
            kick = (state[2] - lag) * math.sqrt(halves / counted)
            state[1], state[3] = 2.0, max(round(kick), state[2])
    if state[1] == 2.0 and state[2] >= state[3]:
        state[1] = 3.0
    elif state[1] == 3.0 and state[2] >= 2.0 * state[3]:
        state[1] = 4.0
    told[0], told[1] = 1.0, 0.0
    if 1.0 <= state[1] <= 3.0:
        told[0], told[1] = 0.0, volts if state[1] < 3.0 else -volts
        state[2] += 1.0
    elif state[1] == 4.0:
        told[1] = hold
    if told[0] == 1.0:
        state[7] += (error - state[7]) / HELD
    told[2] = state[7]
    state[0] += 1.0
    state[5] = error


@kernel
def _played(state: RealArray, parameters: RealArray, given: RealArray, told: RealArray) -> None:
    """Step of `Jump.played`; the state holds the number of samples and the mean error."""
    place = int(state[0] - parameters[0])
    told[0], told[1] = 1.0, 0.0
    if place >= len(parameters) - 2:
        told[1] = parameters[1]
    elif place >= 0:
        told[0], told[1] = 0.0, parameters[2 + place]
    if told[0] == 1.0:
        state[1] += (given[0] - state[1]) / HELD
    told[2] = state[1]
    state[0] += 1.0
