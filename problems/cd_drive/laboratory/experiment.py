"""The virtual laboratory: a drive on the bench, simulated in the time domain (section 3.6).

The bench has the actuator, power drive, series resistor, photo diodes, anti-aliasing filters,
converters, the computer's delay, and a disc with its deviations and defects. The signals that the
computer sees are recorded together with the true ones. Section and equation numbers refer to E.
Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import with_config

from workbench.errors import InputError
from workbench.simulation import (
    Cascade,
    Controller,
    Converter,
    SampledLoop,
    Schedule,
    respond,
    sampled_model,
    zero_controller,
)
from workbench.study import array_cache
from workbench.types import ComplexArray, RealArray, StateSpace

from ..drive import photo_diodes
from ..drive.actuator import SERIES_RESISTANCE, Actuator, checked_frequency, specific_model
from ..drive.disc import STRICT, Defect, Disc
from ..drive.plants import ANTIALIASING, Gain
from ..drive.tables import Axis, Drive, Values, disc_formats
from .bench_setup import (
    CHANNEL_GAINS,
    CHANNELS,
    DIODE_GAIN,
    ELECTRICAL,
    INPUT_LIMIT,
    NOISE,
    OUTPUT_LIMIT,
    PERIOD,
    RATE,
    aged,
    channel_converters,
    coil_gain,
    electromechanics,
    electronics_noise,
    find_drive,
    optical_noise,
    split_arms,
)
from .record import CoilRecord, Event, Record

MEASUREMENTS = ("f_en", "sum", *CHANNELS)
"""Measurements that a controller receives, in this order."""

STILL = Disc(rotation=0.0, run_up=0.0)
"""A flat disc at rest."""


@with_config(STRICT)
@dataclass(frozen=True)
class Laboratory:
    """One axis of one drive on the bench.

    drive        "CD1" ... "CD12", or "nominal";
    values       entries of Tables A.1-A.2, "printed" or "corrected";
    gain         loop gain: the drive's "own", "equal" for all, or as the "agc" sets it;
    delay        time from sampling to the D/A converter's output [samples];
    mismatch     of the arm's halves, or of each of its parts; parts that differ have parasitic
                 resonances of their own, see `split_arms`;
    noise        noise of the measured position [m rms], white from 0 to noise_band [Hz];
                 None: 0.15 um in focus (section 7.3), and a tenth of it radially, as for the
                 largest error allowed;
    electronics  white noise of v_r and u_m before conversion [steps of the converter, rms];
    bits         resolution of the converters; None: they saturate, but do not round;
    refine       number of steps per sample in which the optics are simulated;
    suspension   factor on spring k1 and damper b1 of the suspension: below 1 the drive has
                 aged;
    surface      whether the focus diodes also see the disc's surface, far from the layer;
    contrast     light on the radial diodes between two tracks over that on a track, minus 1.
    """

    axis: Axis = "focus"
    drive: str = "CD1"
    values: Values = "printed"
    gain: Gain = "own"
    delay: float = 1.0
    mismatch: float | tuple[float, ...] = 0.0
    noise: float | None = None
    noise_band: float = 1750.0
    electronics: float = 1.0
    bits: int | None = 12
    refine: int = 1
    suspension: float = 1.0
    surface: bool = False
    contrast: float = 0.0

    @property
    def parameters(self) -> Drive:
        """The drive's entries in Tables A.1-A.3, aged: the values that an identification should
        find.
        """
        new = find_drive(self.axis, self.drive, self.values)
        return new if self.suspension == 1.0 else aged(new, self.suspension)

    @property
    def arms_alike(self) -> bool:
        """Whether the arm moves as a whole, so that the model has order 4."""
        return not np.any(self.mismatch)

    @property
    def coil_gain(self) -> float:
        """Gain from u to the voltage over coil and series resistor [V/V]."""
        new = find_drive(self.axis, self.drive, self.values)
        return coil_gain(new, self.gain, self.values)

    @property
    def actuator(self) -> Actuator:
        """The actuator: coil voltage [V] -> lens [m]."""
        if self.arms_alike:
            return specific_model(self.parameters)
        return split_arms(self.parameters, self.mismatch)

    def response(self, frequency: ArrayLike) -> dict[str, ComplexArray]:
        """Exact responses at frequencies [Hz] (F,), by signal: each (F,).

        These are the sampled responses from u to x [m/V], v_r and u_m [V/V], and f_en [1/V] within
        the linear range. All contain hold and delay, and all except x the anti-aliasing filter.
        Raises InputError for a frequency that is not below half the sampling frequency.
        """
        frequency = checked_frequency(frequency)
        if frequency.max() >= RATE / 2:
            raise InputError(f"{frequency.max()} Hz; sampled responses end at {RATE / 2} Hz")
        z = np.exp(2j * np.pi * frequency * PERIOD)
        x, v_r, u_m = _sampled(self)(z, squeeze=False)[:, 0]
        f_en = self.sampled_error()(z, squeeze=False)[0, 0]
        return {"x": x, "v_r": v_r, "u_m": u_m, "f_en": f_en}

    def sampled_error(self) -> StateSpace:
        """Exact sampled model of u [V] -> f_en [units] within the linear range, delay included."""
        import control

        optics = control.ss(-ANTIALIASING, ANTIALIASING, -self.parameters.K_optn, 0.0)
        return sampled_model(optics * _plant(self)[0, 0], PERIOD, delay_samples=self.delay)

    def coil(self, excitation: ArrayLike, seed: int = 0) -> CoilRecord:
        """Apply an excitation u [V] (N,) from rest and measure the coil's current, without optics.

        It is faster than `open_loop`, because the system is linear except for its converters.
        """
        return self.coil_signals(excitation).measured(seed)

    def coil_signals(
        self, excitation: ArrayLike, series_resistance: float = SERIES_RESISTANCE
    ) -> CoilSignals:
        """The signals of `coil` before noise and converters; many records can be made from them.

        series_resistance: of the resistor that measures the current [ohm].
        """
        u = _series("excitation", excitation)
        u_dac, saturated = Converter(OUTPUT_LIMIT, bits=self.bits).convert(u)
        if series_resistance == SERIES_RESISTANCE:
            system = _sampled(self)
        else:
            actuator = specific_model(self.parameters, series_resistance)
            plant = electromechanics(actuator, self.coil_gain, series_resistance)
            system = sampled_model(plant, PERIOD, delay_samples=self.delay)
        exact = respond(system, u_dac[:, None])[:, 1:]
        return CoilSignals(u, u_dac, exact, saturated, self.electronics, self.bits)

    def open_loop(
        self,
        excitation: ArrayLike,
        disc: Disc = STILL,
        defects: Sequence[Defect] = (),
        seed: int = 0,
    ) -> Record:
        """Apply an excitation u [V] (N,) without control while the diodes see a disc."""
        return self.closed_loop(
            zero_controller(), excitation, disc=disc, defects=defects, seed=seed
        )

    def closed_loop(
        self,
        controller: Controller | Cascade | Schedule,
        excitation: ArrayLike | None = None,
        duration: float = 1.0,
        disc: Disc = STILL,
        defects: Sequence[Defect] = (),
        seed: int = 0,
    ) -> Record:
        """Run a controller of `MEASUREMENTS` from rest; an excitation u [V] (N,) may be added to
        its output.

        The controller may be a cascade of parts, such as a strategy, or a schedule of several
        controllers with their starting times. Without an excitation it runs for `duration` [s].

        Raises InputError for a duration of less than a sample, for an excitation that is not a
        finite series, and if the controller's output is not finite.
        """
        if excitation is None:
            if not 0.0 < duration < np.inf:
                raise InputError(f"duration is {duration} s; it must be positive and finite")
            excitation = np.zeros(round(duration * RATE))
        u = _series("excitation", excitation)
        time = _time(len(u) + 1)
        x_cd = disc.deviation(self.axis, time)
        light, f_sd = disc.surface(defects, time)
        exogenous = np.column_stack([x_cd, light, f_sd])
        noise = _noise(self, seed, len(u))
        run = _loop(self).run(controller, u[:, None], exogenous, noise)
        x_cd, light, f_sd = exogenous[:-1].T
        names = ("u", *CHANNELS)
        counts = np.concatenate([run.saturated_outputs, run.saturated_channels]) / len(u)
        x = run.position[:, 0]
        return Record(
            time=time[:-1],
            u=run.command[:, 0],
            u_dac=run.output[:, 0],
            **dict(zip(MEASUREMENTS, run.measurement.T, strict=True)),
            x=x,
            x_cd=x_cd,
            light=light,
            f_sd=f_sd,
            saturation=dict(zip(names, map(float, counts), strict=True)),
            signals=run.signals,
            events=self._events(time, abs(x_cd - x) > photo_diodes.CAPTURE[self.axis]),
        )

    def _events(self, time: RealArray, lost: np.ndarray) -> tuple[Event, ...]:
        changes = np.flatnonzero(np.diff(lost, prepend=False))
        what = "focus" if self.axis == "focus" else "track"
        return tuple(
            Event(float(time[k]), f"{what} {'lost' if lost[k] else 'regained'}") for k in changes
        )


@cache
def _plant(laboratory: Laboratory) -> StateSpace:
    return electromechanics(laboratory.actuator, laboratory.coil_gain)


@cache
def _sampled(laboratory: Laboratory) -> StateSpace:
    """Exact sampled model from u to x, v_r and u_m."""
    return sampled_model(_plant(laboratory), PERIOD, delay_samples=laboratory.delay)


@array_cache(
    megabytes=100
)  # the same seed gives the same noise, so that strategies can be compared
def _noise(laboratory: Laboratory, seed: int, samples: int) -> RealArray:
    """Noise (samples, 4) of the two diodes, v_r and u_m [V]."""
    rng, size = np.random.default_rng(seed), laboratory.noise
    size = NOISE[laboratory.axis] if size is None else size
    optical = optical_noise(rng, samples, laboratory.parameters, size, laboratory.noise_band)
    return np.hstack([optical, electronics_noise(rng, samples, laboratory.electronics)])


def _diodes(laboratory: Laboratory) -> tuple[Any, RealArray]:
    """The compiled sensor of an axis and its parameters."""
    parameters = photo_diodes.diode_parameters(laboratory.parameters)
    if laboratory.axis == "radial":
        if not laboratory.contrast:
            return photo_diodes.radial_diodes, parameters
        return photo_diodes.contrasted_diodes, np.append(parameters, laboratory.contrast)
    if not laboratory.surface:
        return photo_diodes.focus_diodes, parameters
    seen = photo_diodes.surface_of(disc_formats()["CD"])
    return photo_diodes.surfaced_diodes, np.append(parameters, seen)


@cache
def _loop(laboratory: Laboratory) -> SampledLoop:
    sense, sense_parameters = _diodes(laboratory)
    return SampledLoop(
        plant=_plant(laboratory),
        positions=1,
        sense=sense,
        sense_parameters=sense_parameters,
        signals=2,
        corner=ANTIALIASING,
        read=photo_diodes.normalise,
        read_parameters=np.array([Converter(INPUT_LIMIT).step / DIODE_GAIN]),
        measurements=len(MEASUREMENTS),
        channel_levels=channel_converters(laboratory.bits),
        output_levels=Converter(OUTPUT_LIMIT, bits=laboratory.bits).levels()[None],
        dt=PERIOD,
        delay_samples=laboratory.delay,
        refine=laboratory.refine,
    )


@dataclass(frozen=True, eq=False)
class CoilSignals:
    """Excitation u, output u_dac (N,) [V], v_r and u_m (N, 2) [V] of a coil, without noise.

    saturated: share of the samples of u at the converter's limit. electronics, bits: as in
    `Laboratory`.
    """

    u: RealArray
    u_dac: RealArray
    exact: RealArray
    saturated: float
    electronics: float
    bits: int | None

    def measured(self, seed: int) -> CoilRecord:
        """A record of these signals with the noise of this seed."""
        noise = electronics_noise(np.random.default_rng(seed), len(self.u), self.electronics)
        measured, saturation = {}, {"u": self.saturated}
        for name, values in zip(ELECTRICAL, (self.exact + noise).T, strict=True):
            converter, gain = Converter(INPUT_LIMIT, bits=self.bits), CHANNEL_GAINS[name]
            measured[name], saturation[name] = converter.convert(values, gain=gain)
        return CoilRecord(_time(len(self.u)), self.u, self.u_dac, **measured, saturation=saturation)


def measurements(record: Record) -> RealArray:
    """The measurements (N, 6) that a controller received at each sample of a record."""
    return np.column_stack([getattr(record, name) for name in MEASUREMENTS])


def _time(samples: int) -> RealArray:
    return np.arange(samples) / RATE


def _series(name: str, values: ArrayLike) -> RealArray:
    array = np.asarray(values, float)
    if array.ndim != 1 or array.size == 0 or not np.isfinite(array).all():
        raise InputError(f"{name} has shape {array.shape}; it must be a finite, 1-D array")
    return array
