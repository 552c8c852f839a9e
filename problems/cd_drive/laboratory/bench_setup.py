"""The experimental setup around a drive: converters, attenuator, amplifiers (section 3.6).

It leads from the computer's output u [V] to the coil's voltage, and from coil and diodes back to
the computer. Equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant
Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from workbench.errors import InputError
from workbench.simulation import Converter, band_limited_noise
from workbench.types import RealArray, StateSpace

from ..drive.actuator import SERIES_RESISTANCE, Actuator, specific_model
from ..drive.plants import (
    AMPLIFICATION,
    ANTIALIASING,
    ATTENUATION,
    Gain,
    crossover,
    nominal_parameters,
    responses,
    total_gain,
)
from ..drive.tables import ActuatorParameters, Axis, Drive, Values, drives

RATE = 35e3
"""Sampling frequency [Hz]."""
PERIOD = 1.0 / RATE
"""Sampling period [s]."""
INPUT_LIMIT, OUTPUT_LIMIT = 5.0, 10.0
"""Largest magnitudes [V] at the input and at the output converters."""
DIODE_GAIN = 10 ** (60 / 20)
"""Gain of the diodes' amplifiers."""
COIL_GAIN = 10 ** (38 / 20)
"""Gain of the amplifier of the voltage over the series resistor."""
CONTROL_GAIN = ATTENUATION * AMPLIFICATION
"""Gain from u to the point before the power drive where the control signal is measured."""
CHANNEL_GAINS = {"d1": DIODE_GAIN, "d2": DIODE_GAIN, "v_r": COIL_GAIN, "u_m": CONTROL_GAIN}
"""Gains of the measured channels before the converters."""
CHANNELS = tuple(CHANNEL_GAINS)
"""Names of the measured channels."""
ELECTRICAL = ("v_r", "u_m")
"""Measured channels that do not depend on the optics."""
NOISE = {"focus": 0.15e-6, "radial": 0.015e-6}
"""Default noise of the measured position [m rms], by axis."""


def find_drive(axis: Axis, name: str, values: Values = "printed") -> Drive:
    """One axis of the drive CD1 ... CD12, or of the "nominal" drive with mid-range optical gains.

    Raises InputError for any other name.
    """
    twelve = drives(axis, values)
    if name == "nominal":
        p = nominal_parameters(axis)
        optics = {
            gain: (min(values) + max(values)) / 2
            for gain, values in (
                ("K_opt", [drive.K_opt for drive in twelve]),
                ("K_optn", [drive.K_optn for drive in twelve]),
            )
        }
        lumped = {"k": p.k1 * p.k2 / (p.k1 + p.k2), "b": p.b1 + p.b2}
        # No model here uses the inductance, so that of the first drive is kept.
        changed: dict[str, Any] = {"name": name, "R_measured": p.R, **vars(p), **lumped, **optics}
        return replace(twelve[0], **changed)
    for drive in twelve:
        if drive.name == name:
            return drive
    raise InputError(f'drive is {name!r}; it must be "CD1" ... "CD12" or "nominal"')


def aged(drive: Drive, suspension: float) -> Drive:
    """A drive with k1 and b1 of its suspension multiplied by a factor. Raises InputError if it is
    not > 0.
    """
    if not 0.0 < suspension < np.inf:
        raise InputError(f"suspension is {suspension}; it must be positive and finite")
    k1, b1 = suspension * drive.k1, suspension * drive.b1
    k = k1 * drive.k2 / (k1 + drive.k2)
    return replace(drive, k1=k1, b1=b1, k=k, b=b1 + drive.b2)


def coil_gain(drive: Drive, gain: Gain = "own", values: Values = "printed") -> float:
    """Gain from u to the coil's voltage [V/V]: K_total / K_optn = K_at K_amp K_pd (eq. 3.11, 3.18).

    `gain` is as in `drives.responses`. Equation 3.18 itself leaves out the power drive's K_pd.
    """
    if drive.name == "nominal":
        return total_gain(drive.axis) / drive.K_optn
    at = [crossover(drive.axis)]
    row = [each.name for each in drives(drive.axis, values)].index(drive.name)
    loop = responses(drive.axis, at, gain, values, antialiasing=False)[row, 0]
    return float(abs(loop) / abs(specific_model(drive).response(at)[0]) / drive.K_optn)


def split_arms(parameters: ActuatorParameters, mismatch: float | Sequence[float]) -> Actuator:
    """The specific model with its arm in n parts whose links to the lens differ (section 4.6.2).

    Each part has an n-th of m2, k1 and b1; link i has k2 (1 + mismatch_i) / n, and its damper
    likewise. A single number stands for two halves with this mismatch and its opposite. Without
    mismatch the lens moves as in the specific model. If all parts differ, there are n parasitic
    resonances close together, and the model has order 2 n + 2.

    Raises InputError if a mismatch is not between -1 and 1, if their sum is not 0, or if a single
    number is negative.
    """
    if isinstance(mismatch, (int, float)):
        if not 0.0 <= mismatch < 1.0:
            raise InputError(f"mismatch is {mismatch}; it must be 0 or more and below 1")
        mismatch = (mismatch, -mismatch)
    off = np.array(mismatch, float)
    if off.ndim != 1 or not off.size or not (abs(off) < 1.0).all() or abs(off.sum()) > 1e-9:
        raise InputError(f"mismatch is {mismatch}; each must be between -1 and 1, their sum 0")
    whole, n = specific_model(parameters), off.size
    lens, *arms = np.eye(n + 1)
    mass = parameters.m1 * np.outer(lens, lens)
    damping, stiffness = np.zeros((2, n + 1, n + 1))
    for arm, share in zip(arms, (1 + off) / n, strict=True):
        frame, link = np.outer(arm, arm), np.outer(lens - arm, lens - arm)
        mass = mass + parameters.m2 / n * frame
        damping = damping + parameters.b1 / n * frame + parameters.b2 * share * link
        stiffness = stiffness + parameters.k1 / n * frame + parameters.k2 * share * link
    return replace(whole, M=mass, C=damping, K=stiffness)


def electromechanics(
    actuator: Actuator, to_coil: float, series_resistance: float = SERIES_RESISTANCE
) -> StateSpace:
    """Computer output u [V] -> lens x [m]; v_r and u_m [V] behind anti-aliasing filters.

    v_r = r i is the voltage over the series resistor, with i = (v - Bl x') / (R + r); u_m = u is
    the measured control signal. Both are the signals before their amplifiers. series_resistance: r
    [ohm], which the actuator's R includes.
    """
    import control

    moving = actuator.state_space()
    n = moving.nstates
    velocity = n // 2  # displacements come first, the lens's at the head
    ratio = series_resistance / float(actuator.R)
    a = np.zeros((n + 2, n + 2))
    a[:n, :n] = moving.A
    a[n, velocity] = -ANTIALIASING * ratio * float(actuator.Bl)
    a[n, n] = a[n + 1, n + 1] = -ANTIALIASING
    b = np.vstack([moving.B * to_coil, [[ANTIALIASING * ratio * to_coil], [ANTIALIASING]]])
    c = np.zeros((3, n + 2))
    c[0, 0] = c[1, n] = c[2, n + 1] = 1.0
    return control.ss(a, b, c, 0.0, inputs="u", outputs=["x", "v_r", "u_m"])


def channel_converters(bits: int | None) -> RealArray:
    """Levels (4, 3) of the input converters, referred to the signals before their amplifiers."""
    return np.array(
        [Converter(INPUT_LIMIT, bits=bits).levels(gain=gain) for gain in CHANNEL_GAINS.values()]
    )


def optical_noise(
    rng: np.random.Generator, samples: int, drive: Drive, size: float, band: float
) -> RealArray:
    """Noise of the diodes (N, 2) [V] that causes `size` [m rms] of noise in the measured position.

    It is white from 0 to `band` [Hz]. The noises of the two diodes are independent with half of the
    power each, so their sum is as noisy as their difference.
    """
    return band_limited_noise(rng, (samples, 2), drive.K_opt * size / np.sqrt(2), band, 1 / RATE)


def electronics_noise(rng: np.random.Generator, samples: int, steps: float) -> RealArray:
    """White noise of v_r and u_m (N, 2) [V], of `steps` rms steps of a 12-bit converter."""
    gains = [CHANNEL_GAINS[name] for name in ELECTRICAL]
    return rng.standard_normal((samples, 2)) * (steps * Converter(INPUT_LIMIT).step) / gains
