"""Records with white dots, and records of a pickup that jumps tracks (section 7.1.3).

Section and equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from workbench.simulation import linear_controller, play
from workbench.types import RealArray

from ...drive.photo_diodes import TRACK_PITCH
from ...drive.plants import ANTIALIASING, controller
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD, RATE
from ...laboratory.experiment import Laboratory, measurements
from ..defect_kinds import KINDS, SHOCK_DURATION, SHOCK_PEAK, draw, shocks, white_dot
from ..defect_runs import SETTLING, run, wobbling
from ..diode_plane.problem import DIST_MIN
from ..quality import dimming_detector, diode_quality

WHITE_DOT = "white dot"
DEFECTS = (WHITE_DOT, *KINDS)
"""Kinds of defects that pass."""
DIST_MAX = 0.5
"""Distance [1] from which the quality signal is 0."""
JUMPING = (3.0, 12.0)
"""Peak accelerations [m/s^2] of shocks that make the reference controller jump tracks."""
AFTER = 50e-3
"""Time [s] after the start of a shock in which the sum is evaluated."""
FINER = 16
"""Number of steps per sample in which the passing tracks are followed."""
BEFORE, SHOWN = 70, 500
"""Number of samples shown before a shock, and in all."""


class Met(NamedTuple):
    """Results of one drive for a defect of each kind: each (D,).

    raised: mean sum in the middle half of the defect, over that of the clean disc. binary, quality:
    whether the binary detector and the quality signal report it.
    """

    raised: RealArray
    binary: RealArray
    quality: RealArray


def meet(axis: Axis, drive: str, seed: int, mirror: float) -> Met:
    """One drive over a defect of each kind of DEFECTS; `white_dot` says what ``mirror`` is."""
    rng = np.random.default_rng(seed)
    defects = [white_dot(rng, mirror), *(draw(kind, rng, axis) for kind in KINDS)]
    found = run(Laboratory(axis, drive), defects, int(rng.integers(2**31)))
    signals = measurements(found.record)
    binary = play(dimming_detector(found.level), signals)[:, 0] > 0.5
    law = diode_quality(found.level, DIST_MIN[axis], DIST_MAX)
    quality = play(law, signals)[:, 0] < 1.0
    raised, seen = [], []
    for start, end in found.faults:
        quarter = (end - start) // 4
        middle = slice(start + quarter, end - quarter)
        raised.append(float(found.record.sum[middle].mean()) / found.level)
        seen.append((bool(binary[start:end].any()), bool(quality[start:end].any())))
    told = np.array(seen, float)
    return Met(np.array(raised), told[:, 0], told[:, 1])


class Jump(NamedTuple):
    """A shock to the radial loop, and the focus sum over that on the track.

    tracks: largest number of tracks that the error reached. most: largest sum. mean: mean sum from
    the shock on while tracks pass; NaN if none passes.
    """

    tracks: float
    most: float
    mean: float


def jump(drive: str, seed: int, light: RealArray, jumping: bool) -> Jump:
    """Shake the radial loop, either so that it jumps tracks, or by a shock that it withstands.

    light (P,): at evenly spaced positions from half a pitch before a track to half a pitch after
    it.
    """
    error, total = shaken(drive, seed, light, jumping)
    start = round(SETTLING * RATE)
    inside = slice(start, start + round(AFTER * RATE))
    passing = abs(error[inside]) > TRACK_PITCH / 2
    within = total[inside]
    mean = float(within[passing].mean()) if passing.any() else float("nan")
    return Jump(float(abs(error[inside]).max()) / TRACK_PITCH, float(within.max()), mean)


def shaken(drive: str, seed: int, light: RealArray, jumping: bool) -> tuple[RealArray, RealArray]:
    """Radial error [m] (N,) and focus sum (N,), over that on the track, of a shaken drive."""
    rng = np.random.default_rng(seed)
    peak = rng.uniform(*JUMPING) if jumping else SHOCK_PEAK["radial"]
    sign = float(rng.choice([-1.0, 1.0]))
    bench = Laboratory("radial", drive)
    samples = round((SETTLING + AFTER) * RATE)
    played = sign * shocks(bench, [(SETTLING, float(peak), SHOCK_DURATION)], samples)
    law = linear_controller(controller("radial"), PERIOD)
    disc = wobbling("radial")
    record = bench.closed_loop(law, played, disc=disc, seed=int(rng.integers(2**31)))
    error = record.x_cd - record.x
    return error, focus_sum(error, light)


def focus_sum(error: RealArray, light: RealArray) -> RealArray:
    """Sum of the focus diodes (N,) at radial errors (N,) [m], behind the anti-aliasing filter.

    light is as in `jump`. Tracks may pass faster than samples are taken: the error is linear
    between samples.
    """
    steps = np.arange((len(error) - 1) * FINER + 1) / FINER
    fine = np.interp(steps, np.arange(len(error)), error)
    places = np.linspace(-0.5, 0.5, len(light))
    phase = (fine / TRACK_PITCH + 0.5) % 1.0 - 0.5
    shone = np.interp(phase, places, light) / np.interp(0.0, places, light)
    left = np.exp(-ANTIALIASING * PERIOD / FINER)
    filtered, _ = lfilter([1.0 - left], [1.0, -left], shone, zi=[left * shone[0]])
    total: RealArray = filtered[::FINER]
    return total
