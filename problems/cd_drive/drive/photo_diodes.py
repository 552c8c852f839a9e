"""Photo diodes: the signals of two diodes as functions of the error (figures 3.12, 4.6, 4.7).

Two diodes share the reflected light; their normalised difference is the error (eq. 3.16-3.17):

    d1, d2 = light * sum(e) * (1 +- f(e)) / 2 * level,        f_en = (d1 - d2) / (d1 + d2).

Focus: f is the s-curve. It has the slope K_optn within its linear range, bends to its extremes 6 um
either side of the focus, where one diode has all the light, and folds back beyond, while the light
itself fades. The disc's surface has a weaker s-curve of its own, which the focus point meets on its
way to the layer. Radial: f is a sine whose period is the track pitch, with the slope K_optn at the
track; the two side spots stand either side of it, and their sum stays.
Equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from workbench.errors import InputError
from workbench.simulation import kernel
from workbench.types import RealArray

from .tables import DiscFormat, Drive, disc_formats

S_CURVE_PEAK = 6e-6
"""Distance of the s-curve's extremes from its centre [m]: 12 um peak to peak (section 4.4.1)."""
S_CURVE_LINEAR = 2e-6
"""Half of the linear range of the s-curve [m]: the largest vertical error allowed (section 2.5.1).
"""
TRACK_PITCH = disc_formats()["CD"].track_pitch
"""Distance between neighbouring tracks [m]."""

REFLECTIVITY = 0.7
"""Least share of the light that the layer of a CD reflects (Standard ECMA-130)."""

CAPTURE = {"focus": S_CURVE_PEAK, "radial": TRACK_PITCH / 2}
"""Error [m] beyond which the focus or the track is lost."""


def surface_of(disc: DiscFormat) -> tuple[float, float]:
    """Distance [m] from the layer at which the lens focuses on the surface, and the surface's light
    over the layer's.

    Near the axis, refraction shortens the cover layer by its index. The light follows from
    Fresnel's equations at normal incidence, divided by the layer's `REFLECTIVITY`.
    """
    index = disc.refractive_index
    return disc.layer_thickness / index, ((index - 1) / (index + 1)) ** 2 / REFLECTIVITY


def diode_parameters(drive: Drive) -> RealArray:
    """Parameters of `focus_diodes` or `radial_diodes`: K_optn [units/m], level of the sum [V], ...

    The level follows from the two optical gains: K_opt = level * K_optn. The third parameter bends
    the curve: it is the exponent of the s-curve, or the phase per metre. Raises InputError if no
    curve with the given extremes has this slope.
    """
    level = drive.K_opt / drive.K_optn
    if drive.axis == "radial":
        bend, reachable = 2 * math.pi / TRACK_PITCH, drive.K_optn * TRACK_PITCH <= 2 * math.pi
    else:
        left = 1.0 - drive.K_optn * S_CURVE_LINEAR
        bend = drive.K_optn * (S_CURVE_PEAK - S_CURVE_LINEAR) / left if left > 0.0 else 0.0
        reachable = bend > 1.0
    if not reachable:
        raise InputError(
            f"{drive.name}: no {drive.axis} characteristic within +-1 has K_optn {drive.K_optn}"
        )
    return np.array([drive.K_optn, level, bend])


@kernel
def s_curve(error: float, K_optn: float, bend: float) -> tuple[float, float]:
    """Normalised error and relative light of the focus diodes at an error [m].

    The exponent makes value and slope continuous at the end of the linear range.
    """
    distance = abs(error)
    if distance <= S_CURVE_LINEAR:
        return K_optn * error, 1.0
    if distance <= S_CURVE_PEAK:
        left = (S_CURVE_PEAK - distance) / (S_CURVE_PEAK - S_CURVE_LINEAR)
        size, light = 1.0 - (1.0 - K_optn * S_CURVE_LINEAR) * left**bend, 1.0
    else:
        size = light = 1.0 / (1.0 + ((distance - S_CURVE_PEAK) / S_CURVE_PEAK) ** 2)
    return math.copysign(size, error), light


@kernel
def focus_diodes(
    position: RealArray, exogenous: RealArray, parameters: RealArray, signals: RealArray
) -> None:
    """Voltages of D1, D2 [V]; exogenous: x_cd [m], light, f_sd [m]."""
    error = exogenous[0] - position[0] + exogenous[2]
    shape, light = s_curve(error, parameters[0], parameters[2])
    level = 0.5 * parameters[1] * exogenous[1] * light
    signals[0] = level * (1.0 + shape)
    signals[1] = level * (1.0 - shape)


@kernel
def surfaced_diodes(
    position: RealArray, exogenous: RealArray, parameters: RealArray, signals: RealArray
) -> None:
    """As `focus_diodes`, with the disc's surface in front of the layer.

    Further parameters: distance of the surface from the layer [m], and its light over the layer's.
    """
    focus_diodes(position, exogenous, parameters, signals)
    error = exogenous[0] - position[0] - parameters[3]
    shape, light = s_curve(error, parameters[0], parameters[2])
    level = 0.5 * parameters[1] * parameters[4] * light
    signals[0] += level * (1.0 + shape)
    signals[1] += level * (1.0 - shape)


@kernel
def radial_diodes(
    position: RealArray, exogenous: RealArray, parameters: RealArray, signals: RealArray
) -> None:
    """Voltages of S1, S2 [V]; exogenous: y_cd [m], light, f_sd [m]."""
    error = exogenous[0] - position[0] + exogenous[2]
    shape = parameters[0] / parameters[2] * math.sin(parameters[2] * error)
    level = 0.5 * parameters[1] * exogenous[1]
    signals[0] = level * (1.0 + shape)
    signals[1] = level * (1.0 - shape)


@kernel
def contrasted_diodes(
    position: RealArray, exogenous: RealArray, parameters: RealArray, signals: RealArray
) -> None:
    """As `radial_diodes`, with more light beside the track than on it (section 4.4.2).

    A further parameter: the light between two tracks over that on a track, minus 1.
    """
    radial_diodes(position, exogenous, parameters, signals)
    error = exogenous[0] - position[0] + exogenous[2]
    light = 1.0 + parameters[3] * math.sin(0.5 * parameters[2] * error) ** 2
    signals[0] *= light
    signals[1] *= light


@kernel
def normalise(channels: RealArray, parameters: RealArray, measurement: RealArray) -> None:
    """The processor's reading (eq. 3.16): d1, d2, v_r, u_m -> f_en, sum, d1, d2, v_r, u_m.

    The sum is raised to at least one step of the converter, parameters (1,) [V], so that the error
    stays finite without light. The error is then meaningless.
    """
    d1, d2 = channels[0], channels[1]
    measurement[0] = (d1 - d2) / max(d1 + d2, parameters[0])
    measurement[1] = d1 + d2
    for i in range(len(channels)):
        measurement[2 + i] = channels[i]


def diode_signals(
    drive: Drive, error: ArrayLike, light: float = 1.0
) -> tuple[RealArray, RealArray]:
    """Voltages [V] of both diodes, each (N,), at errors [m] (N,); light is 1 on a clean disc."""
    errors = np.ascontiguousarray(error, float)
    sense = focus_diodes if drive.axis == "focus" else radial_diodes
    parameters, signals = diode_parameters(drive), np.zeros((errors.size, 2))
    for each, pair in zip(errors, signals, strict=True):
        sense(np.zeros(1), np.array([each, light, 0.0]), parameters, pair)
    return signals[:, 0], signals[:, 1]
