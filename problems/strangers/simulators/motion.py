"""Fast motion: a levitated ball, a quadrotor's roll axis, a hydraulic cylinder, a disk's arm."""

from __future__ import annotations

import numpy as np

from .stranger import Array, Channel, Demand, Parameters, Stranger, Test

GRAVITY = 9.81


# --- a levitated ball: gap [m], its speed [m/s], current [A] --------------------------------------


def levitation_slope(x: Array, u: Array, d: Array, p: Parameters) -> Array:
    """The magnet pulls with the square of (current / gap); d is a downward force [N]."""
    gap, speed, current = x
    pull = p.magnet * (current / np.maximum(gap, 1e-4)) ** 2
    return np.array([speed, GRAVITY + (d - pull) / p.mass, (u[0] - current) / p.lag])


LEVITATION = Stranger(
    title="magnetic levitation, unstable",
    nominal={"magnet": 2.45e-5, "mass": 0.1, "lag": 5e-4},
    spread={"magnet": 0.06, "mass": 0.06, "lag": 0.2},
    slope=levitation_slope,
    output=lambda x, p: 1e3 * x[0:1],
    guess=(5e-3, 0.0, 1.0),
    rest_y=(5.0,),
    period=2.5e-4,
    inputs=(Channel("current", "A", 0.0, 3.0),),
    outputs=(Channel("gap", "mm", 0.0, 10.0, 2e-3),),
    test=Test(4000, (0.05,), hold=(0.4, 4.4e-3)),
    demand=Demand((0.2,), 0.4, 0.2, load=0.05),
    seed=6409,
    units=6,
    substeps=2,
)


# --- the roll axis of a quadrotor: rate [rad/s], speeds of both pairs of rotors [rad/s] -----------


def roll_slope(x: Array, u: Array, d: Array, p: Parameters) -> Array:
    """Thrust grows with the square of a rotor's speed; d is the torque of a gust [Nm]."""
    rate, left, right = x
    torque = p.arm * p.thrust * (left**2 - right**2)
    wanted = p.swing * u[0]
    return np.array(
        [
            (torque - p.drag * rate + p.imbalance - d) / p.inertia,
            (p.hover + wanted - left) / p.lag,
            (p.hover - wanted - right) / p.lag,
        ]
    )


ROLL = Stranger(
    title="roll axis of a quadrotor",
    nominal={
        **{"arm": 0.15, "thrust": 1e-6, "hover": 600.0, "swing": 200.0, "lag": 0.035},
        **{"inertia": 5e-3, "drag": 0.01, "imbalance": 4e-3, "delay": 4e-3},
    },
    spread={"thrust": 0.12, "lag": 0.15, "inertia": 0.1, "drag": 0.2, "imbalance": 0.9},
    slope=roll_slope,
    output=lambda x, p: np.degrees(x[0:1]),
    guess=(0.0, 600.0, 600.0),
    rest_y=(0.0,),
    period=2e-3,
    inputs=(Channel("command", "1", -1.0, 1.0),),
    outputs=(Channel("rate", "deg/s", -500.0, 500.0, 0.5),),
    test=Test(3000, (0.3,), delimiter=";"),
    demand=Demand((30.0,), 0.25, 0.6, load=5e-3),
    seed=6410,
    units=8,
)


# --- a hydraulic cylinder: position [m], speed [m/s], pressure of the load [Pa], spool [V] --------


def cylinder_slope(x: Array, u: Array, d: Array, p: Parameters) -> Array:
    """Flow grows with the square root of the remaining pressure; d is a force on the piston [N]."""
    _, speed, pressure, spool = x
    left = np.maximum(1.0 - np.sign(spool) * pressure / p.supply, 0.0)
    flow = p.valve * spool * np.sqrt(left)
    return np.array(
        [
            speed,
            (p.area * pressure - p.viscous * speed - p.weight - d) / p.mass,
            p.oil * (flow - p.area * speed - p.leak * pressure),
            (u[0] - spool) / p.lag,
        ]
    )


CYLINDER = Stranger(
    title="hydraulic cylinder, an integrator",
    nominal={
        **{"supply": 1e7, "valve": 4e-5, "area": 1e-3, "viscous": 1500.0, "weight": 2000.0},
        **{"mass": 80.0, "oil": 8e12, "leak": 5e-12, "lag": 8e-3},
    },
    spread={"valve": 0.1, "viscous": 0.2, "weight": 0.1, "mass": 0.15, "oil": 0.1, "lag": 0.15},
    slope=cylinder_slope,
    output=lambda x, p: 1e3 * x[0:1],
    guess=(0.25, 0.0, 2e6, 0.2),
    rest_y=(250.0,),
    period=2e-3,
    inputs=(Channel("valve", "V", -10.0, 10.0),),
    outputs=(Channel("position", "mm", 0.0, 500.0, 0.05),),
    test=Test(5000, (1.5,), hold=(-0.05, 0.0)),
    demand=Demand((10.0,), 0.2, 0.8, load=200.0),
    seed=6411,
    substeps=4,
)


# --- the arm of a disk drive: a pivot, and many modes of the arm ----------------------------------

MODES_HZ, SHARES, RATIOS = (900.0, 1600.0, 2300.0, 3100.0), (0.3, -0.6, 0.8, -1.0), 0.015
"""Frequencies [Hz] of the modes, their shares of the acceleration, and their damping ratio."""


def disk_slope(x: Array, u: Array, d: Array, p: Parameters) -> Array:
    """Each pair of states is a mode. The magnet weakens away from the middle; d is a bias [V]."""
    slopes, force = [], p.gain * (1.0 - (x[0] / p.stroke) ** 2) * (u[0] - d)
    pivot = 2 * np.pi * p.pivot_hz
    rest = pivot**2 * x[0] + 2 * p.pivot_ratio * pivot * x[1] + p.dry * np.tanh(x[1] / 500.0)
    slopes += [x[1], force - rest]
    for k, (frequency, share) in enumerate(zip(MODES_HZ, SHARES, strict=True), start=1):
        omega = 2 * np.pi * frequency * p.__dict__[f"mode{k}"]
        place, speed = x[2 * k], x[2 * k + 1]
        slopes += [speed, share * force - omega**2 * place - 2 * RATIOS * omega * speed]
    return np.array(slopes)


DISK = Stranger(
    title="arm of a disk drive, with many modes",
    nominal={
        **{"gain": 15 * (2 * np.pi * 60.0) ** 2, "stroke": 150.0, "dry": 3e4},
        **{"pivot_hz": 60.0, "pivot_ratio": 0.3, "mode1": 1.0, "mode2": 1.0},
        **{"mode3": 1.0, "mode4": 1.0, "delay": 1e-5},
    },
    spread={
        **{"gain": 0.06, "pivot_hz": 0.08, "pivot_ratio": 0.2, "mode1": 0.02},
        **{"mode2": 0.02, "mode3": 0.02, "mode4": 0.02, "dry": 0.3},
    },
    slope=disk_slope,
    output=lambda x, p: x[0:1] + x[2:3] + x[4:5] + x[6:7] + x[8:9],
    guess=(0.0,) * 10,
    rest_u=(0.0,),
    period=2e-5,
    inputs=(Channel("coil", "V", -5.0, 5.0),),
    outputs=(Channel("track error", "um", -100.0, 100.0, 0.03),),
    test=Test(8000, (1.5,)),
    demand=Demand((5.0,), 0.3, 0.02, load=0.1, dead_zone=0.2),
    seed=6412,
    units=6,
    substeps=2,
    frictionless={"dry": 0.0},
)
