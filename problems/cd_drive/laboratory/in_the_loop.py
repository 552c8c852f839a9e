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

PERIODS, EVALUATED = 20, 10
"""Periods played at each frequency, and how many of the last are evaluated (section 4.6.2)."""
LOOP_SETTLING = 0.5
"""Time [s] in which the disc runs up and the loop settles."""
ERROR_SWING = {"focus": 1.0e-6, "radial": 0.05e-6}
"""Amplitude [m] of the error that the excitation aims at: half the linear range of the
focus diodes; where the sine of the radial ones is half a per cent below its tangent."""
LARGEST_EXCITATION = 4.0
"""Largest amplitude [V] of the excitation and of its part in u; u has up to 10 V, the rest of which
is left for the loop's noise."""
DISC_SHARE, ROTATION, ROTATION_HARMONICS = 0.2, 6.0, 3
"""The disc's deviation as a share of the Red Book's, its rotation [Hz], and the number of harmonics
of the rotation that are removed from the signals."""
POOLING_BAND = 50.0
"""Band [Hz] within which the noise's colour, or the error of a fit, is taken as equal."""


def excitation(bench: Laboratory, frequency: RealArray) -> SteppedSine:
    """The stepped sine that moves the error by ERROR_SWING, or u by LARGEST_EXCITATION if less."""
    import control

    law = control.sample_system(control.ss(controller(bench.axis)), PERIOD, "bilinear")
    plant = -bench.response(frequency)["f_en"]  # the sign of eq. 3.16
    gain = law(np.exp(2j * np.pi * frequency * PERIOD), squeeze=False)[0, 0]
    sensitivity = 1 / (1 + plant * gain)
    wanted = ERROR_SWING[bench.axis] * bench.parameters.K_optn / abs(plant * sensitivity)
    allowed = LARGEST_EXCITATION / np.maximum(1.0, abs(sensitivity))
    return SteppedSine(frequency, PERIODS, np.minimum(wanted, allowed), RATE)


def measure(record: Record, error: RealArray, sine: SteppedSine, turning: bool) -> PeriodicResponse:
    """f_en/u_m with its region, by errors in variables.

    The harmonics of a turning disc are removed first. They are coherent, so that the scatter of ten
    periods would not show them. Successive periods are not independent either, so `noise_colour`
    corrects the variance of their mean.
    """
    start = round(LOOP_SETTLING * RATE)
    signals = np.stack([record.u_m, error])[:, start:]
    if turning:
        orders = np.arange(1, ROTATION_HARMONICS + 1)
        turns = 2 * np.pi * ROTATION * np.outer(orders, record.time[start:])
        waves = np.vstack([np.ones((1, turns.shape[1])), np.cos(turns), np.sin(turns)])
        signals = signals - np.linalg.solve(waves @ waves.T, waves @ signals.T).T @ waves
    ends = np.cumsum(sine.lengths)
    parts = np.split(signals, ends[:-1], axis=1)
    pairs = [
        sine_fit(part, RATE, frequency)[:, PERIODS - EVALUATED : PERIODS, 0]
        for part, frequency in zip(parts, sine.frequencies, strict=True)
    ]
    u, y = np.moveaxis(np.array(pairs), 1, 0)
    estimate = from_periods(sine.frequencies, u, y)
    scatter = y - estimate.response[:, 0] * u
    ratio = uniform_filter1d(noise_colour(scatter), pool_steps(sine.frequencies), mode="nearest")
    return replace(estimate, variance=estimate.variance * ratio[:, None, None])


def noise_colour(scatter: ComplexArray) -> RealArray:
    """Ratio (F,) of the variance of a mean to the one that the scatter (F, M) suggests.

    One period resolves an octave, the mean of ten periods a tenth of it. So the two variances
    differ where the noise is not white, and because the end of a period is the start of the next.
    The variance of the mean is taken from the lines next to the excited one, f (1 +- 1 / M).
    """
    periods = scatter.shape[1]
    beside = np.mean(abs(np.fft.fft(scatter, axis=1)[:, [1, -1]]) ** 2, axis=1) / periods
    ratio: RealArray = beside / (np.sum(abs(scatter) ** 2, axis=1) / (periods - 1))
    return ratio


def neighbours_p(residual: ComplexArray, lags: int) -> float:
    """Probability that residuals (F,) resemble their neighbours, up to `lags` away, by chance.

    The noises of different frequencies are independent. A resonance that the model lacks leaves a
    bulge that the chi-square of all frequencies does not show. Only the residuals' directions
    count, not their sizes.
    """
    turn = residual / abs(residual)
    products = [np.sum(turn[lag:] * turn[:-lag].conj()).real for lag in range(1, lags + 1)]
    pairs = np.sum(len(residual) - np.arange(1, lags + 1))
    return float(stats.norm.sf(np.sum(products) / np.sqrt(pairs / 2)))


def pool_steps(frequency: RealArray) -> int:
    """Number of frequency steps in POOLING_BAND."""
    return max(1, round(POOLING_BAND / float(np.mean(np.diff(frequency)))))


def measurement_chain(bench: Laboratory, frequency: RealArray) -> ComplexArray:
    """Factor from x / coil voltage to f_en / u_m: gains, hold, delay and filters.

    The sampling of u_m behind its filter is exact; aliasing of the lens's motion is below 1e-4.
    """
    import control

    s = 2j * np.pi * frequency
    hold = (1 - np.exp(-s * PERIOD)) / (s * PERIOD) * np.exp(-s * PERIOD * bench.delay)
    control_signal = sampled(control.ss(-ANTIALIASING, ANTIALIASING, 1.0, 0.0), PERIOD, bench.delay)
    u_m = control_signal(np.exp(s * PERIOD), squeeze=False)[0, 0]
    gain = -bench.parameters.K_optn * bench.coil_gain
    response: ComplexArray = gain * hold * ANTIALIASING / (s + ANTIALIASING) / u_m
    return response
