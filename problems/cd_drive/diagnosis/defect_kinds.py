"""Kinds of surface defects and their effect on the light, and mechanical shocks (section 2.5).

On the surface the beam is D = 0.72 mm wide, so an object there is blurred: a spot of width w dims
the light over w + D of the track, by the share of the beam that it blocks, and its edges are as
long as the smaller of both. In the information layer the beam is focused to a micrometre, so a
missing part has sharp edges. A scratch also refracts: the error swings once up and down (section
7.1.2). Section and table numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from workbench.errors import InputError
from workbench.types import RealArray

from ..drive.disc import Defect
from ..drive.optics import blocked_by_hair, blocked_by_particle, readout_beam
from ..drive.red_book import ACCEPTABLE_ERROR
from ..drive.tables import Axis, disc_formats
from ..laboratory.bench_setup import RATE
from ..laboratory.experiment import Laboratory

BEAM = readout_beam(disc_formats()["CD"]).D
"""Diameter of the beam at the surface [m]."""
SHOCK_DURATION = 10e-3
"""Duration of a shock [s]; its shape is half a sine."""
SHOCK_PEAK = {"focus": 10.0, "radial": 1.0}
"""Peak acceleration of a shock [m/s^2] that moves the error close to the acceptable one."""

Draw = Callable[[np.random.Generator, float], Defect]


def _scratch(rng: np.random.Generator, error: float) -> Defect:
    """A scratch 0.2 to 0.5 mm wide, refracting by 0.3 to 0.6 of the acceptable error."""
    width = rng.uniform(0.2e-3, 0.5e-3)
    return Defect(
        length=width + BEAM,
        depth=blocked_by_hair(BEAM, width),
        edge=width / (width + BEAM),
        displacement=rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 0.6) * error,
    )


def _black_dot(rng: np.random.Generator, error: float) -> Defect:
    """A black dot 0.45 to 0.65 mm in diameter, opaque, not refracting.

    Larger dots, from 0.7 mm, leave so little light that the loop may lose the focus.
    """
    diameter = rng.uniform(0.45e-3, 0.65e-3)
    return Defect(
        length=diameter + BEAM,
        depth=blocked_by_particle(BEAM, diameter),
        edge=diameter / (diameter + BEAM),
    )


def _finger_print(rng: np.random.Generator, error: float) -> Defect:
    """A finger print 4 to 10 mm long.

    It takes a quarter to half of the light and refracts by up to 0.2 of the acceptable error.
    """
    return Defect(
        length=rng.uniform(4e-3, 10e-3),
        depth=rng.uniform(0.3, 0.55),
        edge=rng.uniform(0.25, 0.5),
        displacement=rng.uniform(-0.2, 0.2) * error,
    )


def _dropout(rng: np.random.Generator, error: float) -> Defect:
    """A dropout: 0.15 to 0.5 mm of the reflecting layer missing, with sharp edges."""
    return Defect(
        length=rng.uniform(0.15e-3, 0.5e-3),
        depth=rng.uniform(0.6, 0.9),
        edge=rng.uniform(0.02, 0.1),
    )


KINDS: dict[str, Draw] = {
    "scratch": _scratch,
    "finger print": _finger_print,
    "black dot": _black_dot,
    "dropout": _dropout,
}
"""Functions that draw a defect of each kind, given the acceptable error of the axis [m]."""


def white_dot(rng: np.random.Generator, mirror: float) -> Defect:
    """A white dot: 0.15 to 0.5 mm of the layer with shallow pits or none, with sharp edges.

    mirror: light of a layer without pits, over that on a track; the dot's light is at most this.
    The dot adds 30 to 100 % of the difference. It is not in KINDS, so that their draws do not
    change.
    """
    return Defect(
        length=rng.uniform(0.15e-3, 0.5e-3),
        depth=-rng.uniform(0.3, 1.0) * (mirror - 1.0),
        edge=rng.uniform(0.02, 0.1),
    )


def draw(kind: str, rng: np.random.Generator, axis: Axis) -> Defect:
    """A defect of a kind, drawn from its ranges. Raises InputError for an unknown kind."""
    if kind not in KINDS:
        raise InputError(f"defect kind is {kind!r}; known: {', '.join(KINDS)}")
    return KINDS[kind](rng, ACCEPTABLE_ERROR[axis])


def voltage_of_force(bench: Laboratory) -> float:
    """Control voltage per force, u [V/N], with which the coil exerts this force on the lens."""
    return float(bench.actuator.R) / (bench.parameters.Bl * bench.coil_gain)


def shocks(
    bench: Laboratory, many: Sequence[tuple[float, float, float]], samples: int
) -> RealArray:
    """Excitation u [V] (N,) with the same effect on the lens as shocks of the chassis.

    Disc and carriage are accelerated together, while the suspended lens m1 and frame m2 stay behind
    by inertia. Seen from the carriage this is a force (m1 + m2) a, which the coil exerts with

        u = (m1 + m2) a (R + r) / (Bl K),    K from u to the coil's voltage.

    Shocks are half sines with given start [s], peak [m/s^2] and duration [s]. With the duration
    SHOCK_DURATION they are far below the parasitic resonance, near which the point of attack of the
    force would matter.
    """
    drive, volts = bench.parameters, voltage_of_force(bench)
    time = np.arange(samples) / RATE
    pulse = np.zeros(samples)
    for start, peak, lasts in many:
        inside = (time >= start) & (time < start + lasts)
        pulse[inside] += peak * np.sin(np.pi * (time[inside] - start) / lasts)
    excitation: RealArray = (drive.m1 + drive.m2) * volts * pulse
    return excitation
