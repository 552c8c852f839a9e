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

from workbench.identification import PeriodicResponse, SteppedSine, periodic_response, sine_fit
from workbench.simulation import linear_controller, sampled_model
from workbench.types import ComplexArray, RealArray

from ..drive.disc import Disc
from ..drive.photo_diodes import TRACK_PITCH
from ..drive.plants import ANTIALIASING, controller
from ..drive.tables import Axis, red_book
from .bench_setup import CHANNEL_GAINS, INPUT_LIMIT, OUTPUT_LIMIT, PERIOD, RATE
from .experiment import Laboratory
from .record import Record
from .unknowns import TRUTH, Told

PERIODS, EVALUATED = 20, 10
"""Number of periods played at each frequency, and of the last ones that are evaluated (section
4.6.2).
"""
LOOP_SETTLING = 0.5
"""Time [s] in which the disc runs up and the loop settles."""
ERROR_SWING = {"focus": 0.9e-6, "radial": 0.05e-6}
"""Amplitude [m] of the error at which the excitation aims. In focus it is half of the diodes'
linear range, minus a tenth for drives of small gain. Radially it is where the diodes' sine is half
a per cent below its tangent.
"""
LARGEST_EXCITATION = 2.0
"""Largest amplitude [V] of the excitation, and of the part of u that it causes in the nominal loop.

CD8 has 3.1 V of it in u, and noise of 1.2 V rms there. To the limit of 10 V, 5.7 times that noise
remains.
"""
DISC_SHARE, ROTATION, ROTATION_HARMONICS = 0.2, 6.0, 3
"""Deviation of the disc over the Red Book's, its rotation [Hz], and the number of harmonics of the
rotation that are removed from the signals.
"""
INPUT_BAND = 200.0
"""Band [Hz] within which the input's power in decibels is approximated by a parabola."""
RECORDED = ("u", "u_m", "d1", "d2")
"""Signals whose converters must not saturate; the coil's current is not recorded."""
POOLING_BAND = 50.0
"""Band [Hz] within which the colour of the noise, or the error of a fit, is taken as constant."""


class Chain(NamedTuple):
    """The measurement chain from x / coil voltage to f_en / u_m.

    gain [units V / (m V)]: gain of optics and amplifiers. delay [samples]. error_corner,
    control_corner [rad/s]: corners of the filters in the channels of the diodes and of u_m.
    """

    gain: float
    delay: float
    error_corner: float
    control_corner: float

    @classmethod
    def told(cls, bench: Laboratory, told: Told = TRUTH) -> Chain:
        """The measurement chain that an experimenter is told."""
        return cls(
            told.gain * bench.parameters.K_optn * bench.coil_gain,
            bench.delay + told.delay,
            told.error_corner * ANTIALIASING,
            told.control_corner * ANTIALIASING,
        )

    def response(self, frequency: RealArray) -> ComplexArray:
        """Factor (F,) from x / coil voltage to f_en / u_m: gain, hold, delay and filters.

        The sampling of u_m after its filter is exact; the aliasing of the lens's motion is below
        1e-4.
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
    """The parts of a record in the loop that are kept.

    estimate: f_en/u_m with its region. independent_p: p-value of the test that periods are
    independent. events: number of times that the loop was lost or regained. For the signals
    RECORDED, saturated: largest share of samples at a converter's limit, and level: largest
    magnitude over that limit. largest_error [m]: largest distance from focus or track.
    """

    estimate: PeriodicResponse
    events: int
    saturated: RealArray
    level: RealArray
    largest_error: float


def excitation(
    axis: Axis, frequency: RealArray, scale: float = 1.0, dwell: float = 0.0
) -> SteppedSine:
    """The stepped sine that moves the error by ERROR_SWING, or u by LARGEST_EXCITATION if that is
    less.

    It is designed for the nominal drive, since the experiment has yet to identify the actual one.
    scale: gain of the controller over the reference controller's. dwell: least time [s] at each
    frequency, for which PERIODS is multiplied as often as needed.
    """
    nominal = Laboratory(axis, "nominal")
    plant = -nominal.response(frequency)["f_en"]  # the sign of eq. 3.16
    sensitivity = 1 / (1 + scale * plant * controller_response(axis, frequency))
    wanted = ERROR_SWING[axis] * nominal.parameters.K_optn / abs(plant * sensitivity)
    allowed = LARGEST_EXCITATION / np.maximum(1.0, abs(sensitivity))
    periods = PERIODS * np.maximum(1, np.ceil(dwell * frequency / PERIODS)).astype(int)
    return SteppedSine(frequency, periods, np.minimum(wanted, allowed), 1 / RATE)


def controller_response(axis: Axis, frequency: RealArray) -> ComplexArray:
    """Frequency response (F,) of the sampled reference controller at frequencies [Hz] (F,)."""
    import control

    law = control.sample_system(control.ss(controller(axis)), PERIOD, "bilinear")
    found: ComplexArray = law(np.exp(2j * np.pi * frequency * PERIOD), squeeze=False)[0, 0]
    return found


@dataclass(frozen=True, eq=False)
class LoopExperiment:
    """A stepped sine in a drive's loop, added to the controller's output.

    frequency: [Hz] (F,). disturbances: whether the disc turns; deviation: of the disc, over the Red
    Book's limits. scale: gain of the controller over the reference controller's. dwell: least time
    [s] at each frequency. played_sine: the excitation. None: one designed for the nominal drive.
    """

    bench: Laboratory
    frequency: RealArray
    disturbances: bool
    deviation: float = DISC_SHARE
    scale: float = 1.0
    dwell: float = 0.0
    played_sine: SteppedSine | None = None

    @cached_property
    def sine(self) -> SteppedSine:
        if self.played_sine is not None:
            return self.played_sine
        return excitation(self.bench.axis, self.frequency, self.scale, self.dwell)

    @cached_property
    def signal(self) -> RealArray:
        """The excitation [V] (N,): first the loop settles, then the sine is played."""
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
        """The error that linear diodes would show: the radial diodes show a sine whose period is
        the pitch.
        """
        if self.bench.axis == "focus":
            return f_en
        peak = told.gain * self.bench.parameters.K_optn * TRACK_PITCH * told.distance / (2 * np.pi)
        straight: RealArray = peak * np.arcsin(np.clip(f_en / peak, -1.0, 1.0))
        return straight


def measure(record: Record, error: RealArray, sine: SteppedSine, turning: bool) -> PeriodicResponse:
    """f_en/u_m with its region, estimated as an errors-in-variables problem.

    The harmonics of a turning disc are removed first. They are coherent, so the scatter of ten
    periods would not show them. Successive periods are not independent either, so `noise_colour`
    corrects the variance of their mean.

    The weight of a response in a fit must not depend on its own noise. Noise that enlarges u makes
    y/u smaller, and its variance, if computed from u alone, smaller too; small responses would then
    count more. So noise power and input power are smoothed over neighbouring frequencies.
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

    A sine of more than PERIODS periods is divided into PERIODS equal stretches, and each stretch
    gives the mean of its amplitudes. turning: first remove the harmonics of a turning disc.
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
    """Power (F,) of the input from its amplitudes (F, M), smoothed over frequencies."""
    power = np.log(abs(u.mean(axis=1)) ** 2 / sine.amplitude**2)
    steps = 2 * round(INPUT_BAND / float(np.mean(np.diff(sine.frequencies_hz))) / 2) + 1
    smooth = np.exp(savgol_filter(power, min(max(steps, 5), power.size), 2))
    found: RealArray = smooth * sine.amplitude**2
    return found


def noise_colour(scatter: ComplexArray) -> RealArray:
    """Ratio (F,) of the true variance of the mean to the one that the scatter (F, M) suggests.

    One period has the bandwidth of an octave, and the mean of ten periods a tenth of it. So the two
    variances differ if the noise is not white, and because each period begins where the last one
    ended. The variance of the mean is estimated from the lines next to the excited one, f (1 +- 1 /
    M).
    """
    periods = scatter.shape[1]
    beside = np.mean(abs(np.fft.fft(scatter, axis=1)[:, [1, -1]]) ** 2, axis=1) / periods
    ratio: RealArray = beside / (np.sum(abs(scatter) ** 2, axis=1) / (periods - 1))
    return ratio


def neighbours_p(residual: ComplexArray, lags: int) -> float:
    """Probability that residuals (F,) resemble their neighbours, up to `lags` away, by chance.

    The noises at different frequencies are independent. A resonance that the model lacks leaves a
    bulge that the chi-square over all frequencies does not show. The products of neighbours are
    compared with their own scatter, so the sizes of the residuals need not be known.
    """
    every = [(residual[lag:] * residual[:-lag].conj()).real for lag in range(1, lags + 1)]
    products = np.concatenate(every)
    return float(stats.norm.sf(products.sum() / np.linalg.norm(products)))


def pool_steps(frequency: RealArray) -> int:
    """Number of frequency steps in POOLING_BAND."""
    return max(1, round(POOLING_BAND / float(np.mean(np.diff(frequency)))))
