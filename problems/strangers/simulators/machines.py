"""Machines: a motor with friction and backlash, an arm with a payload, a two-mass drive."""

from __future__ import annotations

import numpy as np

from .stranger import Array, Channel, Demand, Parameters, Stranger, Test

RPM = 60.0 / (2.0 * np.pi)
GRAVITY = 9.81


def dry(speed: Array, size: Array, width: float) -> Array:
    """Coulomb friction of this size, smoothed over speeds of this width."""
    friction: Array = size * np.tanh(speed / width)
    return friction


# --- a DC motor, a gear with backlash, a load: speeds [rad/s], and the twist of the gear [rad] ----


def motor_slope(x: Array, u: Array, d: Array, p: Parameters) -> Array:
    """The gear transmits torque once its twist exceeds the play; d is a torque on the load [Nm]."""
    motor, load, twist = x
    drive = p.constant / p.resistance * (u[0] - p.constant * motor)
    pressed = twist - np.clip(twist, -p.play / 2, p.play / 2)
    touching = np.abs(pressed) > 0
    gear = p.stiffness * pressed + p.damping * (motor - load) * (touching | (p.play == 0.0))
    lost = dry(motor, p.coulomb, 1.0) + p.viscous * motor
    return np.array(
        [
            (drive - lost - gear) / p.rotor,
            (gear - p.torque - p.viscous * load - d) / p.inertia,
            motor - load,
        ]
    )


MOTOR = Stranger(
    title="DC motor with friction and backlash",
    nominal={
        **{"constant": 0.05, "resistance": 1.0, "rotor": 2e-4, "inertia": 8e-4},
        **{"stiffness": 0.8, "damping": 2e-3, "play": 0.01, "coulomb": 0.01},
        **{"viscous": 1e-4, "torque": 0.02},
    },
    spread={
        **{"constant": 0.04, "resistance": 0.08, "inertia": 0.15, "stiffness": 0.1},
        **{"damping": 0.3, "play": 0.5, "coulomb": 0.4, "torque": 0.1},
    },
    slope=motor_slope,
    output=lambda x, p: RPM * x[1:2],
    guess=(100.0, 100.0, 0.03),
    rest_u=(6.0,),
    period=2e-3,
    inputs=(Channel("voltage", "V", 0.0, 12.0),),
    outputs=(Channel("speed", "rpm", 0.0, 2000.0, 0.6),),
    test=Test(2000, (1.5,)),
    demand=Demand((50.0,), 0.2, 1.2, load=0.01, dead_zone=2.0),
    seed=6406,
    units=6,
    substeps=4,
    frictionless={"coulomb": 0.0, "play": 0.0},
)


# --- an arm that hangs on a soft hub: angles [rad] and speeds [rad/s] of hub and arm --------------


def arm_slope(x: Array, u: Array, d: Array, p: Parameters) -> Array:
    """Hub and arm with a spring between them. Gravity pulls the arm down; d is a torque [Nm]."""
    hub, hub_speed, arm, arm_speed = x
    inertia = p.inertia + p.payload * p.length**2
    weight = GRAVITY * (p.moment + p.payload * p.length) * np.sin(arm)
    spring = p.stiffness * (hub - arm) + p.damping * (hub_speed - arm_speed)
    lost = p.viscous * hub_speed + dry(hub_speed, p.coulomb, 0.05)
    return np.array(
        [
            hub_speed,
            (u[0] - lost - spring) / p.hub,
            arm_speed,
            (spring - weight - d) / inertia,
        ]
    )


ARM = Stranger(
    title="flexible arm with a payload",
    nominal={
        **{"hub": 0.02, "inertia": 0.12, "payload": 0.15, "length": 0.8, "moment": 0.12},
        **{"stiffness": 60.0, "damping": 0.06, "viscous": 0.15, "coulomb": 0.01},
    },
    spread={"payload": 0.6, "stiffness": 0.06, "damping": 0.3, "viscous": 0.2, "coulomb": 0.4},
    slope=arm_slope,
    output=lambda x, p: np.degrees(x[0:1]),
    guess=(0.3, 0.0, 0.3, 0.0),
    rest_u=(0.8,),
    period=5e-3,
    inputs=(Channel("torque", "Nm", -3.0, 3.0),),
    outputs=(Channel("angle", "deg", -90.0, 90.0, 0.02),),
    test=Test(4000, (0.5,), delimiter=";"),
    demand=Demand((5.0,), 0.25, 12.0, load=0.1, dead_zone=0.2),
    seed=6407,
    substeps=2,
    frictionless={"coulomb": 0.0},
)


# --- a drive of two masses with a fan: speeds [rad/s], twist of the shaft [rad] -------------------


def drive_slope(x: Array, u: Array, d: Array, p: Parameters) -> Array:
    """The fan's torque grows with the square of its speed; d is a torque on the fan [Nm]."""
    motor, fan, twist = x
    shaft = p.stiffness * twist + p.damping * (motor - fan)
    return np.array(
        [
            (u[0] - p.viscous * motor - shaft) / p.rotor,
            (shaft - p.drag * fan * np.abs(fan) - d) / p.inertia,
            motor - fan,
        ]
    )


DRIVE = Stranger(
    title="two-mass drive of a fan",
    nominal={
        **{"rotor": 0.01, "inertia": 0.03, "stiffness": 200.0, "damping": 0.04},
        **{"viscous": 1e-3, "drag": 8e-5, "delay": 1e-3},
    },
    spread={"inertia": 0.12, "stiffness": 0.08, "damping": 0.3, "drag": 0.1, "viscous": 0.3},
    slope=drive_slope,
    output=lambda x, p: RPM * x[0:1],
    guess=(150.0, 150.0, 0.01),
    rest_u=(2.0,),
    period=1e-3,
    inputs=(Channel("torque", "Nm", -5.0, 5.0),),
    outputs=(Channel("speed", "rpm", 0.0, 3000.0, 0.5),),
    test=Test(4000, (0.8,)),
    demand=Demand((30.0,), 0.2, 0.6, load=0.3),
    seed=6408,
    units=6,
    substeps=2,
)
