"""A multisine, and sines of growing size, in the loop of a drive.

Equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from workbench.identification import (
    LineDistortion,
    Multisine,
    SteppedSine,
    harmonic_distortion,
    line_amplitudes,
    line_distortion,
    odd_lines,
    random_multisine,
    sine_fit,
)
from workbench.simulation import linear_controller
from workbench.types import RealArray

from ...drive.disc import Disc
from ...drive.plants import controller
from ..bench_setup import PERIOD, RATE
from ..experiment import STILL, Laboratory
from ..linearity import (
    CLOSED_BAND,
    DISCARDED,
    HARMONICS,
    LARGEST_DISPLACEMENT,
    ORDINARY_DISC,
    PERIODS,
    RUN_UP,
    closed_loop_amplitude,
    displacement,
)

SIZES = (0.25, 0.5, 0.75, 1.0)
"""Amplitudes of the series of sines, over the largest that LARGEST_DISPLACEMENT allows."""
SINES = 40
"""Number of frequencies of the sines, about as far apart as the odd lines of the multisine."""
SAMPLES = 1400
"""Number of samples in a period of the multisine: its lines are multiples of 25 Hz, odd ones 50 Hz
apart.
"""
GROUP = 4
"""One of this many odd lines is silent."""
WARM_UP = 4
"""Number of first periods of the multisine that are not evaluated."""
LENGTHS = (4, 8, 16, 32, 64, 128)
"""Numbers of periods of the multisine that are evaluated."""
EVALUATED = (4, 6, 8, 10)
"""Numbers of periods of each sine that are evaluated, after the DISCARDED ones."""


@dataclass(frozen=True, eq=False)
class DistortionTests:
    """Both tests of linearity on a drive's loop under the reference controller."""

    laboratory: Laboratory

    @property
    def quiet(self) -> Laboratory:
        """The same drive without noise and rounding."""
        return replace(self.laboratory, noise=0.0, electronics=0.0, bits=None)

    # --- the multisine ------------------------------------------------------------------------

    def multisine(self, rng: np.random.Generator) -> tuple[Multisine, RealArray]:
        """An odd multisine of random phases [V], and its excited lines.

        All lines are equal, and so large that they move the nominal lens by LARGEST_DISPLACEMENT in
        all.
        """
        line = RATE / SAMPLES
        first, last = (int(np.ceil(CLOSED_BAND[0] / line)), int(CLOSED_BAND[1] / line))
        excited, _ = odd_lines(first, last, GROUP, rng)
        one = random_multisine(excited, 1.0, SAMPLES, rng)
        moved = displacement(self.laboratory.axis, excited * line)
        lens = replace(one, amplitudes=abs(moved), phases=one.phases + np.angle(moved))
        largest = float(abs(lens.period()).max())
        allowed = LARGEST_DISPLACEMENT[self.laboratory.axis] / largest
        return replace(one, amplitudes=allowed * one.amplitudes), excited

    def by_multisine(self, seed: int) -> list[LineDistortion]:
        """Distortion of f_en after each of LENGTHS periods, in the draw with this seed."""
        design, excited = self._design(seed)
        played = self._amplitudes_of_error(
            design, self.laboratory, WARM_UP + LENGTHS[-1], seed, ORDINARY_DISC
        )
        return [
            line_distortion(played[: WARM_UP + length], excited, transients=WARM_UP)
            for length in LENGTHS
        ]

    def multisine_truth(self, seed: int) -> LineDistortion:
        """Distortion by the multisine of this seed, without noise and with the disc at rest."""
        design, excited = self._design(seed)
        played = self._amplitudes_of_error(design, self.quiet, WARM_UP + 2, 0, STILL)
        return line_distortion(played, excited, transients=WARM_UP)

    def _design(self, seed: int) -> tuple[Multisine, RealArray]:
        return self.multisine(np.random.default_rng([seed, 1]))  # the noise uses the seed alone

    def _amplitudes_of_error(
        self, design: Multisine, bench: Laboratory, periods: int, seed: int, disc: Disc
    ) -> np.ndarray:
        """Complex amplitudes of f_en (periods, lines)."""
        return line_amplitudes(
            self._error(np.tile(design.period(), periods), bench, seed, disc), SAMPLES
        )

    # --- the sines ----------------------------------------------------------------------------

    @cached_property
    def sweeps(self) -> list[SteppedSine]:
        """Stepped sines, one for each of SIZES."""
        frequency = np.linspace(*CLOSED_BAND, SINES)
        largest = closed_loop_amplitude(self.laboratory.axis, frequency)
        return [SteppedSine(frequency, PERIODS, size * largest, 1 / RATE) for size in SIZES]

    def by_sines(self, seeds: list[int]) -> list[list[LineDistortion]]:
        """Distortion of f_en at each of SIZES, after each of EVALUATED periods."""
        every = zip(self.sweeps, seeds, strict=True)
        return [self._harmonics(self.laboratory, *one, ORDINARY_DISC) for one in every]

    def sines_truth(self) -> list[LineDistortion]:
        """Distortion by the sines without noise and with the disc at rest, from all evaluated
        periods.
        """
        return [self._harmonics(self.quiet, one, 0, STILL)[-1] for one in self.sweeps]

    def _harmonics(
        self, bench: Laboratory, sweep: SteppedSine, seed: int, disc: Disc
    ) -> list[LineDistortion]:
        signal = self._error(np.concatenate([part for _, part in sweep]), bench, seed, disc)
        pieces = zip(
            np.split(signal, np.cumsum(sweep.lengths)[:-1]), sweep.frequencies_hz, strict=True
        )
        found = np.array(
            [
                sine_fit(part, 1 / RATE, frequency, harmonics=HARMONICS)[:PERIODS]
                for part, frequency in pieces
            ]
        )
        return [
            harmonic_distortion(found[:, : DISCARDED + count], transients=DISCARDED)
            for count in EVALUATED
        ]

    # --- both ---------------------------------------------------------------------------------

    @property
    def times(self) -> tuple[RealArray, RealArray]:
        """Times [s] of the multisine after each of LENGTHS, and of all sines after EVALUATED.

        The time of the sines is shortened as if fewer periods had been played.
        """
        sweep = float(sum(one.lengths.sum() for one in self.sweeps)) / RATE
        periods = WARM_UP + np.array(LENGTHS)
        return periods * SAMPLES / RATE, sweep * (DISCARDED + np.array(EVALUATED)) / PERIODS

    def _error(self, played: RealArray, bench: Laboratory, seed: int, disc: Disc) -> RealArray:
        """f_en while an excitation is added to the control signal of the settled loop."""
        law = linear_controller(controller(bench.axis), PERIOD)
        rest = np.zeros(round(RUN_UP * RATE))
        record = bench.closed_loop(law, np.append(rest, played), disc=disc, seed=seed)
        return record.f_en[rest.size :]
