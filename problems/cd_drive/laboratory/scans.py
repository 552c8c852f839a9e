"""Scans of the s-curve and of the tracks, and the optical gains from them (section 4.4).

Section and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from workbench.arrays import RealArray
from workbench.simulation import Converter

from ..drive.disc import Disc
from ..drive.photo_diodes import S_CURVE_LINEAR, S_CURVE_PEAK, TRACK_PITCH
from .bench_setup import OUTPUT_LIMIT, RATE
from .experiment import Laboratory
from .record import Record

SHOWN_DISTANCE = {"focus": 15e-6, "radial": 2.4e-6}
"""Half of the distance shown [m]: the s-curve and its surroundings, or three tracks."""

RAMP_TIME, CORNER_TIME = 0.4, 0.2
"""Durations [s] of a ramp and of its rounded corners, which do not excite the first resonance."""
TRIANGLE_AMPLITUDE = 0.15
"""Amplitude [V] of the triangle whose flanks are the ramps: about 24 um, 18 um after rounding."""
DITHER_PERIOD = 16
"""Period [samples] of the saw tooth that is added to the ramp, one step of the D/A converter high.

A step moves the lens by 0.8 um at rest; the actuator averages the saw tooth, so the ramp is even.
"""
ROTATION, ECCENTRICITY = 4.0, 20e-6
"""Rotation [Hz] and eccentricity [m] of a slow disc. Its tracks pass at 300 Hz at most, far below
the corner of the anti-aliasing filters."""
WINDOW_SAMPLES = round(0.016 * RATE)
"""Length [samples] of a window in which the speed of the tracks changes linearly."""


class Scan(NamedTuple):
    """Distance [m], difference and sum of the diodes [V] along it, and the gains of `GAINS`."""

    distance: RealArray
    difference: RealArray
    sum: RealArray
    gains: tuple[float, float]


def ramps(passes: int) -> RealArray:
    """Excitation [V] that passes the focus to and fro, after a first period in which it grows."""
    samples = round(2 * RAMP_TIME * RATE)
    cycle = np.arange(samples) / samples
    triangle = 2 / np.pi * np.arcsin(np.sin(2 * np.pi * cycle))
    corner = np.hanning(round(CORNER_TIME * RATE))
    smooth = np.fft.irfft(np.fft.rfft(triangle) * np.fft.rfft(corner / corner.sum(), samples))
    ramp = np.tile(TRIANGLE_AMPLITUDE * smooth, passes + 1)
    ramp[:samples] *= 0.5 - 0.5 * np.cos(np.pi * cycle)
    saw_tooth = np.arange(ramp.size) % DITHER_PERIOD / DITHER_PERIOD
    return ramp + Converter(OUTPUT_LIMIT).step * saw_tooth


def focus_scan(bench: Laboratory, passes: int, seed: int) -> Scan:
    """The s-curve of a disc at rest, averaged over ramps through it."""
    u = ramps(passes)
    record = bench.open_loop(u, seed=seed)
    samples = u.size // (passes + 1)
    turn = int(np.argmax(u[samples : 2 * samples]))

    def to_and_fro(signal: RealArray) -> RealArray:
        average: RealArray = signal[samples:].reshape(passes, samples).mean(axis=0)
        return np.roll(average, -turn).reshape(2, -1)

    grid = np.linspace(-SHOWN_DISTANCE["focus"], SHOWN_DISTANCE["focus"], 401)
    sweeps = []
    for difference, total in zip(
        to_and_fro(record.d1 - record.d2), to_and_fro(record.sum), strict=True
    ):
        centre, half = _s_curve_extremes(difference)
        distance = (np.arange(difference.size) - centre) * S_CURVE_PEAK / half
        inside = np.abs(distance) < S_CURVE_LINEAR
        # A ratio of averages: the noise of the sum would shift an average of ratios.
        x, d, level = (signal[inside] for signal in (distance, difference, total))
        gains = [np.polyfit(x, signal, 1)[0] for signal in (d, d / level)]
        forward = np.argsort(distance)
        shown = [np.interp(grid, distance[forward], s[forward]) for s in (difference, total)]
        sweeps.append([*shown, gains])
    difference, total, gains = (np.mean(part, axis=0) for part in zip(*sweeps, strict=True))
    return Scan(grid, difference, total, (float(gains[0]), float(gains[1])))


def _s_curve_extremes(difference: RealArray) -> tuple[float, float]:
    """Centre of the s-curve, and half the way from its minimum to its maximum, both in samples.

    The second is negative where the curve falls.

    The extremes are flat, so a curve is fitted: straight within the linear range, bent smoothly to
    the extremes by a power of the distance from them, fading beyond as light and error do.
    """
    straight = S_CURVE_LINEAR / S_CURVE_PEAK
    time = np.arange(difference.size)

    def curve(
        time: RealArray, centre: float, half: float, slope: float, top: float, fade: float
    ) -> Any:
        signed = (time - centre) / half
        distance = np.abs(signed)
        left = top - slope * straight
        from_top = np.clip((1 - distance) / (1 - straight), 0.0, 1.0)
        bent = top - left * from_top ** (slope * (1 - straight) / left)
        beyond = top / (1 + fade * np.maximum(distance - 1, 0.0) ** 2) ** 2
        outer = np.where(distance < 1, bent, beyond)
        return np.sign(signed) * np.where(distance < straight, slope * distance, outer)

    coarse = np.convolve(difference, np.full(61, 1 / 61), "same")
    low, high, top = int(coarse.argmin()), int(coarse.argmax()), float(coarse.max())
    guess = np.array([(low + high) / 2, (high - low) / 2, 1.7 * top, top, 1.0])
    scale = np.array([abs(guess[1]), guess[1], top, top, 1.0])
    limits = [[-np.inf, 0.3, 1.05, 0.5, 0.1], [np.inf, 3.0, 2.9, 2.0, 20.0]]
    for _ in range(2):  # the second time with the window at the fitted place
        near = np.abs(time - guess[0]) < 1.5 * abs(guess[1])
        seen, at = difference[near], time[near]
        fit = least_squares(
            lambda p, at=at, seen=seen: (curve(at, *(p * scale)) - seen) / top,
            guess / scale,
            bounds=limits,
        )
        guess = fit.x * scale
    return float(guess[0]), float(guess[1])


def radial_scan(bench: Laboratory, passes: int, seed: int) -> Scan:
    """Tracks that pass a lens at rest: sines whose slope follows from amplitude and pitch."""
    disc = Disc(eccentricity=(ECCENTRICITY,), rotation=ROTATION, run_up=0.0)
    rest = np.zeros(round(passes / (2 * ROTATION) * RATE))
    record = bench.open_loop(rest, disc, seed=seed)
    windows = [
        slice(i, i + WINDOW_SAMPLES)
        for i in range(0, rest.size - WINDOW_SAMPLES + 1, WINDOW_SAMPLES)
    ]
    tracks = [_tracks_passed(record.f_en[window]) for window in windows]
    # Where the disc turns around, tracks pass slowly and not evenly.
    fast = [w for w, count in zip(windows, tracks, strict=True) if count > 0.9 * max(tracks)]
    gains, shown = [], None
    for window in fast:
        phase, amplitudes = _track_passage(record, window)
        gains.append(2 * np.pi / TRACK_PITCH * amplitudes)
        distance = phase * TRACK_PITCH / (2 * np.pi)
        if shown is None:
            shown = distance, (record.d1 - record.d2)[window], record.sum[window]
    assert shown is not None  # the fastest window is one of them
    grid = np.linspace(-SHOWN_DISTANCE["radial"], SHOWN_DISTANCE["radial"], 301)
    K_opt, K_optn = np.mean(gains, axis=0)
    difference, total = (np.interp(grid, shown[0], signal) for signal in shown[1:])
    return Scan(grid, difference, total, (float(K_opt), float(K_optn)))


def _tracks_passed(signal: RealArray) -> float:
    """Approximate number of tracks that pass in a window."""
    finer = 8
    spectrum = np.fft.rfft(signal - signal.mean(), finer * signal.size)
    return float(np.argmax(np.abs(spectrum))) / finer


def _track_passage(record: Record, window: slice) -> tuple[RealArray, RealArray]:
    """Phase [rad] in a window, 0 at a rising crossing near its middle, and both amplitudes.

    A sine whose frequency changes evenly; its amplitudes, of d1 - d2 [V] and f_en, are linear.
    """
    signals = np.column_stack([(record.d1 - record.d2)[window], record.f_en[window]])
    time = np.linspace(-1.0, 1.0, len(signals))

    def basis(motion: RealArray) -> RealArray:
        phase = motion[0] * time + motion[1] * time**2
        return np.column_stack([np.sin(phase), np.cos(phase), np.ones_like(time)])

    def rest(motion: RealArray) -> RealArray:
        columns = basis(motion)
        return signals[:, 1] - columns @ np.linalg.lstsq(columns, signals[:, 1], rcond=None)[0]

    motion = least_squares(rest, [np.pi * _tracks_passed(signals[:, 1]), 0.0]).x
    found = np.linalg.lstsq(basis(motion), signals, rcond=None)[0]
    offset = np.arctan2(found[1, 1], found[0, 1])
    return motion[0] * time + motion[1] * time**2 + offset, np.hypot(found[0], found[1])
