"""One draw of the experiment with defects: every statistic at one noise.

The same noise, scaled, and the same signs of the defects' displacement are used for every noise and
for defects of every depth and length, so that all are compared within the same draw.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from workbench.diagnosis import quantile_threshold, roc
from workbench.types import DataArray, RealArray

from ...drive.disc import VELOCITY, Defect
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis
from ...laboratory.bench_setup import NOISE, RATE
from ...laboratory.experiment import Laboratory
from ..defect_events import LATE
from ..defect_runs import DefectRun, run
from ..defect_statistics import STATISTICS, peaks, statistics_of
from ..diode_plane.problem import DIST_MIN

DEPTHS = (0.05, 0.1, 0.2, 0.4)
"""Share of the light that a defect takes."""
LENGTHS = (0.3e-3, 1.0e-3, 4.0e-3)
"""Lengths of defects along the track [m]."""
FACTORS = (0.5, 1.0, 2.0)
"""Measurement noise as a multiple of the usual one, 0.15 um in focus."""
RATES = np.concatenate([[0.0], np.geomspace(1e-3, 1.0, 60)])
"""False-alarm rates at which the curves are stored."""
DIST_MAX = 0.5
"""Distance from the linear area at which the quality signal is 0."""
CLEAN_TIME = 3.0
"""Duration [s] of the runs without defects: one for the thresholds, one for false alarms."""
ALARMS, BLOCK = 0.01, 350
"""False-alarm rate of the thresholds at which delays are measured, per block of 10 ms."""

RunStatistics = dict[str, RealArray]
"""Statistics of a run by name."""


class Trial(NamedTuple):
    """Results of one draw at one noise.

    level (statistic,): thresholds. promised: upper end of the interval of their false-alarm rate,
    which depends on the number of blocks only. alarms (statistic,): number of blocks of a fresh run
    above the thresholds. area, delay [s], missed (statistic, depth, length): delays are means over
    the detected defects, NaN if none was. detection (statistic, depth, length, rate). lost: how
    often the loop was lost or regained.
    """

    level: RealArray
    promised: float
    alarms: RealArray
    area: RealArray
    delay: RealArray
    missed: RealArray
    detection: RealArray
    lost: int


@dataclass(frozen=True)
class DefectTrials:
    """Runs with defects of one depth and length each, and without any.

    defects: number in each run. displacement: false displacement, over the acceptable error.
    """

    axis: Axis
    drive: str
    defects: int
    displacement: float

    def bench(self, factor: float = 1.0) -> Laboratory:
        """The laboratory with the usual noise times a factor; 0 means no noise at all."""
        quiet: dict[str, Any] = {} if factor else {"electronics": 0.0}
        return Laboratory(self.axis, self.drive, noise=factor * NOISE[self.axis], **quiet)

    def trial(self, factor: float, seeds: Sequence[int]) -> Trial:
        """Results of a draw, with seeds of the clean run, of the fresh one, and of those with
        defects.
        """
        bench, (clean_seed, fresh_seed, seed) = self.bench(factor), seeds
        clean, fresh = (
            run(bench, [], one, duration=CLEAN_TIME) for one in (clean_seed, fresh_seed)
        )
        measured, again = self._statistics(clean), self._statistics(fresh)
        thresholds = {
            name: quantile_threshold(one, ALARMS, block=BLOCK) for name, one in measured.items()
        }
        level = {name: one.level for name, one in thresholds.items()}
        signs = np.random.default_rng([seed, 1]).choice([-1.0, 1.0], self.defects)
        runs = [[self.met(bench, d, n, signs, seed) for n in LENGTHS] for d in DEPTHS]
        found = [
            [self._judged(*one, measured, level) for one in zip(row, LENGTHS, strict=True)]
            for row in runs
        ]
        area, delay, missed, detection = (
            np.moveaxis(np.array([[one[number] for one in row] for row in found]), 2, 0)
            for number in range(4)
        )
        return Trial(
            level=np.array(list(level.values())),
            promised=max(one.interval[1] for one in thresholds.values()),
            alarms=np.array([(blocks(again[n], BLOCK) > level[n]).sum() for n in STATISTICS]),
            area=area,
            delay=delay,
            missed=missed,
            detection=detection,
            lost=sum(len(one.record.events) for one in chain([clean, fresh], *runs)),
        )

    def met(
        self, bench: Laboratory, depth: float, length: float, signs: RealArray, seed: int
    ) -> DefectRun:
        """A run over one defect after the other, which differ only in the sign of their
        refraction.
        """
        swing = self.displacement * ACCEPTABLE_ERROR[self.axis]
        defect = Defect(length, depth=depth, edge=0.2)
        return run(bench, [replace(defect, displacement=sign * swing) for sign in signs], seed)

    def delays_without_noise(self, level: RealArray) -> list[list[list[float]]]:
        """Mean delays [s] (statistic, depth, length) at given levels; NaN where nothing is
        detected.

        Defects of both signs of refraction pass once.
        """
        bench, both = self.bench(0.0), np.array([-1.0, 1.0])
        found = [
            [
                [
                    mean_delay(delays(series, one.faults, at))
                    for series, at in zip(self._statistics(one).values(), level, strict=True)
                ]
                for one in (self.met(bench, depth, length, both, 0) for length in LENGTHS)
            ]
            for depth in DEPTHS
        ]
        return np.moveaxis(np.array(found), 2, 0).tolist()

    def _statistics(self, one: DefectRun) -> RunStatistics:
        return statistics_of(one, DIST_MIN[self.axis], DIST_MAX)

    def _judged(
        self, one: DefectRun, length: float, clean: RunStatistics, level: dict[str, float]
    ) -> tuple[list[float], list[float], list[float], list[RealArray]]:
        """Area, delay, share of missed defects and curve of each statistic, for a run with equal
        defects.
        """
        measured = self._statistics(one)
        window = round(length / VELOCITY * RATE) + 1 + LATE
        curves = [
            roc(blocks(clean[name], window), peaks(measured[name], one.faults))
            for name in STATISTICS
        ]
        late = [delays(measured[name], one.faults, level[name]) for name in STATISTICS]
        return (
            [curve.area for curve in curves],
            [mean_delay(each) for each in late],
            [float(np.isnan(each).mean()) for each in late],
            [np.interp(RATES, curve.false_alarm, curve.detection) for curve in curves],
        )


def at_usual_noise(values: DataArray) -> DataArray:
    """Values at the usual noise of the measurement."""
    return values.isel(noise=FACTORS.index(1.0), drop=True)


def blocks(statistic: RealArray, size: int) -> RealArray:
    """Largest value of a statistic (N,) in each block of `size` samples."""
    largest: RealArray = statistic[: len(statistic) // size * size].reshape(-1, size).max(axis=1)
    return largest


def delays(statistic: RealArray, faults: list[tuple[int, int]], level: float) -> RealArray:
    """Time from each fault's start to the first value above the level [s], NaN where missed."""
    hits = [np.flatnonzero(statistic[start : end + LATE] > level) for start, end in faults]
    return np.array([hit[0] / RATE if hit.size else np.nan for hit in hits])


def mean_delay(late: RealArray) -> float:
    """Mean delay [s] of the detected faults; NaN if none was detected."""
    hits = late[~np.isnan(late)]
    return float(hits.mean()) if hits.size else np.nan
