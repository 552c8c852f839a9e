"""How shallow, short and noisy a defect may be to be found: ROC curves of residuals (section 7.1).

Also how soon a laser that fades is noticed, and which of three residuals tell defects and shocks
apart. Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players
(2003).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from pydantic import Field
from scipy import stats

from workbench import Check, Study, problem
from workbench.arrays import RealArray
from workbench.diagnosis import quantile_threshold, roc
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure

from ...drive.disc import VELOCITY, Defect
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from ...laboratory.bench_setup import NOISE, RATE
from ...laboratory.experiment import Laboratory
from ..defect_events import LATE
from ..defect_runs import SPACING, DefectRun, run
from ..defect_statistics import STATISTICS, peaks, statistics_of
from ..diode_plane.problem import DIST_MIN
from .report import figures_of, tables_of
from .sets import FAULTS, fading, isolation

DEPTHS = (0.05, 0.1, 0.2, 0.4)
LENGTHS = (0.3e-3, 1.0e-3, 4.0e-3)
FACTORS = (0.5, 1.0, 2.0)
"""Measurement noise as a multiple of the usual one, 0.15 um in focus."""
RATES = np.concatenate([[0.0], np.geomspace(1e-3, 1.0, 60)])
"""False-alarm rates at which the curves are stored."""
ALARMS, BLOCK = 0.01, 350
"""False-alarm rate of the thresholds at which delays are measured, per block of 10 ms."""
DIST_MAX = 0.5
UNITS = {"area": "1", "deviation": "1", "delay": "s", "missed": "1"}
"""Of what is stored of each condition."""
DOUBT = 1e-3
"""Probability below which the false alarms on fresh runs contradict the rate that was promised."""

Share = Annotated[float, Field(ge=0, le=1)]

Measured = list[dict[str, RealArray]]
"""Statistics of several runs."""


@problem("cd/{axis}/residuals", axis=("focus", "radial"), data=(*TABLES, "data/red_book.csv"))
def residuals(
    axis: Axis,
    drive: str = "CD1",
    runs: Annotated[int, Field(ge=3, le=100)] = 3,
    defects: Annotated[int, Field(ge=10, le=500)] = 30,
    displacement: Share = 0.2,
) -> ResidualCurves:
    """ROC curves of residuals over defect depth, length and noise (section 7.1).

    Sum signal, quality signal, high-passed error, cumulative sum and likelihood ratio of the lost
    light, on a disc that wobbles by what the Red Book allows under the reference controller. Area
    under the curve for 36 kinds of defects; delay and misses at one false alarm a second. A laser
    that fades is noticed by level and by a slow cumulative sum; signatures isolate black dots,
    scratches and shocks.

    drive: "CD1" to "CD12", or "nominal". runs: seeded, of each condition. defects: in each run.
    displacement: false swing of the error, as a share of the acceptable one.
    """
    return ResidualCurves(axis, drive, runs, defects, displacement)


class Quiet(NamedTuple):
    """Runs without a defect at one noise: statistics, thresholds, alarms on as many fresh runs.

    level, promised (statistic,): thresholds and the upper ends of their false-alarm rates'
    intervals; fresh (statistic, 2): blocks of other runs above the level, and of how many; lost:
    how often the loop was lost or regained.
    """

    clean: Measured
    level: list[float]
    promised: list[float]
    fresh: list[tuple[int, int]]
    lost: int


@dataclass(frozen=True)
class ResidualCurves(Study):
    """Runs with defects of one depth and length each, and without any, at three noises."""

    axis: Axis
    drive: str
    runs: int
    defects: int
    displacement: float

    headline: ClassVar[str] = "area_cusum"

    def bench(self, factor: float) -> Laboratory:
        return Laboratory(self.axis, self.drive, noise=factor * NOISE[self.axis])

    def measured(self, one: DefectRun) -> dict[str, RealArray]:
        return statistics_of(one, DIST_MIN[self.axis], DIST_MAX)

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        shape = (len(STATISTICS), len(DEPTHS), len(LENGTHS), len(FACTORS))
        arrays = {name: np.full(shape, np.nan) for name in UNITS}
        curves = np.zeros((*shape, len(RATES)))
        quiet = [self._quiet(self.bench(factor), context.rng) for factor in FACTORS]
        lost = sum(one.lost for one in quiet)
        conditions = np.ndindex(shape[1:])
        for d, n, f in context.track(list(conditions), "conditions"):
            defect = Defect(LENGTHS[n], depth=DEPTHS[d], edge=0.2)
            runs = [
                self._dirty(self.bench(FACTORS[f]), defect, context.rng) for _ in range(self.runs)
            ]
            lost += sum(len(one.record.events) for one in runs)
            faults, measured = [one.faults for one in runs], [self.measured(one) for one in runs]
            window = round(defect.length / VELOCITY * RATE) + 1 + LATE
            for s, name in enumerate(STATISTICS):
                each = [one[name] for one in measured]
                loud = [p for one, at in zip(each, faults, strict=True) for p in peaks(one, at)]
                curve = roc(_blocks(quiet[f].clean, name, window), loud)
                delays = np.concatenate(
                    [_delays(*pair, quiet[f].level[s]) for pair in zip(each, faults, strict=True)]
                )
                found = delays[~np.isnan(delays)]
                delay = float(found.mean()) if found.size else np.nan
                missed = 1.0 - len(found) / len(delays)
                for to, value in zip(
                    UNITS, (curve.area, curve.deviation, delay, missed), strict=True
                ):
                    arrays[to][s, d, n, f] = value
                curves[s, d, n, f] = np.interp(RATES, curve.false_alarm, curve.detection)
        seeds = context.rng.integers(2**31, size=8).tolist()
        condition = ("statistic", "depth", "length", "noise")
        data: dict[str, Any] = {
            name: (condition, values, {"units": UNITS[name]}) for name, values in arrays.items()
        }
        return xr.Dataset(
            {
                **data,
                "detection": ((*condition, "rate"), curves, {"units": "1"}),
                "level": (("noise", "statistic"), [one.level for one in quiet]),
                "promised": (("noise", "statistic"), [one.promised for one in quiet]),
                "fresh": (("noise", "statistic", "count"), [one.fresh for one in quiet]),
                **fading(self.bench(1.0), seeds[:4]),
                **isolation(self.bench(1.0), seeds[4:]),
                "lost": lost,
            },
            coords={
                "statistic": list(STATISTICS),
                "depth": ("depth", list(DEPTHS), {"units": "1"}),
                "length": ("length", list(LENGTHS), {"units": "m"}),
                "noise": ("noise", np.array(FACTORS) * NOISE[self.axis], {"units": "m"}),
                "rate": ("rate", RATES, {"units": "1", "long_name": "false-alarm rate"}),
                "count": ["alarms", "blocks"],
                "fault": list(FAULTS),
            },
        )

    def _quiet(self, bench: Laboratory, rng: np.random.Generator) -> Quiet:
        """Thresholds from half of the runs without a defect, tried on the other half."""
        duration = SPACING * self.defects
        seeds = rng.integers(2**31, size=2 * self.runs).tolist()
        runs = [run(bench, [], seed, duration=duration) for seed in seeds]
        measured = [self.measured(one) for one in runs]
        clean, others = measured[: self.runs], measured[self.runs :]
        level, promised, fresh = [], [], []
        for name in STATISTICS:
            joined = np.concatenate([one[name] for one in clean])
            threshold = quantile_threshold(joined, ALARMS, block=BLOCK)
            again = _blocks(others, name, BLOCK)
            level.append(threshold.level)
            promised.append(threshold.interval[1])
            fresh.append((int(np.sum(again > threshold.level)), len(again)))
        lost = sum(len(one.record.events) for one in runs)
        return Quiet(clean, level, promised, fresh, lost)

    def _dirty(self, bench: Laboratory, defect: Defect, rng: np.random.Generator) -> DefectRun:
        """One defect after the other, all alike but for the direction in which they refract."""
        swing = self.displacement * ACCEPTABLE_ERROR[self.axis]
        signs = rng.choice([-1.0, 1.0], self.defects)
        defects = [replace(defect, displacement=sign * swing) for sign in signs]
        return run(bench, defects, int(rng.integers(2**31)))

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        area, curve = answer["area"], answer["detection"].values
        under = np.trapezoid(curve, answer["rate"].values, axis=-1)
        alarms, blocks = np.moveaxis(answer["fresh"].values, -1, 0)
        chance = stats.binom.sf(alarms - 1, blocks, answer["promised"].values)
        by_sum, usual = area.sel(statistic="sum"), area.sel(noise=NOISE[self.axis])
        deep = usual.sel(statistic=["sum", "quality", "cusum"], depth=max(DEPTHS), length=1e-3)
        better = (area.sel(statistic="quality") - by_sum).max()
        falls = -float(by_sum.diff("depth").min())
        return [
            Check("loop", "times that it was lost or regained", float(answer["lost"]), 0.0),
            Check("curves rise", "largest step down", float(-np.diff(curve, axis=-1).min()), 0.0),
            Check("area", "|area - integral|", float(abs(under - area.values).max()), 0.02),
            Check(
                "promised rate",
                "false alarms on fresh runs, one minus their probability at the interval's end",
                1.0 - float(chance.min()),
                1.0 - DOUBT,
            ),
            Check("deep defects", "1 - area at 1 mm", 1.0 - float(deep.min()), 0.01),
            Check("depth", "largest loss of the sum's area to a deeper defect", falls, 0.05),
            Check("quality is the sum", "its area above the sum's", float(better), 0.02),
            Check(
                "fading laser",
                "light lost when the slow sum alarms, over that of the level",
                float(answer["fade"].sel(way="slow sum") / answer["fade"].sel(way="level")),
                0.8,
            ),
            Check("isolation", "share not isolated", 1.0 - self._isolated(answer), 0.3),
        ]

    def _isolated(self, answer: Dataset) -> float:
        counts = answer["confusion"].values
        return float(np.trace(counts) / counts.sum())

    def metrics(self, answer: Dataset) -> dict[str, float]:
        usual = answer.sel(noise=NOISE[self.axis])
        numbers = {"isolated": self._isolated(answer)}
        for name in STATISTICS:
            one = usual.sel(statistic=name)
            numbers[f"area_{name}"] = float(one["area"].mean())
            shallow = one.sel(depth=0.1)
            for length in LENGTHS:
                numbers[f"area_{name}_10pct_{1e3 * length:g}mm"] = float(
                    shallow["area"].sel(length=length)
                )
            deep = one.sel(depth=0.4, length=1e-3)
            numbers[f"delay_{name}_40pct_1mm_us"] = 1e6 * float(deep["delay"])
            numbers[f"missed_{name}_40pct_1mm"] = float(deep["missed"])
        for way in answer["way"].values:
            place = str(way).replace(" ", "_")
            numbers[f"light_lost_at_alarm_{place}"] = float(answer["fade"].sel(way=way))
        return numbers

    def tables(self, answer: Dataset) -> dict[str, str]:
        return tables_of(answer)

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return figures_of(answer)


def _blocks(runs: Measured, name: str, size: int) -> RealArray:
    """The largest of a statistic in each block of so many samples; a block lies within a run."""
    blocks = [one[name][: len(one[name]) // size * size].reshape(-1, size) for one in runs]
    largest: RealArray = np.concatenate(blocks).max(axis=1)
    return largest


def _delays(statistic: RealArray, faults: list[tuple[int, int]], level: float) -> RealArray:
    """Time from each fault's start to the first value above the level [s], NaN where missed."""
    hits = [np.flatnonzero(statistic[start : end + LATE] > level) for start, end in faults]
    return np.array([hit[0] / RATE if hit.size else np.nan for hit in hits])
