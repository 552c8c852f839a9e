"""Recorded runs with scratches and known truth, for the position estimators (section 7.3).

Equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from workbench.simulation import linear_controller, play
from workbench.types import RealArray

from ...drive.disc import Defect, Disc
from ...drive.plants import controller
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis, Values, red_book
from ...laboratory.bench_setup import PERIOD, RATE
from ...laboratory.experiment import Laboratory, measurements
from ...laboratory.printed_noise import Amplitude, position_noise
from ...laboratory.record import Record
from ..defect_runs import ROTATION
from ..quality import dimming_detector, diode_quality
from ..scratch_draws import ScratchDraw

DURATION, SCRATCHED, EVALUATED = 1.5, 0.3, 0.55
"""Length of a run, time from which the disc has scratches, and time from which errors count [s]."""
AFTERMATH = 5e-3
"""Time [s] after a defect in which errors count as its aftermath."""
DIST_MIN, DIST_MAX = 0.16, 0.36
"""Limits of the quality (eq. 7.13). The diodes' sum is as noisy as f_en, about 4 % rms of a clean
sum in focus, so dist is up to 0.03 rms. dist_min is five times that, so that no clean sample is
called bad; at dist_max half of the light is lost.
"""


Quality = Literal["graded", "binary"]
"""Signal that reduces the estimator's gain in a defect."""


class Trial(NamedTuple):
    """A recorded run, the signals that an estimator receives, and the samples that count.

    known [V]: the control that acts; quality (0 to 1); error: the true x_cd - x [m]. Samples belong
    to one of the phases during (quality below 1), after (the following AFTERMATH), or quiet (the
    others).
    """

    record: Record
    known: RealArray
    quality: RealArray
    error: RealArray
    during: Any
    after: Any
    quiet: Any

    def errors(self, estimated: RealArray) -> list[list[float]]:
        """Rms and largest error [m] of an estimated x_cd - x during, after and otherwise."""
        wrong = estimated - self.error
        return [
            [float(np.sqrt(np.mean(wrong[where] ** 2))), float(abs(wrong[where]).max())]
            for where in (self.during, self.after, self.quiet)
        ]


@dataclass(frozen=True)
class Scratches:
    """A disc with the largest deviation that the Red Book allows, and with scratches after a while.

    length [m] and depth are as in `Defect`; displacement: false displacement, over the largest
    error that can be read. noise: reading of the printed amplitude. quality: graded (eq. 7.13), or
    1 and 0 by the binary detector.
    """

    axis: Axis
    length: float
    depth: float
    displacement: float
    values: Values
    noise: Amplitude = "rms"
    quality: Quality = "graded"

    def defect(self, scratch: ScratchDraw) -> Defect:
        """One scratch in a revolution."""
        return Defect(
            self.length,
            scratch.angle,
            self.depth,
            displacement=scratch.sign * self.displacement * ACCEPTABLE_ERROR[self.axis],
            edge=scratch.edge,
            present=(SCRATCHED, np.inf),
        )

    def trial(
        self, drive: str, scratch: ScratchDraw, noisy: bool = True, prompt: bool = False
    ) -> Trial:
        """The mu-PID on a drive, with one sample of computing delay.

        noisy: with noise of the position. prompt: the quality is 0 exactly in the scratch and 1
        elsewhere.
        """
        noise = position_noise(self.axis, drive, self.noise) if noisy else 0.0
        bench = Laboratory(self.axis, drive, self.values, delay=1.0, noise=noise)
        disc = Disc.along(self.axis, red_book(self.axis).deviation, rotation=ROTATION)
        law = linear_controller(controller(self.axis), PERIOD)
        defects = [self.defect(scratch)]
        record = bench.closed_loop(
            law, duration=DURATION, disc=disc, defects=defects, seed=scratch.seed
        )
        optics = bench.parameters
        level = optics.K_opt / optics.K_optn
        if self.quality == "graded":
            seen = play(diode_quality(level, DIST_MIN, DIST_MAX), measurements(record))[:, 0]
        else:
            seen = 1.0 - play(dimming_detector(level), measurements(record))[:, 0]
        if prompt:
            seen = (record.light == 1.0).astype(float)
        counted = record.time >= EVALUATED
        during = counted & (seen < 1.0)
        recent = np.convolve(seen < 1.0, np.ones(round(AFTERMATH * RATE)))[: len(seen)] > 0
        after = counted & recent & ~during
        acting = np.concatenate([[0.0], record.u_dac[:-1]])  # the converter's output is delayed
        error = record.x_cd - record.x
        return Trial(record, acting, seen, error, during, after, counted & ~during & ~after)

    def covered(self, trial: Trial) -> Any:
        """True where a scratch has taken at least 95 % of the light that it takes in all."""
        return trial.record.light < 1.0 - 0.95 * self.depth
