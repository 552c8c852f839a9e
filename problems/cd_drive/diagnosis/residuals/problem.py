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

from workbench import Check, problem
from workbench.arrays import RealArray
from workbench.diagnosis import quantile_threshold, roc
from workbench.executor import Context
from workbench.heavy_types import DataArray, Dataset
from workbench.study import Study, array, arrays, dim, figure, metric, part, table
from workbench.tables import crossed, markdown

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
from . import figures
from .sets import FAULTS, RESIDUALS, STRUCTURE, fading, isolation

DEPTHS = (0.05, 0.1, 0.2, 0.4)
"""Share of the light that a defect takes."""
LENGTHS = (0.3e-3, 1.0e-3, 4.0e-3)
"""Lengths of defects along the track [m]."""
FACTORS = (0.5, 1.0, 2.0)
"""Measurement noise as a multiple of the usual one, 0.15 um in focus."""
RATES = np.concatenate([[0.0], np.geomspace(1e-3, 1.0, 60)])
"""False-alarm rates at which the curves are stored."""
ALARMS, BLOCK = 0.01, 350
"""False-alarm rate of the thresholds at which delays are measured, per block of 10 ms."""
DIST_MAX = 0.5
"""Distance from the linear area at which the quality signal is 0."""
DOUBT = 1e-3
"""Probability below which the false alarms on fresh runs contradict the rate that was promised."""

Share = Annotated[float, Field(ge=0, le=1)]

RunStatistics = list[dict[str, RealArray]]
"""Statistics of several runs, each by name."""


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

    clean: RunStatistics
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

    @property
    def quantifier(self) -> str:
        return "in these simulated records"

    statistic, count = dim(STATISTICS), dim("alarms", "blocks")
    depth, length = dim(DEPTHS, unit="1"), dim(LENGTHS, unit="m")
    noise = dim(lambda self: np.array(FACTORS) * NOISE[self.axis], unit="m")
    rate = dim(RATES, unit="1", meaning="false-alarm rate")
    fault, isolated_as = dim(FAULTS), dim(*FAULTS, "none or several")
    residual, way = dim(RESIDUALS), dim("level", "slow sum")

    quiet = part(lambda self, context: [self._quiet(each, context.rng) for each in FACTORS])
    level = array((noise, statistic), value=lambda quiet: [one.level for one in quiet])
    promised = array((noise, statistic), value=lambda quiet: [one.promised for one in quiet])
    fresh = array((noise, statistic, count), value=lambda quiet: [one.fresh for one in quiet])

    def bench(self, factor: float = 1.0) -> Laboratory:
        """The laboratory with the usual noise times a factor."""
        return Laboratory(self.axis, self.drive, noise=factor * NOISE[self.axis])

    def measured(self, runs: list[DefectRun]) -> RunStatistics:
        return [statistics_of(one, DIST_MIN[self.axis], DIST_MAX) for one in runs]

    def _quiet(self, factor: float, rng: np.random.Generator) -> Quiet:
        """Thresholds from half of the runs without a defect, tried on the other half."""
        bench, duration = self.bench(factor), SPACING * self.defects
        seeds = rng.integers(2**31, size=2 * self.runs).tolist()
        runs = [run(bench, [], seed, duration=duration) for seed in seeds]
        measured = self.measured(runs)
        clean, others = measured[: self.runs], measured[self.runs :]
        level, promised, fresh = [], [], []
        for name in STATISTICS:
            joined = np.concatenate([one[name] for one in clean])
            threshold = quantile_threshold(joined, ALARMS, block=BLOCK)
            again = _blocks(others, name, BLOCK)
            level.append(threshold.level)
            promised.append(threshold.interval[1])
            fresh.append((int(np.sum(again > threshold.level)), len(again)))
        return Quiet(clean, level, promised, fresh, _lost(runs))

    @part
    def judged(self, quiet: list[Quiet], context: Context) -> dict[str, Any]:
        """Stored numbers of each statistic and condition, and how often the loop was lost."""
        shape = len(DEPTHS), len(LENGTHS), len(FACTORS)
        rows, lost = [], 0
        for d, n, f in context.track(list(np.ndindex(shape)), "conditions"):
            defect = Defect(LENGTHS[n], depth=DEPTHS[d], edge=0.2)
            bench = self.bench(FACTORS[f])
            runs = [self._dirty(bench, defect, context.rng) for _ in range(self.runs)]
            lost += _lost(runs)
            rows.append(self._judge(runs, defect, quiet[f]))
        stored = {name: np.array([[s[name] for s in row] for row in rows]) for name in rows[0][0]}
        return {"lost": lost} | {
            name: np.moveaxis(every, 1, 0).reshape(len(STATISTICS), *shape, *every.shape[2:])
            for name, every in stored.items()
        }

    def _judge(self, runs: list[DefectRun], defect: Defect, quiet: Quiet) -> list[dict[str, Any]]:
        """Curve, delays and misses of each statistic on runs with like defects."""
        measured, found = self.measured(runs), []
        window = round(defect.length / VELOCITY * RATE) + 1 + LATE
        for name, level in zip(STATISTICS, quiet.level, strict=True):
            pairs = [(m[name], one.faults) for m, one in zip(measured, runs, strict=True)]
            curve = roc(_blocks(quiet.clean, name, window), [p for q in pairs for p in peaks(*q)])
            delays = np.concatenate([_delays(*pair, level) for pair in pairs])
            hits = delays[~np.isnan(delays)]
            found.append(
                {
                    "area": curve.area,
                    "deviation": curve.deviation,
                    "delay": float(hits.mean()) if hits.size else np.nan,
                    "missed": 1.0 - len(hits) / len(delays),
                    "detection": np.interp(RATES, curve.false_alarm, curve.detection),
                }
            )
        return found

    def _dirty(self, bench: Laboratory, defect: Defect, rng: np.random.Generator) -> DefectRun:
        """One defect after the other, all alike but for the direction in which they refract."""
        swing = self.displacement * ACCEPTABLE_ERROR[self.axis]
        signs = rng.choice([-1.0, 1.0], self.defects)
        defects = [replace(defect, displacement=sign * swing) for sign in signs]
        return run(bench, defects, int(rng.integers(2**31)))

    condition = (statistic, depth, length, noise)
    curves = arrays(
        condition, lambda judged: judged, area="1", deviation="1", delay="s", missed="1"
    )
    detection = array((*condition, rate), "1", "", lambda judged: judged["detection"])
    lost = array(value=lambda quiet, judged: sum(one.lost for one in quiet) + judged["lost"])

    seeds = part(lambda judged, context: context.rng.integers(2**31, size=8).tolist())
    fade = array(way, "1", "", lambda self, seeds: fading(self.bench(), seeds[:4]))
    fired_and_found = part(lambda self, seeds: isolation(self.bench(), seeds[4:]))
    fired = array((fault, residual), "1", "", lambda fired_and_found: fired_and_found[0])
    confusion = array((fault, isolated_as), value=lambda fired_and_found: fired_and_found[1])
    structure = array((residual, fault), value=lambda: STRUCTURE)

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        area, curve = answer["area"], answer["detection"].values
        under = np.trapezoid(curve, RATES, axis=-1)
        alarms, blocks = np.moveaxis(answer["fresh"].values, -1, 0)
        chance = stats.binom.sf(alarms - 1, blocks, answer["promised"].values)
        by_sum, usual = area.sel(statistic="sum"), area.sel(noise=NOISE[self.axis])
        deep = usual.sel(statistic=["sum", "quality", "cusum"], depth=max(DEPTHS), length=1e-3)
        better = (area.sel(statistic="quality") - by_sum).max()
        falls = -float(by_sum.diff("depth").min())
        slow, by_level = (answer["fade"].sel(way=name) for name in ("slow sum", "level"))
        sooner = "light lost when the slow sum alarms, over that of the level"
        fresh = "false alarms on fresh runs, one minus their probability at the interval's end"
        return [
            Check("loop", "times that it was lost or regained", float(answer["lost"]), 0.0),
            Check("curves rise", "largest step down", float(-np.diff(curve, axis=-1).min()), 0.0),
            Check("area", "|area - integral|", float(abs(under - area.values).max()), 0.02),
            Check("promised rate", fresh, 1.0 - float(chance.min()), 1.0 - DOUBT),
            Check("deep defects", "1 - area at 1 mm", 1.0 - float(deep.min()), 0.01),
            Check("depth", "largest loss of the sum's area to a deeper defect", falls, 0.05),
            Check("quality is the sum", "its area above the sum's", float(better), 0.02),
            Check("fading laser", sooner, float(slow / by_level), 0.8),
            Check("isolation", "share not isolated", 1.0 - _isolated(answer["confusion"]), 0.3),
        ]

    isolated = metric(lambda confusion: _isolated(confusion))
    light_lost = metric("light_lost_at_alarm_{way}", lambda fade: fade)

    @metric
    def at_usual_noise(self, answer: Dataset) -> dict[str, DataArray]:
        numbers = {}
        for name in STATISTICS:
            one = answer.sel(noise=NOISE[self.axis], statistic=name)
            numbers[f"area_{name}"] = one["area"].mean()
            for length in LENGTHS:
                shallow = one["area"].sel(depth=0.1, length=length)
                numbers[f"area_{name}_10pct_{1e3 * length:g}mm"] = shallow
            deep = one.sel(depth=0.4, length=1e-3)
            numbers[f"delay_{name}_40pct_1mm_us"] = 1e6 * deep["delay"]
            numbers[f"missed_{name}_40pct_1mm"] = deep["missed"]
        return numbers

    @table
    def areas(self, area: DataArray) -> tuple[list[str], list[list[str]]]:
        """Areas of all conditions."""
        heads = ["light taken", "length [mm]", "noise [um]", *figures.NAMES.values()]
        conditions = area.stack(condition=("depth", "length", "noise")).transpose("condition", ...)
        return heads, [
            [f"{depth:.0%}", f"{1e3 * length:g}", f"{1e6 * noise:.3g}", *map("{:.3f}".format, one)]
            for (depth, length, noise), one in zip(
                conditions["condition"].values, conditions.values, strict=True
            )
        ]

    @table
    def isolation(self, confusion: DataArray, fired: DataArray) -> str:
        """Confusion of the faults and how often each residual fired."""
        shares = crossed(fired, "{:.2f}", "share that fired")
        return markdown(*crossed(confusion)) + "\n" + markdown(*shares)

    roc, area_ = figure(figures.curves), figure(figures.areas)


def _lost(runs: list[DefectRun]) -> int:
    """Number of times that the loop was lost or regained."""
    return sum(len(one.record.events) for one in runs)


def _isolated(confusion: DataArray) -> float:
    """Share of the faults that were isolated rightly."""
    return float(np.trace(confusion.values) / confusion.values.sum())


def _blocks(runs: RunStatistics, name: str, size: int) -> RealArray:
    """Largest value of a statistic in each block of `size` samples; a block lies within a run."""
    blocks = [one[name][: len(one[name]) // size * size].reshape(-1, size) for one in runs]
    largest: RealArray = np.concatenate(blocks).max(axis=1)
    return largest


def _delays(statistic: RealArray, faults: list[tuple[int, int]], level: float) -> RealArray:
    """Time from each fault's start to the first value above the level [s], NaN where missed."""
    hits = [np.flatnonzero(statistic[start : end + LATE] > level) for start, end in faults]
    return np.array([hit[0] / RATE if hit.size else np.nan for hit in hits])
