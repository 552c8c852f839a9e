"""Both loops of a drive on one bench, with the diodes of both axes under one spot.

The signals and filters are those of the laboratory of one axis. What is new is that each diode sees
both errors. Focus: the tracks reflect less than the space between them, so the light varies with
the radial error. Radial: out of focus the tracks fade, by the contrast that scalar diffraction
gives, and with the light that fades beyond the s-curve both sums fall. A share of each error may be
seen by the other axis. Section and equation numbers refer to E. Vidal Sanchez, Robust and Fault
Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from workbench.simulation import Controller, Converter, SampledLoop, kernel, linear_controller
from workbench.types import RealArray, StateSpace

from ..drive.disc import Disc
from ..drive.photo_diodes import TRACK_PITCH, diode_parameters, s_curve
from ..drive.plants import ANTIALIASING, controller
from ..drive.radial_error.methods import TrackSensor, printed_depth
from ..drive.tables import AXES
from ..laboratory.bench_setup import (
    DIODE_GAIN,
    INPUT_LIMIT,
    NOISE,
    OUTPUT_LIMIT,
    PERIOD,
    RATE,
    optical_noise,
)
from .paths import UNCOUPLED, Coupling, TwoAxes

MEASUREMENTS = ("f_en", "r_en", "focus sum", "radial sum")
NOISE_BAND = 1750.0
"""Band [Hz] of the diodes' noise, as in the laboratory of one axis."""
PITS = (0.5e-6, 6, 0.3)
"""Width [m], length [channel bits] and stagger of the pits; the contrast hardly depends on them."""
STEP, STEPS = 0.25e-6, 49
"""Focus errors [m] at which the tracks' contrast is tabulated: from 0 to 12 um."""

LEAST_DIVISOR = Converter(INPUT_LIMIT).step / DIODE_GAIN
"""Least voltage [V] by which an error is divided: one step of the converter."""


class TwoAxisRecord(NamedTuple):
    """Signals (N, 2) of focus and radial loop: command [V], measured and true error, sums [V].

    The measured error is normalised [units], the true one in m.
    """

    command: RealArray
    read: RealArray
    error: RealArray
    sums: RealArray


class TrackLight(NamedTuple):
    """Light of the tracks: amplitude of its variation across them over the mean light in focus, and
    that amplitude out of focus, at multiples of STEP, over the one in focus (STEPS,).
    """

    depth: float
    contrast: RealArray


@cache
def track_light() -> TrackLight:
    """The light of a CD's tracks by scalar diffraction, averaged along them."""
    place = np.array([0.0, 0.5]) * TRACK_PITCH
    width, bits, stagger = PITS
    light = np.array(
        [
            TrackSensor(printed_depth(), width, bits, stagger, focus_error=one).light(place)
            for one in STEP * np.arange(STEPS)
        ]
    )
    size = (light[:, 1] - light[:, 0]) / 2
    return TrackLight(float(size[0] / light[0].mean()), size / size[0])


@dataclass(frozen=True)
class TwoAxisBench:
    """One drive on the bench with both loops closed.

    noise: whether diodes are noisy. bits: resolution of the converters; None: they saturate, but do
    not round. refine: number of steps per sample in which the optics are simulated.
    """

    drive: str
    coupling: Coupling = UNCOUPLED
    noise: bool = True
    bits: int | None = 12
    refine: int = 1

    @cached_property
    def two(self) -> TwoAxes:
        return TwoAxes(self.drive, self.coupling)

    def closed_loop(
        self,
        disc: Disc,
        duration: float,
        excitation: ArrayLike | None = None,
        seed: int = 0,
    ) -> TwoAxisRecord:
        """Run both reference controllers for a duration [s] from rest.

        excitation (N, 2) [V] is added to the commands.
        """
        samples = round(duration / PERIOD)
        time = np.arange(samples + 1) / RATE
        layer = np.column_stack([disc.deviation(axis, time) for axis in AXES])
        added = np.zeros((samples, 2)) if excitation is None else excitation
        noise = self._noise(seed, samples)
        found = _loop(self).run(reference_controllers(), added, layer, noise)
        error = layer[:-1] - found.position
        read = found.measurement
        return TwoAxisRecord(found.command, read[:, :2], error, read[:, 2:])

    def _noise(self, seed: int, samples: int) -> RealArray:
        if not self.noise:
            return np.zeros((samples, 4))
        rng = np.random.default_rng(seed)
        axes = zip(AXES, self.two.axes, strict=True)
        return np.hstack(
            [optical_noise(rng, samples, one, NOISE[axis], NOISE_BAND) for axis, one in axes]
        )


def reference_controllers() -> Controller:
    """Both reference controllers, each reading its own normalised error."""
    import control

    both: StateSpace = control.append(*(control.ss(controller(axis)) for axis in AXES))
    return linear_controller(both, PERIOD, measurements=(0, 1))


@cache
def _loop(bench: TwoAxisBench) -> SampledLoop:
    axes, light = bench.two.axes, track_light()
    own = [diode_parameters(one) for one in axes]
    shared = [bench.coupling.optical, light.depth, STEP]
    return SampledLoop(
        sense=two_axis_diodes,
        sense_parameters=np.concatenate([*own, shared, light.contrast]),
        read=read_both,
        read_parameters=np.array([LEAST_DIVISOR]),
        measurements=len(MEASUREMENTS),
        **electronics(bench.two, 4, bench.bits),
        refine=bench.refine,
    )


def electronics(two: TwoAxes, signals: int, bits: int | None) -> dict[str, Any]:
    """Actuators, filters, converters and clock of both loops with a number of diodes."""
    levels = Converter(INPUT_LIMIT, bits=bits).levels(gain=DIODE_GAIN)
    return {
        "plant": two.actuator,
        "positions": 2,
        "signals": signals,
        "corner": ANTIALIASING,
        "channel_levels": np.tile(levels, (signals, 1)),
        "output_levels": np.tile(Converter(OUTPUT_LIMIT, bits=bits).levels(), (2, 1)),
        "dt": PERIOD,
        "delay_samples": 1.0,
    }


@kernel
def two_axis_diodes(
    position: RealArray, exogenous: RealArray, parameters: RealArray, signals: RealArray
) -> None:
    """Voltages of D1, D2, S1, S2 [V]; exogenous: x_cd, y_cd [m].

    Parameters: `diode_parameters` of both axes, the optical share, depth and step of the tracks'
    light, and its contrast (see `TrackLight`).
    """
    off, beside = exogenous[0] - position[0], exogenous[1] - position[1]
    share, depth, step = parameters[6], parameters[7], parameters[8]
    x, y = off + share * beside, beside + share * off
    place = min(abs(off) / step, len(parameters) - 10.001)
    left = int(place)
    inside = place - left
    contrast = (1.0 - inside) * parameters[9 + left] + inside * parameters[10 + left]
    shape, light = s_curve(x, parameters[0], parameters[2])
    turn = parameters[5]
    brightness = (1.0 - depth * contrast * math.cos(turn * beside)) / (1.0 - depth)
    level = 0.5 * parameters[1] * light * brightness
    signals[0] = level * (1.0 + shape)
    signals[1] = level * (1.0 - shape)
    shape = contrast * parameters[3] / turn * math.sin(turn * y)
    level = 0.5 * parameters[4] * light
    signals[2] = level * (1.0 + shape)
    signals[3] = level * (1.0 - shape)


@kernel
def read_both(channels: RealArray, parameters: RealArray, measurement: RealArray) -> None:
    """The processor's reading (eq. 3.16, 3.17): d1, d2, s1, s2 -> f_en, r_en, and both sums.

    Each sum is raised to at least one step of the converter, parameters (1,) [V].
    """
    for axis in range(2):
        one, other = channels[2 * axis], channels[2 * axis + 1]
        measurement[axis] = (one - other) / max(one + other, parameters[0])
        measurement[2 + axis] = one + other
