"""Signals of D1, D2, S1, S2 and D3 at focus and radial errors (figure 3.11, section 3.6.2).

A hologram parts the returning light: one half of the pupil falls on D1 and D2, the other on D3. D1,
D2, S1 and S2 are those of the bench with both loops. If the line that parts the pupil runs along
the track, the tracks diffract more light into one half than into the other, and D3 over D1 + D2
varies with the radial error. Where the line runs, the thesis does not say. Light that enters the
pupil at one place leaves it at the opposite one, so dirt on the surface dims both halves alike.
Section and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

import math
from functools import cache
from typing import Literal, get_args

import numpy as np

from workbench.simulation import kernel
from workbench.types import RealArray

from ...drive.photo_diodes import TRACK_PITCH, diode_parameters
from ...drive.radial_error.methods import TrackSensor, printed_depth
from ...drive.tables import AXES
from ...laboratory.bench_setup import find_drive
from ..bench import PITS, STEP, STEPS, track_light, two_axis_diodes

DIODES = ("D1", "D2", "S1", "S2", "D3")
Split = Literal["across", "along"]
SPLITS: tuple[Split, ...] = get_args(Split)
"""Direction of the line that parts the pupil, relative to the track."""
SHARED = 9
"""Number of the parameters of `two_axis_diodes` before the contrast."""


@cache
def half_contrast(split: Split) -> RealArray:
    """Difference of the pupil's halves over their sum (STEPS,) at a quarter of a pitch beside the
    track, at focus errors that are multiples of STEP.

    The pits of neighbouring tracks are shifted to either side equally often.
    """
    quarter = np.array([0.25]) * TRACK_PITCH
    return np.array([_contrast(split, n * STEP, quarter)[0] for n in range(STEPS)])


def diffracted_ratio(split: Split, focus: float, radial: RealArray) -> RealArray:
    """D3 over D1 + D2 (R,) at a focus error and radial errors (R,) [m], without interpolation."""
    difference = _contrast(split, focus, radial)
    ratio: RealArray = (1.0 + difference) / (1.0 - difference)
    return ratio


def _contrast(split: Split, focus: float, radial: RealArray) -> RealArray:
    """Difference of the pupil's halves over their sum (R,)."""
    width, bits, stagger = PITS
    sensors = [
        TrackSensor(printed_depth(), width, bits, shift, focus_error=focus)
        for shift in (stagger, -stagger)
    ]
    light = np.mean([one.reading(radial).mean for one in sensors], axis=0)
    second = [0, 1] if split == "along" else [0, 3]  # quadrants: y > 0, or x > 0
    difference: RealArray = 2.0 * light[:, second].sum(axis=1) / light.sum(axis=1) - 1.0
    return difference


@cache
def sensor_parameters(drive: str, split: Split) -> RealArray:
    """Parameters of `five_diodes`: those of `two_axis_diodes`, then `half_contrast`."""
    own = [diode_parameters(find_drive(axis, drive)) for axis in AXES]
    light = track_light()
    return np.concatenate([*own, [0.0, light.depth, STEP], light.contrast, half_contrast(split)])


@kernel
def five_diodes(
    position: RealArray, exogenous: RealArray, parameters: RealArray, signals: RealArray
) -> None:
    """Voltages of DIODES [V]; exogenous: x_cd, y_cd [m], both with f_sd, and the light."""
    steps = (len(parameters) - SHARED) // 2
    two_axis_diodes(position, exogenous, parameters[: SHARED + steps], signals)
    for i in range(4):
        signals[i] *= exogenous[2]
    off, beside = exogenous[0] - position[0], exogenous[1] - position[1]
    place = min(abs(off) / parameters[8], steps - 1.001)
    left = int(place)
    inside = place - left
    size = (1.0 - inside) * parameters[SHARED + steps + left]
    size += inside * parameters[SHARED + steps + left + 1]
    difference = size * math.sin(parameters[5] * beside)
    signals[4] = (signals[0] + signals[1]) * (1.0 + difference) / (1.0 - difference)


def diode_light(
    drive: str, split: Split, focus: RealArray, radial: RealArray, light: float = 1.0
) -> RealArray:
    """Voltages (5, F, R) [V] of DIODES at focus errors (F,) and radial errors (R,) [m].

    light: reflection of the disc, over that at which the optical gains were measured.
    """
    parameters, rest = sensor_parameters(drive, split), np.zeros(2)
    found = np.zeros((len(focus), len(radial), len(DIODES)))
    for i, x in enumerate(focus):
        for j, y in enumerate(radial):
            five_diodes(rest, np.array([x, y, light]), parameters, found[i, j])
    return np.moveaxis(found, -1, 0)


def normalised_errors(signals: RealArray) -> dict[str, RealArray]:
    """Focus error by the sum of D1 and D2 (eq. 3.16) and by D3, radial error by the sum of S1 and
    S2 (eq. 3.17), and focus error in volts (eq. 3.15), of voltages (5, ...).

    D3 receives as much light as D1 and D2 together, so both readings have the same gain on a track.
    """
    d1, d2, s1, s2, d3 = signals
    return {
        "sum": (d1 - d2) / (d1 + d2),
        "D3": (d1 - d2) / d3,
        "none": d1 - d2,
        "radial": (s1 - s2) / (s1 + s2),
    }
