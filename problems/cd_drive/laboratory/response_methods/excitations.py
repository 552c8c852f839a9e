"""Steps, sines and noise applied to a coil, and its response estimated from each without a model.

All have the same duration and the same largest voltage. The experimenter knows the computer's
output, and how hold, delay and filters change it. Equation and section numbers refer to E. Vidal
Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from workbench.identification import (
    ResponseEstimate,
    periodic_response,
    sine_fit,
    spectral_response,
    step_response,
)
from workbench.simulation import band_limited_noise
from workbench.types import ComplexArray, RealArray

from ..bench_setup import RATE
from ..coil_current import CoilExperiment
from ..experiment import CoilSignals, Laboratory
from ..record import CoilRecord

EXCITATIONS = ("step", "sines", "noise")
OPEN = "open loop"
"""Known property of the record: a generator drives the coil, without feedback."""
SEGMENTS = {"spectra_half_s": 0.5, "spectra_1s": 1.0, "spectra_2s": 2.0, "spectra_4s": 4.0}
"""Estimates from averaged spectra, with the lengths of their segments [s]."""
RESPONSES = ("step", "sines", *SEGMENTS)
"""Estimates of the response without a model."""
FREQUENCY_STEP = {"focus": 2.0, "radial": 6.0}
"""Distances [Hz] between frequencies; these are all lines of the shortest segments."""
SETTLING = 1.0
"""Time [s] in which the coil settles, six to ten time constants, after each step and after each
change of the sine's frequency.
"""
REST = 0.2
"""Time [s] of rest before an excitation."""
BLOCKS = 4
"""Number of averages of whole periods at each frequency, whose scatter gives the variance."""
NOISE_BAND = 2.0
"""Bandwidth of the noise, over the highest frequency."""
NOISE_SEED = 1
"""Seed of the noise excitation, which is the same in all draws."""


@dataclass(frozen=True, eq=False)
class Excited:
    """The three excitations of a drive's coil, each with the same duration [s] and
    amplitude [V].
    """

    laboratory: Laboratory
    amplitude: float
    duration: float

    @cached_property
    def sweep(self) -> CoilExperiment:
        """The stepped-sine experiment with the same frequencies and the same models."""
        step = FREQUENCY_STEP[self.laboratory.axis]
        return CoilExperiment(self.laboratory, step, self.amplitude)

    @property
    def frequency(self) -> RealArray:
        """Frequencies [Hz] (F,)."""
        return self.sweep.frequency

    @property
    def samples_each(self) -> int:
        """Number of samples for each frequency of the sines."""
        return round(self.duration * RATE) // len(self.frequency)

    @property
    def waiting(self) -> float:
        """Share of the sines' duration in which the coil settles."""
        return SETTLING * RATE / self.samples_each

    @cached_property
    def chain(self) -> ComplexArray:
        """Known response (F,) of hold, delay and filter, from u to the voltage that drives the
        coil.
        """
        found: ComplexArray = self.laboratory.response(self.frequency)["u_m"]
        return found

    @cached_property
    def played(self) -> dict[str, CoilSignals]:
        """The signals without noise, by excitation: the same in all draws."""
        samples, rest = round(self.duration * RATE), np.zeros(round(REST * RATE))
        steps = np.arange(samples) // round(SETTLING * RATE)
        time = np.arange(self.samples_each) / RATE
        band = NOISE_BAND * self.frequency[-1]
        noise = band_limited_noise(
            np.random.default_rng(NOISE_SEED), (samples, 1), 1.0, band, 1 / RATE
        )[:, 0]
        signals = {
            "step": np.where(steps % 2 == 0, 1.0, -1.0),
            "sines": np.concatenate([np.sin(2 * np.pi * f * time) for f in self.frequency]),
            "noise": noise / abs(noise).max(),
        }
        return {
            name: self.laboratory.coil_signals(np.append(rest, self.amplitude * one))
            for name, one in signals.items()
        }

    def record(self, excitation: str, steps: float, seed: int) -> CoilRecord:
        """A record with electronic noise of this many rms steps of the converter."""
        return replace(self.played[excitation], electronics=steps).measured(seed)

    def responses(self, excitation: str, record: CoilRecord) -> dict[str, ResponseEstimate]:
        """v_r/u (F,) by each method for this excitation, by name."""
        rest, v = round(REST * RATE), record.v_r / self.laboratory.coil_gain
        u = record.u_dac
        if excitation == "step":
            length = round(SETTLING * RATE)
            starts = rest + length * np.arange((len(u) - rest) // length)
            return {
                "step": self._without_chain(
                    step_response(u, v, starts, self.frequency, 1 / RATE, length)
                )
            }
        if excitation == "sines":
            return {"sines": self._without_chain(self._by_sines(u[rest:], v[rest:]))}
        every = {}
        for name, duration in SEGMENTS.items():
            averaged = round(duration * RATE)
            found = spectral_response(u[rest:], v[rest:], 1 / RATE, averaged, assume=OPEN)
            at = np.rint(self.frequency * duration).astype(int) - 1
            own = ResponseEstimate(
                found.frequency_hz[at], found.response[at], found.variance[at], found.degrees
            )
            every[name] = self._without_chain(own)
        return every

    def _by_sines(self, u: RealArray, v: RealArray) -> ResponseEstimate:
        """v_r/u from the whole periods after the coil has settled."""
        amplitudes = []
        for n, frequency in enumerate(self.frequency):
            part = slice(n * self.samples_each, (n + 1) * self.samples_each)
            pair = sine_fit(np.stack([u[part], v[part]]), 1 / RATE, frequency)[..., 0]
            settled = pair[:, int(np.ceil(SETTLING * frequency)) :]
            whole = settled[:, settled.shape[1] % BLOCKS :]
            amplitudes.append(whole.reshape(2, BLOCKS, -1).mean(axis=2))
        lines = np.array(amplitudes)
        return periodic_response(self.frequency, lines[:, 0], lines[:, 1])

    def _without_chain(self, estimate: ResponseEstimate) -> ResponseEstimate:
        """The response of the coil alone, without the known chain before it."""
        chain = self.chain[:, None, None]
        response, variance = estimate.response / chain, estimate.variance / abs(chain) ** 2
        return ResponseEstimate(estimate.frequency_hz, response, variance, estimate.degrees)
