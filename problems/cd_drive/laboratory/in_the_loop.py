"""A stepped sine in the loop of a drive on the bench, and the response that it measures.

Equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import stats
from scipy.ndimage import uniform_filter1d

from workbench.arrays import ComplexArray, RealArray
from workbench.identification import PeriodicResponse, SteppedSine, from_periods, sine_fit
from workbench.simulation import sampled

from ..drive.plants import ANTIALIASING, controller
from .bench_setup import PERIOD, RATE
from .experiment import Laboratory
from .record import Record

PERIODS, USED = 20, 10
"""Played at each frequency, and the last of them that are evaluated (section 4.6.2)."""
SETTLING = 0.5
"""Time [s] for the disc to run up and the loop to settle."""
SWING = {"focus": 1.0e-6, "radial": 0.05e-6}
"""Amplitude of the error that the excitation aims at [m]: half the focus diodes' linear range, and
where the sine of the radial ones has lost half a per cent."""
DRIVE = 4.0
"""Largest excitation, and share of it in u [V]; the rest up to 10 V is for the loop's noise."""
WOBBLE, ROTATION, HARMONICS = 0.2, 6.0, 3
"""The disc's deviation as a share of the Red Book's, its rotation [Hz], harmonics taken out."""
POOL = 50.0
"""Band [Hz] over which the colour of the noise, and what a fit missed, is alike."""


def excitation(bench: Laboratory, frequency: RealArray) -> SteppedSine:
    """The stepped sine whose amplitudes [V] swing the error by SWING, or u by DRIVE at most."""
    import control

    law = control.sample_system(control.ss(controller(bench.axis)), PERIOD, "bilinear")
    plant = -bench.response(frequency)["f_en"]  # the sign of eq. 3.16
    gain = law(np.exp(2j * np.pi * frequency * PERIOD), squeeze=False)[0, 0]
    sensitivity = 1 / (1 + plant * gain)
    wanted = SWING[bench.axis] * bench.parameters.K_optn / abs(plant * sensitivity)
    allowed = DRIVE / np.maximum(1.0, abs(sensitivity))
    return SteppedSine(frequency, PERIODS, np.minimum(wanted, allowed), RATE)


def measure(record: Record, error: RealArray, sine: SteppedSine, turning: bool) -> PeriodicResponse:
    """f_en/u_m with its region, errors in variables; without the harmonics of a disc's rotation.

    Those are coherent: the scatter of ten periods of a sine says little of them. Nor are successive
    periods independent, so `colour` corrects the variance of their mean.
    """
    start = round(SETTLING * RATE)
    signals = np.stack([record.u_m, error])[:, start:]
    if turning:
        turns = 2 * np.pi * ROTATION * np.outer(np.arange(1, HARMONICS + 1), record.time[start:])
        waves = np.vstack([np.ones((1, turns.shape[1])), np.cos(turns), np.sin(turns)])
        signals = signals - np.linalg.solve(waves @ waves.T, waves @ signals.T).T @ waves
    ends = np.cumsum(sine.lengths)
    parts = np.split(signals, ends[:-1], axis=1)
    pairs = [
        sine_fit(part, RATE, frequency)[:, PERIODS - USED : PERIODS, 0]
        for part, frequency in zip(parts, sine.frequencies, strict=True)
    ]
    u, y = np.moveaxis(np.array(pairs), 1, 0)
    estimate = from_periods(sine.frequencies, u, y)
    scatter = y - estimate.response[:, 0] * u
    ratio = uniform_filter1d(colour(scatter), pooled(sine.frequencies), mode="nearest")
    return replace(estimate, variance=estimate.variance * ratio[:, None, None])


def colour(scatter: ComplexArray) -> RealArray:
    """Noise at a frequency over what single periods see about it; scatter (F, M), ratio (F,).

    One period resolves no less than an octave, their mean a tenth of it: where the noise is not
    white, and where a period's end is the next one's start, its variance is another. It is taken
    from the lines next to the excited one, f (1 +- 1 / M).
    """
    periods = scatter.shape[1]
    beside = np.mean(abs(np.fft.fft(scatter, axis=1)[:, [1, -1]]) ** 2, axis=1) / periods
    ratio: RealArray = beside / (np.sum(abs(scatter) ** 2, axis=1) / (periods - 1))
    return ratio


def neighbours_p(residual: ComplexArray, lags: int) -> float:
    """p-value of residuals (F,) that resemble their neighbours, up to `lags` away, by chance.

    Every frequency has noise of its own. A resonance that the model lacks leaves a bulge that is
    lost in the chi-square of all frequencies. Directions alone count, not how large a noise was.
    """
    turn = residual / abs(residual)
    products = [np.sum(turn[lag:] * turn[:-lag].conj()).real for lag in range(1, lags + 1)]
    pairs = np.sum(len(residual) - np.arange(1, lags + 1))
    return float(stats.norm.sf(np.sum(products) / np.sqrt(pairs / 2)))


def pooled(frequency: RealArray) -> int:
    """Steps of frequency in POOL."""
    return max(1, round(POOL / float(np.mean(np.diff(frequency)))))


def chain(bench: Laboratory, frequency: RealArray) -> ComplexArray:
    """What stands between x / coil voltage and f_en / u_m: gains, hold, delay and filters.

    u_m is sampled behind its filter, exactly; what the lens aliases is below 1e-4.
    """
    import control

    s = 2j * np.pi * frequency
    hold = (1 - np.exp(-s * PERIOD)) / (s * PERIOD) * np.exp(-s * PERIOD * bench.delay)
    control_signal = sampled(control.ss(-ANTIALIASING, ANTIALIASING, 1.0, 0.0), PERIOD, bench.delay)
    u_m = control_signal(np.exp(s * PERIOD), squeeze=False)[0, 0]
    gain = -bench.parameters.K_optn * bench.coil_gain
    response: ComplexArray = gain * hold * ANTIALIASING / (s + ANTIALIASING) / u_m
    return response
