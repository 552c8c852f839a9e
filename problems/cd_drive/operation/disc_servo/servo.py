"""The spindle and its servo by the fill of the data's buffer.

Data enter the buffer as fast as the disc is scanned, and leave it at a constant rate. With b, the
fill beyond its middle [s of data], and w, the scanning velocity 2 pi r f over the disc's own
velocity v_d, less 1,

    b' = w,      w' = a + d - e w,      d = r'/r - e - r T / (J v_d),      e = k^2 / (R J),

where r is the radius, J the inertia, T the friction, and k and R belong to the motor. The servo
knows r from the address, so that it commands the acceleration a = -(J_0 / J)(3 p w + 3 p^2 b + p^3
times the integral of b), J_0 being the inertia that it assumes. Then the loop is the same at every
radius. The thesis prints no number of a disc servo. Section numbers refer to E. Vidal Sanchez,
Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.signal import lfilter, oaconvolve

from workbench.errors import InputError
from workbench.simulation import held_input_matrices
from workbench.types import RealArray

from ...drive.photo_diodes import TRACK_PITCH
from ...drive.tables import compact_disc, disc_formats
from ..sledge.train import NO_LOAD_CURRENT, RESISTANCE, STALL_TORQUE, TORQUE_CONSTANT

MASSES = (14e-3, 20e-3, 33e-3)
"""Masses [kg] of discs: Standard ECMA-130 allows 14 to 33 g; the servo assumes the second."""
HOLE = 15e-3
"""Diameter of the hole of a disc [m] (Standard ECMA-130)."""
TURNTABLE = 2e-6
"""Inertia of turntable and rotor [kg m^2]; a guess for 10 g with a radius of 20 mm."""
RATE = 2 * math.pi * 1.0
"""p [1/s]; a guess: the servo is slower than the disc turns, and faster than friction drifts."""
FRICTION = TORQUE_CONSTANT * NO_LOAD_CURRENT
"""Friction of the motor [N m], of the kind that drives the sledge: the most of its data sheet."""
VARIATION = 0.2
"""Share of the friction by which it may vary either way, in any manner; a guess."""
FRICTION_CORNER = 1.0
"""Corner [Hz] of the simulated variation, a low-passed noise with half of that size, rms, cut off
at its limits.
"""
STEP = 2e-3
"""Time [s] over which a disturbance is taken to be constant."""
STEPS = 4000
"""Length of the impulse responses: 8 s."""


@dataclass(frozen=True)
class Spindle:
    """A disc of a mass [kg] and a velocity v_d [m/s] on the spindle.

    Raises InputError for a mass or a velocity that is not positive and finite.
    """

    mass: float = MASSES[1]
    velocity: float = 1.3

    def __post_init__(self) -> None:
        if not (0.0 < self.mass < math.inf and 0.0 < self.velocity < math.inf):
            raise InputError(f"{self}: mass and velocity must be positive and finite")

    @property
    def inertia(self) -> float:
        """J [kg m^2]."""
        radius = disc_formats()["CD"].disc_diameter / 2
        return self.mass * (radius**2 + (HOLE / 2) ** 2) / 2 + TURNTABLE

    @property
    def braking(self) -> float:
        """e [1/s]."""
        return TORQUE_CONSTANT**2 / (RESISTANCE * self.inertia)

    @property
    def loop(self) -> tuple[RealArray, RealArray]:
        """Matrices of (integral of b, b, w) and of d."""
        share = Spindle(velocity=self.velocity).inertia / self.inertia
        law = share * np.array([RATE**3, 3.0 * RATE**2, 3.0 * RATE])
        a = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], -law - [0.0, 0.0, self.braking]])
        return a, np.array([[0.0], [0.0], [1.0]])

    @cached_property
    def responses(self) -> RealArray:
        """b [s] and w (2, STEPS) after one step at a disturbance of 1 /s."""
        a, b = held_input_matrices(*self.loop, STEP)
        state, found = b[:, 0], np.empty((2, STEPS))
        for k in range(STEPS):
            found[:, k] = state[1:]
            state = a @ state
        return found

    def disturbance(self, radius: RealArray | float, friction: RealArray | float) -> RealArray:
        """d [1/s] at radii [m] and with a friction [N m] of the motor."""
        moving = TRACK_PITCH * self.velocity / (2 * math.pi * np.square(radius))
        slowed = radius * friction / (self.inertia * self.velocity)
        return np.asarray(moving - self.braking - slowed)

    def varied(self, radius: float) -> float:
        """Largest change of d by a friction that varies [1/s]."""
        return radius * VARIATION * FRICTION / (self.inertia * self.velocity)

    def rotation(self, radius: RealArray | float) -> RealArray:
        """Rotation frequency [Hz] at a radius [m] with a buffer whose fill stays."""
        return np.asarray(self.velocity / (2 * math.pi * np.asarray(radius)))

    # --- certified ----------------------------------------------------------------------------

    def swing(self, radius: float) -> float:
        """Largest distance of the fill from its middle [s of data], however friction varies."""
        return self._largest(self.responses[0], radius)

    def deviation(self, radius: float) -> float:
        """Largest relative deviation of the rotation from that with a fill that stays."""
        return self._largest(self.responses[1], radius)

    def turn_change(self, radius: float) -> float:
        """Largest change of the rotation's logarithm from one turn to the next, with that by the
        spiral.
        """
        late = round(1.0 / (float(self.rotation(radius)) * STEP))
        now = self.responses[1]
        change = self._largest(now - np.append(np.zeros(late), now[:-late]), radius)
        return change / (1.0 - self.deviation(radius)) + TRACK_PITCH / radius

    def _largest(self, response: RealArray, radius: float) -> float:
        """Supremum of an output for every friction within its limits, with a bound on the effect of
        the slow change of d along the disc.
        """
        first = compact_disc().lead_in_radius
        drift = abs(np.diff(self.disturbance(first + np.array([0.0, 1e-6]), FRICTION)))[0] / 1e-6
        drift *= TRACK_PITCH * self.velocity / (2 * math.pi * first)
        slow = abs(np.cumsum(response)).sum() * STEP * drift
        return float(abs(response).sum() * self.varied(radius) + slow)

    def least_seek(self, begin: float, end: float) -> float:
        """Time [s] that a jump between radii [m] takes at least, until the rotation is right: with
        the motor's starting torque all the time.
        """
        change = 2 * math.pi * abs(float(self.rotation(end) - self.rotation(begin)))
        return self.inertia * change / STALL_TORQUE


@dataclass(frozen=True, eq=False)
class Played:
    """A disc played from a radius on: times [s], radii [m], fill beyond its middle [s of data], w
    and rotation [Hz], each (N,).
    """

    time: RealArray
    radius: RealArray
    fill: RealArray
    off: RealArray
    rotation: RealArray

    @property
    def turn_change(self) -> RealArray:
        """Change of the rotation's logarithm from a turn ago, from the first turn on."""
        now = np.arange(len(self.time))
        before = now - np.rint(1.0 / (self.rotation * STEP)).astype(int)
        known, level = before >= 0, np.log(self.rotation)
        change: RealArray = level[known] - level[before[known]]
        return change


def played(spindle: Spindle, begin: float, duration: float, rng: np.random.Generator) -> Played:
    """Play a disc from a radius [m] on for a duration [s], with a friction that varies at random
    within its limits; the loop has settled before.
    """
    count = round(duration / STEP)
    time = np.linspace(0.0, STEP * (count - 1), count)
    radius = np.sqrt(begin**2 + TRACK_PITCH * spindle.velocity * time / math.pi)
    left = math.exp(-2 * math.pi * FRICTION_CORNER * STEP)
    noise = lfilter([math.sqrt(1.0 - left**2) / 2], [1.0, -left], rng.standard_normal(count))
    friction = FRICTION * (1.0 + VARIATION * np.clip(noise, -1.0, 1.0))
    d = spindle.disturbance(radius, friction)
    fill, off = (oaconvolve(d - d[0], h)[: count - 1] for h in spindle.responses)
    off = np.append(0.0, off)
    rotation = spindle.rotation(radius) * (1.0 + off)
    return Played(time, radius, np.append(0.0, fill), off, rotation)
