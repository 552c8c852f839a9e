"""Scans of the s-curve and of the tracks, and the optical gains from them (section 4.4).

Section and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from workbench.simulation import Converter
from workbench.types import RealArray

from ..drive.disc import Disc
from ..drive.photo_diodes import S_CURVE_LINEAR, S_CURVE_PEAK, TRACK_PITCH
from .bench_setup import OUTPUT_LIMIT, RATE
from .experiment import Laboratory
from .record import Record

SHOWN_DISTANCE = {"focus": 15e-6, "radial": 2.4e-6}
"""Half of the displayed distance [m]: the s-curve and its surroundings, or three tracks."""

RAMP_TIME, CORNER_TIME = 0.4, 0.2
"""Durations [s] of a ramp and of its rounded corners, which do not excite the first resonance."""
TRIANGLE_AMPLITUDE = 0.15
"""Amplitude [V] of the triangle wave whose flanks are the ramps: about 24 um, or 18 um after
rounding.
"""
DITHER_PERIOD = 16
"""Period [samples] of the sawtooth that is added to the ramp; its height is one step of the D/A
converter.

A step moves the lens by 0.8 um at rest. The actuator averages the sawtooth, so the ramp is even.
"""
ROTATION, ECCENTRICITY = 4.0, 20e-6
"""Rotation [Hz] and eccentricity [m] of a slow disc. Its tracks pass at 300 Hz at most, far below
the corner of the anti-aliasing filters."""
WINDOW_SAMPLES = round(0.016 * RATE)
"""Length [samples] of a window within which the speed of the tracks changes linearly."""


GROUPS = 5
"""Number of groups into which the passes of the s-curve are divided; their scatter shows the noise.
"""
TOP_SHARE, TOP_DEGREE = 0.25, 3
"""Length of the stretch around an extreme, over half the distance between the extremes, and degree
of the polynomial fitted there. No shape of the s-curve is assumed.
"""


class Scan(NamedTuple):
    """Distance [m], difference and sum of the diodes [V] along it, and the gains that they give.

    gains: K_opt [V/m] and K_optn [units/m]. scatter (2,): their relative standard errors by the
    noise, from `repeats` repetitions. law: relative change of the gains if no shape of the s-curve
    is assumed; 0 radially, where the shape is a sine.
    """

    distance: RealArray
    difference: RealArray
    sum: RealArray
    gains: tuple[float, float]
    scatter: tuple[float, float]
    repeats: int
    law: float = 0.0


def ramps(passes: int) -> RealArray:
    """Excitation [V] that passes the focus to and fro; its size grows during the first period."""
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
        """Averages (GROUPS, 2, N) of the passes of each group, in both directions."""
        cut = signal[samples:].reshape(passes, samples)
        groups = [part.mean(axis=0) for part in np.array_split(cut, min(GROUPS, passes))]
        turned: RealArray = np.roll(groups, -turn, axis=1).astype(float)
        return turned.reshape(len(groups), 2, -1)

    grid = np.linspace(-SHOWN_DISTANCE["focus"], SHOWN_DISTANCE["focus"], 401)
    differences, totals = to_and_fro(record.d1 - record.d2), to_and_fro(record.sum)
    repeats = [
        _s_curve_gains(*pair)
        for pair in zip(
            differences.reshape(-1, samples // 2), totals.reshape(-1, samples // 2), strict=True
        )
    ]
    gains, scatter = _with_scatter(repeats)
    shown, free = [], []
    for pair in zip(differences.mean(axis=0), totals.mean(axis=0), strict=True):
        distance = _distance(pair[0], *_s_curve_extremes(pair[0]))
        forward = np.argsort(distance)
        shown.append([np.interp(grid, distance[forward], one[forward]) for one in pair])
        free.append(_top_to_top(pair[0]) / abs(_s_curve_extremes(pair[0])[1]))
    difference, total = np.mean(shown, axis=0)
    law = float(abs(np.mean(free) - 1.0))
    return Scan(grid, difference, total, gains, scatter, len(repeats), law)


def _distance(difference: RealArray, centre: float, half: float) -> RealArray:
    """Distance [m] from the focus at each sample, from the centre and half distance of the
    extremes.
    """
    distance: RealArray = (np.arange(float(difference.size)) - centre) * (S_CURVE_PEAK / half)
    return distance


def _s_curve_gains(difference: RealArray, total: RealArray) -> RealArray:
    """Slopes of the difference [V/m] and of the normalised error [units/m] around the focus."""
    distance = _distance(difference, *_s_curve_extremes(difference))
    inside = np.abs(distance) < S_CURVE_LINEAR
    # The ratio of averages is used, since the noise of the sum would bias an average of ratios.
    x, d, level = (signal[inside] for signal in (distance, difference, total))
    return np.array([np.polyfit(x, signal, 1)[0] for signal in (d, d / level)])


def _with_scatter(repeats: list[RealArray]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Means of repeated gains (R, 2), and the relative standard errors of the means."""
    mean, spread = np.mean(repeats, axis=0), np.std(repeats, axis=0, ddof=1)
    scatter = spread / abs(mean) / np.sqrt(len(repeats))
    return (float(mean[0]), float(mean[1])), (float(scatter[0]), float(scatter[1]))


def _top_to_top(difference: RealArray) -> float:
    """Half the distance between the extremes [samples], found as the tops of local polynomials.

    It assumes no shape of the s-curve, but moves a sharp extreme towards its flatter side.
    """
    coarse = np.convolve(difference, np.full(61, 1 / 61), "same")
    ends = np.array([coarse.argmin(), coarse.argmax()], float)
    half = abs(ends[1] - ends[0]) / 2
    for _ in range(4):
        for end, sign in enumerate((-1.0, 1.0)):
            near = np.arange(
                int(ends[end] - TOP_SHARE * half), int(ends[end] + TOP_SHARE * half) + 1
            )
            x = (near - ends[end]) / half
            curve = np.polynomial.Polynomial.fit(x, sign * difference[near], TOP_DEGREE)
            fine = np.linspace(-TOP_SHARE, TOP_SHARE, 401)
            ends[end] += half * fine[np.argmax(curve(fine))] / 2
    return float(abs(ends[1] - ends[0]) / 2)


def _s_curve_extremes(difference: RealArray) -> tuple[float, float]:
    """Centre of the s-curve, and half the distance from its minimum to its maximum, both in
    samples.

    The half distance is negative if the curve falls.

    The extremes are flat, so a curve is fitted: a straight line within the linear range, then a
    smooth bend to the extremes by a power of the distance from them, and a decay beyond, as light
    and error fade.
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
    for _ in range(2):  # the second time with the window at the fitted position
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
    """Scan of tracks that pass a lens at rest: amplitude and pitch of the sines give
    their slope.
    """
    disc = Disc(eccentricity=(ECCENTRICITY,), rotation=ROTATION, run_up=0.0)
    rest = np.zeros(round(passes / (2 * ROTATION) * RATE))
    record = bench.open_loop(rest, disc, seed=seed)
    windows = [
        slice(i, i + WINDOW_SAMPLES)
        for i in range(0, rest.size - WINDOW_SAMPLES + 1, WINDOW_SAMPLES)
    ]
    tracks = [_tracks_passed(record.f_en[window]) for window in windows]
    # Where the disc's motion turns around, tracks pass slowly and unevenly.
    fast = [w for w, count in zip(windows, tracks, strict=True) if count > 0.9 * max(tracks)]
    gains, shown = [], None
    for window in fast:
        phase, amplitudes = _track_passage(record, window)
        gains.append(2 * np.pi / TRACK_PITCH * amplitudes)
        distance = phase * TRACK_PITCH / (2 * np.pi)
        if shown is None:
            shown = distance, (record.d1 - record.d2)[window], record.sum[window]
    assert shown is not None  # one of them is the fastest window
    grid = np.linspace(-SHOWN_DISTANCE["radial"], SHOWN_DISTANCE["radial"], 301)
    difference, total = (np.interp(grid, shown[0], signal) for signal in shown[1:])
    return Scan(grid, difference, total, *_with_scatter(gains), len(gains))


def _tracks_passed(signal: RealArray) -> float:
    """Approximate number of tracks that pass in a window."""
    finer = 8
    spectrum = np.fft.rfft(signal - signal.mean(), finer * signal.size)
    return float(np.argmax(np.abs(spectrum))) / finer


def _track_passage(record: Record, window: slice) -> tuple[RealArray, RealArray]:
    """Phase [rad] in a window, 0 at a rising crossing near its middle, and both amplitudes.

    The signals are sines with a linearly changing frequency. The amplitudes, of d1 - d2 [V] and
    f_en, are linear parameters of the fit.
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
