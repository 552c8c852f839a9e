"""One start of a drive whose gain is controlled by a wobble at crossover (section 4.4).

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from workbench.simulation import Cascade, Part, automatic_gain_control, linear_controller
from workbench.types import RealArray

from ...drive.disc import Defect, Disc
from ...drive.plants import controller, crossover
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis, red_book
from ...laboratory.bench_setup import PERIOD, RATE
from ...laboratory.experiment import MEASUREMENTS, STILL, Laboratory
from ...laboratory.in_the_loop import DISC_SHARE, ROTATION, controller_response

WOBBLE = {"focus": 0.3e-6, "radial": 0.03e-6}
"""Amplitude of the wobble [m]: twice the noise's standard deviation, a seventh of the largest
error at which a disc can be read."""
START, END = 0.5, 2.5
"""Times [s] at which the wobble begins and ends; the loop and the disc settle before."""
DETECTION, ADAPTATION = 0.02, 0.2
"""Time constants [s] of the detectors' filters and of the gain."""
WITHIN = 1.0
"""Largest |L| at the wobble's frequency [dB], up or down, at which the gain counts as adjusted."""
STEPS = 125
"""Number of times at which the level of the loop is shown."""
SCRATCH = 1.2e-3
"""Length of the scratch [m]; it passes once in every turn."""
FALSE_SHARE = 0.5
"""False displacement by a scratch, over the largest error at which a disc can be read."""
DIM = 0.5
"""Reflectivity of a dim disc."""


class Start(NamedTuple):
    """Results of one start.

    level (STEPS + 1,): |L| at the wobble's frequency [dB] from START to END. events: number of
    times that the loop was lost or regained. settled: time [s] after START from which the level
    stays within WITHIN; NaN if it does not.
    """

    level: RealArray
    events: int
    settled: float


@dataclass(frozen=True)
class Arm:
    """A disc: its deviation over the Red Book's, its reflectivity, and whether it is scratched."""

    deviation: float
    reflectivity: float = 1.0
    scratched: bool = False

    def disc(self, axis: Axis) -> Disc:
        """The disc."""
        if not self.deviation:
            return replace(STILL, reflectivity=self.reflectivity)
        size = self.deviation * red_book(axis).deviation
        return Disc.along(axis, size, rotation=ROTATION, reflectivity=self.reflectivity)

    def defects(self, axis: Axis) -> Sequence[Defect]:
        """Scratches of the disc, whose false displacement swings by a share of the acceptable
        error.
        """
        swing = FALSE_SHARE * ACCEPTABLE_ERROR[axis]
        return [Defect(SCRATCH, displacement=swing)] if self.scratched else []


ARMS = {
    "still": Arm(0.0),
    "ordinary": Arm(DISC_SHARE),
    "red_book": Arm(1.0),
    "scratch": Arm(DISC_SHARE, scratched=True),
    "dim": Arm(DISC_SHARE, reflectivity=DIM),
}


def started(bench: Laboratory, arm: Arm, seed: int) -> Start:
    """A start of a drive on a disc."""
    axis, at = bench.axis, crossover(bench.axis)
    size = WOBBLE[axis] * Laboratory(axis, "nominal").parameters.K_optn
    gain = automatic_gain_control(
        at, size, PERIOD, interval=(START, END), detection=DETECTION, adaptation=ADAPTATION
    )
    law = [
        Part("gain control", gain, ["f_en"], outputs=["fed", "gain"]),
        Part("K", linear_controller(controller(axis), PERIOD), ["fed"], outputs=["u"]),
    ]
    record = bench.closed_loop(
        Cascade(MEASUREMENTS, law),
        duration=END,
        disc=arm.disc(axis),
        defects=arm.defects(axis),
        seed=seed,
    )
    factor = record.signals["gain"][round(START * RATE) :]
    level = level_of(bench) + 20 * np.log10(factor)
    outside = np.flatnonzero(abs(level) > WITHIN)
    first = outside[-1] + 1 if outside.size else 0
    settled = first * PERIOD if first < len(level) else np.nan
    places = np.linspace(0, len(level) - 1, STEPS + 1).round().astype(int)
    return Start(level[places], len(record.events), float(settled))


def level_of(bench: Laboratory, frequency: float | None = None) -> float:
    """|L| [dB] of a drive's sampled loop under the reference controller, by default at the wobble's
    frequency.

    frequency [Hz].
    """
    at = np.array([crossover(bench.axis) if frequency is None else frequency])
    loop = bench.response(at)["f_en"] * controller_response(bench.axis, at)
    return float(20 * np.log10(abs(loop[0])))


def crossover_of(bench: Laboratory, gain_db: float, grid: RealArray) -> float:
    """Highest frequency [Hz] at which |L|, with its gain changed by `gain_db`, passes 1; NaN if
    none.

    grid: frequencies [Hz] (F,), between which the level is interpolated.
    """
    loop = bench.response(grid)["f_en"] * controller_response(bench.axis, grid)
    level = 20 * np.log10(abs(loop)) + gain_db
    above = np.flatnonzero((level[:-1] > 0.0) & (level[1:] <= 0.0))
    if not above.size:
        return float("nan")
    n = above[-1]
    share = level[n] / (level[n] - level[n + 1])
    return float(grid[n] * (grid[n + 1] / grid[n]) ** share)
