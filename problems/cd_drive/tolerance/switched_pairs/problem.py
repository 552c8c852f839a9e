"""What the best pair of switched controllers gains over the best single one (sections 1.3, 2.5.1).

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from workbench import Run, figures, problem, ref
from workbench.arrays import RealArray
from workbench.executor import Context
from workbench.heavy_types import DataArray, Dataset, Figure
from workbench.simulation.ensemble_scores import (
    BOOTSTRAP_SAMPLES,
    balloon_size,
    bootstrap_weights,
    group_means,
    percentile_interval,
)
from workbench.study import Study, array, check, dim, figure, metric, part, table
from workbench.synthesis import discretised
from workbench.tables import markdown

from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD
from ..ensemble import GROUPS, circumstances, groups
from ..playability.runs import chosen, met, sampled_controller
from ..playability.search import LARGEST_SENSITIVITY, peak_sensitivity
from .cases import CASES, GAINS, Case, Cases

USES = ("alone", "held", "switched")
Scores = tuple[RealArray, NDArray[np.int64]]
"""Share of time out of spec (cases, circumstances), and the groups of circumstances."""
HALVES = ("chosen on", "judged on")
"""Circumstances by which the best of each use is chosen, and other ones that judge it."""


@problem(
    "cd/{axis}/switched-pairs",
    axis=("focus", "radial"),
    needs=lambda axis, **_: {"lower": ref(f"cd/{axis}/lower-bandwidth")},
    data=(*TABLES, "data/red_book.csv"),
)
def switched_pairs(
    axis: Axis,
    lower: Run,
    scenarios: Annotated[int, Field(ge=14, le=100_000)] = 84,
    drives: Annotated[int, Field(ge=1, le=12)] = 2,
    workers: Annotated[int, Field(ge=1, le=256)] = 2,
) -> SwitchedPairs:
    """The best pair of a fast and a slow controller against the best single one (1.3, 2.5.1).

    The reference controller at six gains, alone and held while the light is bad, and twelve pairs
    switched by the quality signal. The best of each use is chosen on half of the circumstances of
    `cd/playability` and judged on the other half, so that the choice flatters nobody.

    scenarios: circumstances, 7 kinds in turn, for both halves. drives: how many of the twelve.
    workers: threads; the answer is the same with any.
    """
    cases = Cases(discretised(lower.answer.K, PERIOD), chosen(drives))
    return SwitchedPairs(axis, cases, scenarios - scenarios % (2 * len(GROUPS)), workers)


@dataclass(frozen=True, eq=False)
class SwitchedPairs(Study):
    """Every case through the same circumstances, and the best of each use."""

    axis: Axis
    cases: Cases
    scenarios: int
    workers: int

    headline: ClassVar[str] = "switched_less_held"

    @property
    def quantifier(self) -> str:
        drives = len(self.cases.drives)
        return f"for {drives} drives, in {self.scenarios // 2} simulated circumstances of each"

    case = dim(lambda: [case.name for case in CASES])
    use, half, group, end = dim(USES), dim(HALVES), dim(GROUPS), dim("low", "high")

    @part
    def scores(self, context: Context) -> Scores:
        """Share of time out of spec (cases, circumstances), and the groups of circumstances."""
        rng = np.random.default_rng(context.rng.integers(2**31))
        many = circumstances(self.axis, self.scenarios, self.cases.duration, rng)
        every = met(self.cases, many, self.workers, context.progress, "circumstances")
        return every[..., 0].mean(axis=1), groups(many)

    @array((half, case, group), "1")
    def arm(self, scores: Scores) -> RealArray:
        """Share of time out of spec, by cause"""
        out, group = scores
        halves = (slice(None, self.scenarios // 2), slice(self.scenarios // 2, None))
        return np.array([group_means(out[:, one], group[one]) for one in halves])

    balloon = array((half, case), value=lambda arm: balloon_size(arm.values))

    @array(use)
    def best(self, balloon: DataArray) -> list[int]:
        """Number of the best case of each use on the circumstances it is chosen on"""
        tried = balloon.sel(half=HALVES[0]).values
        uses = [np.flatnonzero([case.use == use for case in CASES]) for use in USES]
        return [int(one[np.argmin(tried[one])]) for one in uses]

    @part
    def judged_samples(self, scores: Scores, best: DataArray, context: Context) -> RealArray:
        """Bootstrapped balloons (samples, uses) of the best, on the circumstances that judge."""
        half = self.scenarios // 2
        out, group = scores[0][:, half:], scores[1][half:]
        weight = bootstrap_weights(group, BOOTSTRAP_SAMPLES, context.rng)
        sizes: RealArray = balloon_size(group_means(out[best.values], group, weight))
        return sizes.T

    @array((end, use))
    def gained_interval(self, judged_samples: RealArray) -> RealArray:
        """Balloon of the best pair less that of the best of each use, 95 %"""
        less = judged_samples[:, [-1]] - judged_samples
        return percentile_interval(less.T)

    # --- checks -------------------------------------------------------------------------------

    @check("loops", at_most=LARGEST_SENSITIVITY)
    def loops(self) -> float:
        """largest |S| of the twelve drives, with any of the gains"""
        return max(peak_sensitivity(self.axis, sampled_controller(self.axis, g)) for g in GAINS)

    @check("arms", at_most=1.0)
    def shares(self, arm: DataArray) -> float:
        """largest share of time"""
        return float(arm.max())

    @check("a third of the gain alone", at_most=1.0)
    def slow_alone(self, balloon: DataArray) -> float:
        """balloon of the reference controller over that of a third of its gain, both alone"""
        full, third = (Case("alone", gain).name for gain in (0.0, GAINS[0]))
        return float((balloon.sel(case=full) / balloon.sel(case=third)).max())

    # --- what is told -------------------------------------------------------------------------

    def of_best(self, answer: Dataset) -> DataArray:
        """Balloon of the best of each use on the circumstances that judge."""
        return answer["balloon"].sel(half=HALVES[1]).isel(case=answer["best"])

    balloons = metric("balloon_{use}", lambda self, answer: self.of_best(answer))

    @metric
    def gains(self, answer: Dataset) -> dict[str, float]:
        """What the best pair gains: negative is better."""
        balloon, numbers = self.of_best(answer), {}
        for use in USES[:-1]:
            less = balloon.sel(use="switched") - balloon.sel(use=use)
            numbers[f"switched_less_{use}"] = float(less)
            for end in ("low", "high"):
                found = answer["gained_interval"].sel(use=use, end=end)
                numbers[f"switched_less_{use}_{end}"] = float(found)
        return numbers

    @table
    def pairs(self, answer: Dataset) -> dict[str, str]:
        """Balloons of every case, and the best of each use."""
        best = answer["best"].values.tolist()
        rows = [
            [case.use, case.name, *(f"{one:.3f}" for one in values), "best" if n in best else ""]
            for n, (case, values) in enumerate(
                zip(CASES, answer["balloon"].transpose("case", "half").values, strict=True)
            )
        ]
        return {"pairs": markdown(["use", "controller", *HALVES, ""], rows)}

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        """Time out of spec of the best of each use, cause by cause."""
        drawn, (panel,) = figures.axes(size=(8.0, 4.4))
        place = np.arange(len(GROUPS))
        for n, number in enumerate(answer["best"].values.tolist()):
            share = 100 * answer["arm"].sel(half=HALVES[1]).isel(case=number).values
            label = f"best {USES[n]}: {CASES[number].name}"
            panel.bar(place + 0.27 * (n - 1), share, 0.25, color=figures.CYCLE[n], label=label)
        panel.set_xticks(place, GROUPS, rotation=25, ha="right")
        panel.set_yscale("symlog", linthresh=0.1, linscale=0.4)
        panel.set_ylim(bottom=0.0)
        figures.label(panel, y="time out of spec [%]", title=self.axis)
        figures.legend_below(drawn, panel)
        return {"best": drawn}
