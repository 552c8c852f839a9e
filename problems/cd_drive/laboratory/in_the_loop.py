"""A stepped sine in the loop of a drive on the bench, and the response that it measures.

Equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import stats
from scipy.ndimage import uniform_filter1d
from scipy.signal import savgol_filter

from workbench._core.arrays import ComplexArray, RealArray
from workbench.identification import PeriodicResponse, SteppedSine, periodic_response, sine_fit
from workbench.simulation import linear_controller, sampled_model

from ..drive.disc import Disc
from ..drive.photo_diodes import TRACK_PITCH
from ..drive.plants import ANTIALIASING, controller
from ..drive.tables import Axis, red_book
from .bench_setup import CHANNEL_GAINS, INPUT_LIMIT, OUTPUT_LIMIT, PERIOD, RATE
from .experiment import Laboratory
from .record import Record
from .unknowns import TRUTH, Told

PERIODS, EVALUATED = 20, 10
"""Periods played at each frequency, and how many of the last are evaluated (section 4.6.2)."""
LOOP_SETTLING = 0.5
"""Time [s] in which the disc runs up and the loop settles."""
ERROR_SWING = {"focus": 0.9e-6, "radial": 0.05e-6}
"""Amplitude [m] of the error that the excitation aims at: half the linear range of the focus
diodes, less a tenth for drives of small gain; where the sine of the radial ones is half a per cent
below its tangent."""
LARGEST_EXCITATION = 2.0
"""Largest amplitude [V] of the excitation and of its part in u, in the nominal loop.

CD8 makes 3.1 V of it in u, and has noise of 1.2 V rms there: 5.7 times that is left below 10 V."""
DISC_SHARE, ROTATION, ROTATION_HARMONICS = 0.2, 6.0, 3
"""The disc's deviation as a share of the Red Book's, its rotation [Hz], and the number of harmonics
of the rotation that are removed from the signals."""
INPUT_BAND = 200.0
"""Band [Hz] within which the power of the loop's response is taken as a parabola in decibels."""
RECORDED = ("u", "u_m", "d1", "d2")
"""Signals whose converters must not saturate; the coil's current is not recorded."""
POOLING_BAND = 50.0
"""Band [Hz] within which the noise's colour, or the error of a fit, is taken as equal."""


class Chain(NamedTuple):
    """The measurement chain from x / coil voltage to f_en / u_m.

    gain [units V / (m V)]: of optics and amplifiers. delay [samples]. error_corner, control_corner
    [rad/s]: of the filters of the diodes' and of u_m's channels.
    """

    gain: float
    delay: float
    error_corner: float
    control_corner: float

    @classmethod
    def told(cls, bench: Laboratory, told: Told = TRUTH) -> Chain:
        """The chain as an experimenter is told."""
        return cls(
            told.gain * bench.parameters.K_optn * bench.coil_gain,
            bench.delay + told.delay,
            told.error_corner * ANTIALIASING,
            told.control_corner * ANTIALIASING,
        )

    def response(self, frequency: RealArray) -> ComplexArray:
        """Factor (F,) from x / coil voltage to f_en / u_m: gain, hold, delay and filters.

        The sampling of u_m behind its filter is exact; aliasing of the lens's motion is below 1e-4.
        """
        import control

        s = 2j * np.pi * frequency
        hold = (1 - np.exp(-s * PERIOD)) / (s * PERIOD) * np.exp(-s * PERIOD * self.delay)
        corner = self.control_corner
        u_m = sampled_model(control.ss(-corner, corner, 1.0, 0.0), PERIOD, delay_samples=self.delay)
        control_signal = u_m(np.exp(s * PERIOD), squeeze=False)[0, 0]
        lens_signal = hold * self.error_corner / (s + self.error_corner)
        found: ComplexArray = -self.gain * lens_signal / control_signal
        return found


class LoopRecord(NamedTuple):
    """What is kept of a record in the loop.

    estimate: f_en/u_m with its region. independent_p: of the test that periods are independent.
    events: times that the loop was lost or regained. saturated: largest share of samples at a
    converter's limit, and level: largest magnitude over its limit, of the signals RECORDED.
    largest_error [m]: distance of focus or track.
    """

    estimate: PeriodicResponse
    events: int
    saturated: RealArray
    level: RealArray
    largest_error: float


def excitation(
    axis: Axis, frequency: RealArray, scale: float = 1.0, dwell: float = 0.0
) -> SteppedSine:
    """The stepped sine that moves the error by ERROR_SWING, or u by LARGEST_EXCITATION if less.

    It is designed for the nominal drive: the experiment is to tell what the drive at hand is.
    scale: gain of the controller over the reference controller's. dwell: least time [s] at each
    frequency; PERIODS is multiplied by as much as it takes.
    """
    nominal = Laboratory(axis, "nominal")
    plant = -nominal.response(frequency)["f_en"]  # the sign of eq. 3.16
    sensitivity = 1 / (1 + scale * plant * controller_response(axis, frequency))
    wanted = ERROR_SWING[axis] * nominal.parameters.K_optn / abs(plant * sensitivity)
    allowed = LARGEST_EXCITATION / np.maximum(1.0, abs(sensitivity))
    periods = PERIODS * np.maximum(1, np.ceil(dwell * frequency / PERIODS)).astype(int)
    return SteppedSine(frequency, periods, np.minimum(wanted, allowed), 1 / RATE)


def controller_response(axis: Axis, frequency: RealArray) -> ComplexArray:
    """Response (F,) of the reference controller as it is sampled, at frequencies [Hz] (F,)."""
    import control

    law = control.sample_system(control.ss(controller(axis)), PERIOD, "bilinear")
    found: ComplexArray = law(np.exp(2j * np.pi * frequency * PERIOD), squeeze=False)[0, 0]
    return found


@dataclass(frozen=True, eq=False)
class LoopExperiment:
    """A stepped sine in a drive's loop, added to the controller's output.

    frequency: [Hz] (F,). disturbances: whether the disc turns; deviation: of the disc over the Red
    Book's. scale: gain of the controller over the reference controller's. dwell: least time [s] at
    each frequency.
    """

    bench: Laboratory
    frequency: RealArray
    disturbances: bool
    deviation: float = DISC_SHARE
    scale: float = 1.0
    dwell: float = 0.0

    @cached_property
    def sine(self) -> SteppedSine:
        return excitation(self.bench.axis, self.frequency, self.scale, self.dwell)

    @cached_property
    def signal(self) -> RealArray:
        """The excitation [V] (N,): the loop settles, then the sine is played."""
        rest = np.zeros(round(LOOP_SETTLING * RATE))
        return np.concatenate([rest, *(part for _, part in self.sine)])

    def played(self, seed: int) -> Record:
        """The signals of the experiment."""
        axis = self.bench.axis
        size = self.deviation * red_book(axis).deviation if self.disturbances else 0.0
        disc = Disc.along(axis, size, rotation=ROTATION)
        law = linear_controller(self.scale * controller(axis), PERIOD)
        return self.bench.closed_loop(law, self.signal, disc=disc, seed=seed)

    def measured(self, seed: int, told: Told) -> LoopRecord:
        """One draw of the experiment, as an experimenter sees it."""
        record = self.played(seed)
        error = self._straight(record.f_en, told)
        settled = slice(round(LOOP_SETTLING * RATE), None)
        limits = [OUTPUT_LIMIT, *(INPUT_LIMIT / CHANNEL_GAINS[name] for name in RECORDED[1:])]
        signals = [record.u_dac, *(getattr(record, name) for name in RECORDED[1:])]
        return LoopRecord(
            measure(record, error, self.sine, self.disturbances),
            len(record.events),
            np.array([record.saturation[name] for name in RECORDED]),
            np.array([abs(one).max() for one in signals]) / limits,
            float(abs(record.x_cd - record.x)[settled].max()),
        )

    def _straight(self, f_en: RealArray, told: Told) -> RealArray:
        """The error of linear diodes: the radial ones see a sine whose period is the pitch."""
        if self.bench.axis == "focus":
            return f_en
        peak = told.gain * self.bench.parameters.K_optn * TRACK_PITCH * told.distance / (2 * np.pi)
        straight: RealArray = peak * np.arcsin(np.clip(f_en / peak, -1.0, 1.0))
        return straight


def measure(record: Record, error: RealArray, sine: SteppedSine, turning: bool) -> PeriodicResponse:
    """f_en/u_m with its region, by errors in variables.

    The harmonics of a turning disc are removed first. They are coherent, so that the scatter of ten
    periods would not show them. Successive periods are not independent either, so `noise_colour`
    corrects the variance of their mean.

    The weights of a fit must not depend on the noise of the response that they weigh: noise that
    enlarges u makes y/u smaller, and its variance by u alone smaller too, so that small responses
    would count more. Noise and input therefore have the power of their neighbourhood.
    """
    u, y = amplitudes(np.stack([record.u_m, error]), sine, turning)
    estimate = periodic_response(sine.frequencies_hz, u, y)
    scatter = y - estimate.response[:, 0] * u
    steps = pool_steps(sine.frequencies_hz)
    noise = np.sum(abs(scatter) ** 2, axis=1) / (EVALUATED - 1) / EVALUATED
    noise, colour = (
        uniform_filter1d(one, steps, mode="nearest") for one in (noise, noise_colour(scatter))
    )
    variance = (noise * colour / smooth_power(u, sine))[:, None, None]
    return replace(estimate, variance=variance, degrees=estimate.degrees * steps)


def amplitudes(signals: RealArray, sine: SteppedSine, turning: bool) -> ComplexArray:
    """Amplitudes (S, F, EVALUATED) of the sine in the evaluated periods of signals (S, N).

    A sine of more than PERIODS periods is taken as PERIODS equal stretches, each with the mean of
    its amplitudes. turning: the harmonics of a turning disc are removed first.
    """
    start = round(LOOP_SETTLING * RATE)
    signals = signals[:, start:]
    if turning:
        orders = np.arange(1, ROTATION_HARMONICS + 1)
        turns = 2 * np.pi * ROTATION * np.outer(orders, start + np.arange(signals.shape[1])) / RATE
        waves = np.vstack([np.ones((1, turns.shape[1])), np.cos(turns), np.sin(turns)])
        signals = signals - np.linalg.solve(waves @ waves.T, waves @ signals.T).T @ waves
    ends = np.cumsum(sine.lengths)
    parts = np.split(signals, ends[:-1], axis=1)
    found = [
        sine_fit(part, 1 / RATE, frequency)[:, :periods, 0]
        .reshape(len(signals), PERIODS, -1)
        .mean(axis=-1)[:, PERIODS - EVALUATED :]
        for part, frequency, periods in zip(parts, sine.frequencies_hz, sine.periods, strict=True)
    ]
    return np.moveaxis(np.array(found), 1, 0)


def smooth_power(u: ComplexArray, sine: SteppedSine) -> RealArray:
    """Power (F,) of the input, given its amplitudes (F, M), smooth over frequencies."""
    power = np.log(abs(u.mean(axis=1)) ** 2 / sine.amplitude**2)
    steps = 2 * round(INPUT_BAND / float(np.mean(np.diff(sine.frequencies_hz))) / 2) + 1
    smooth = np.exp(savgol_filter(power, min(max(steps, 5), power.size), 2))
    found: RealArray = smooth * sine.amplitude**2
    return found


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
    bulge that the chi-square of all frequencies does not show. The products of neighbours have
    their own scatter as the measure, so the sizes of the residuals need not be known.
    """
    every = [(residual[lag:] * residual[:-lag].conj()).real for lag in range(1, lags + 1)]
    products = np.concatenate(every)
    return float(stats.norm.sf(products.sum() / np.linalg.norm(products)))


def pool_steps(frequency: RealArray) -> int:
    """Number of frequency steps in POOLING_BAND."""
    return max(1, round(POOLING_BAND / float(np.mean(np.diff(frequency)))))
