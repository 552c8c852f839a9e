"""The sledge: a motor, a worm gear and a carriage on rods, with friction in motor and rods.

All is referred to the carriage, with the gear's way per angle l,

    J / l^2 v_m' = (k / R) (V - k v_m / l) / l - k_g (z_m - z) - c_g (v_m - v) - motor's friction,
            m v' = k_g (z_m - z) + c_g (v_m - v) - rods' friction,

and V is the low-passed control voltage of the radial coil times a gain: the motor turns until the
lens is in its middle on average. Friction is Coulomb's: at rest it holds up to a static force, and
in motion it is a smaller, kinetic one. The forces of the lens on the carriage are left out. Section
numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Self

import numpy as np

from workbench.errors import InputError
from workbench.simulation import Controller, kernel
from workbench.types import RealArray

from ...drive.actuator import SERIES_RESISTANCE
from ...laboratory.bench_setup import PERIOD, coil_gain, find_drive

RATED_VOLTAGE, NO_LOAD_SPEED, STALL_TORQUE = 3.0, 3900 * math.pi / 30, 15e-5 * 9.81
"""Voltage [V], speed without load [rad/s] and starting torque [N m] of the motor RF-300CA-11400, a
kind that moves sledges of CD players (data sheet of Kysan Electronics).
"""
NO_LOAD_CURRENT, STARTING_VOLTAGE = 35e-3, 1.0
"""Largest current without load [A] and largest starting voltage [V], by the same data sheet."""
TORQUE_CONSTANT = RATED_VOLTAGE / (NO_LOAD_SPEED + NO_LOAD_CURRENT * RATED_VOLTAGE / STALL_TORQUE)
"""k [N m/A] = [V s/rad]: at the rated voltage R i + k w = 3 V without load, and k 3 V / R is the
starting torque.
"""
RESISTANCE = RATED_VOLTAGE * TORQUE_CONSTANT / STALL_TORQUE
"""R [ohm]."""
NOT_ZERO = ("inertia", "lead", "mass", "stiffness", "corner_hz", "start")
"""Numbers of a sledge that must be above 0."""


@dataclass(frozen=True)
class Sledge:
    """A sledge and its servo. The thesis prints no number of them: all are guesses.

    Parameters
    ----------
    starting_voltage
        Voltage [V] at which the motor starts; the data sheet allows STARTING_VOLTAGE.
    no_load_current
        Current [A] against the motor's kinetic friction; the data sheet allows NO_LOAD_CURRENT.
    rods
        Static friction of the carriage on its rods [N]. A clean carriage of 50 g with a coefficient
        of 0.2 has 0.1 N; dirt and dry grease have more.
    kinetic
        Kinetic friction of the rods over the static one.
    inertia
        Of the rotor [kg m^2]: 6.5 g with a radius of 7 mm.
    lead
        Way of the carriage in a turn of the motor [m]: across a disc in 2 s at the rated voltage.
    mass
        Of carriage and pickup [kg].
    stiffness
        Of the gear [N/m].
    damping
        Of the gear: its damper over the critical one of the carriage.
    corner_hz
        Corner of the servo's low-pass [Hz], below the rotation.
    start
        Mean excursion of the lens at which the motor starts [m]: a third of the few hundred tracks
        that the coil reaches (section 2.5.2).

    Raises InputError for a number that is negative or not finite, and for one of NOT_ZERO that is
    0.
    """

    starting_voltage: float = 0.5
    no_load_current: float = 20e-3
    rods: float = 0.1
    kinetic: float = 0.7
    inertia: float = 1.5e-7
    lead: float = 0.3e-3
    mass: float = 0.05
    stiffness: float = 2e4
    damping: float = 0.05
    corner_hz: float = 1.5
    start: float = 150e-6

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not (0.0 <= value < math.inf) or (value == 0.0 and name in NOT_ZERO):
                least = "positive" if name in NOT_ZERO else "0 or more"
                raise InputError(f"{name} is {value}; it must be {least} and finite")

    @classmethod
    def with_rods(cls, rods: float) -> Self:
        """A sledge with this static friction of its rods [N]; with 0 it has no stiction at all."""
        return cls(rods=rods) if rods else cls().without_stiction

    @classmethod
    def drawn(cls, rng: np.random.Generator, rods: float) -> Self:
        """A sledge as `with_rods` makes it, with other numbers drawn about the guesses."""
        starting = rng.uniform(0.3, STARTING_VOLTAGE)
        found = cls(
            starting_voltage=starting,
            # its kinetic friction is below the static one
            no_load_current=min(rng.uniform(0.3, 0.8) * starting / RESISTANCE, NO_LOAD_CURRENT),
            rods=rods,
            kinetic=rng.uniform(0.5, 0.9),
            mass=rng.uniform(0.03, 0.07),
            stiffness=2e4 * 2.0 ** rng.uniform(-1.0, 1.0),
        )
        return found if rods else found.without_stiction

    @property
    def without_stiction(self) -> Self:
        """The sledge with smooth rods, and a motor whose static friction is no more than its
        kinetic one.
        """
        current = self.starting_voltage / RESISTANCE
        return replace(self, rods=0.0, kinetic=1.0, no_load_current=current)

    @property
    def way(self) -> float:
        """l [m/rad]."""
        return self.lead / (2 * math.pi)

    @property
    def drop(self) -> float:
        """Static less kinetic friction of the rods [N]."""
        return (1.0 - self.kinetic) * self.rods

    def slip_speed(self, motor: float) -> float:
        """Largest speed [m/s] of a slip with the motor at a constant speed [m/s].

        The carriage starts at rest with the gear stretched by the static friction, and swings about
        the stretch of the kinetic one. The gear's damper is left out.
        """
        swing = self.drop / math.sqrt(self.stiffness * self.mass)
        return motor + math.hypot(motor, swing)

    def harmless_drop(self, speed: float, motor: float) -> float:
        """Largest drop of the friction [N] with which no slip is faster than `speed` [m/s]; 0 if
        the motor alone makes it so.
        """
        squared = (speed - motor) ** 2 - motor**2
        if speed < 2.0 * motor:
            return 0.0
        return math.sqrt(self.stiffness * self.mass * squared)

    def servo(self, drive: str) -> Controller:
        """Part that reads the radial command u [V]; it returns the speeds [m/s] of carriage and
        motor.
        """
        per_volt = TORQUE_CONSTANT / RESISTANCE / self.way
        gain = self.starting_voltage / (volts_per_metre(drive) * self.start)
        damper = 2.0 * self.damping * math.sqrt(self.stiffness * self.mass)
        motor = (
            self.inertia / self.way**2,
            per_volt * self.starting_voltage,
            TORQUE_CONSTANT * self.no_load_current / self.way,
        )
        carriage = self.mass, self.rods, self.kinetic * self.rods
        law = 1.0 - math.exp(-2 * math.pi * self.corner_hz * PERIOD), per_volt * gain
        emf = per_volt * TORQUE_CONSTANT / self.way
        parameters = np.array([PERIOD, *law, emf, self.stiffness, damper, *motor, *carriage])
        return Controller(_sledge, np.zeros(4), parameters, outputs=2, reads=1, dt=PERIOD)


def volts_per_metre(drive: str) -> float:
    """Control voltage that holds the lens of a drive one metre from its middle, radially [V/m]."""
    p = find_drive("radial", drive)
    k = p.k1 * p.k2 / (p.k1 + p.k2)
    return (p.R + SERIES_RESISTANCE) * k / (p.Bl * coil_gain(p))


@kernel
def moved(speed: float, force: float, dt: float, friction: RealArray) -> float:
    """Speed of a mass after a step dt [s] under a force [N]; friction: mass [kg], static and
    kinetic friction [N].

    At rest the static friction holds. In motion the kinetic one stops the mass if it can do so
    within the step.
    """
    if speed == 0.0 and abs(force) <= friction[1]:
        return 0.0
    free = speed + dt / friction[0] * force
    most = dt / friction[0] * friction[2]
    return 0.0 if abs(free) <= most else free - math.copysign(most, free)


@kernel
def _sledge(state: RealArray, p: RealArray, given: RealArray, told: RealArray) -> None:
    """Step of `Sledge.servo`; the state holds the low-pass, both speeds, and the gear's stretch."""
    dt = p[0]
    state[0] += p[1] * (given[0] - state[0])
    gear = p[4] * state[3] + p[5] * (state[1] - state[2])
    state[1] = moved(state[1], p[2] * state[0] - p[3] * state[1] - gear, dt, p[6:9])
    state[2] = moved(state[2], gear, dt, p[9:12])
    state[3] += dt * (state[1] - state[2])
    told[0], told[1] = state[2], state[1]
