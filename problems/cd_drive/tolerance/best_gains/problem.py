"""The best gain of every strategy, and the benefit of a second controller (1.3, 2.5.1, 9.1).

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from workbench import Run, figures, problem, ref
from workbench.executor import Context
from workbench.simulation import balloon_size, bootstrap_weights, group_means, percentile_interval
from workbench.study import (
    Study,
    array,
    arrays,
    check,
    dim,
    figure,
    markdown_table,
    metric,
    part,
    table,
)
from workbench.synthesis import discretise
from workbench.types import DataArray, Dataset, Figure, RealArray

from ...drive.plants import Gain
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD
from ...laboratory.printed_noise import Amplitude, Fixed
from ..bench_reading import BenchReading
from ..ensemble import GROUPS, circumstances, groups
from ..playability.runs import chosen, met, sampled_controller
from ..playability.search import LARGEST_SENSITIVITY, peak_sensitivity
from .cases import CASES, GAINS, USES, Case, Cases

Scores = tuple[RealArray, NDArray[np.int64]]
"""Share of time out of spec (cases, circumstances), and the groups of circumstances."""
HALVES = ("chosen on", "judged on")
"""Circumstances on which the best case of each use is chosen, and others on which it is judged."""


@problem(
    "cd/{axis}/best-gains",
    slow=True,
    axis=("focus", "radial"),
    needs=lambda axis, **_: {"lower": ref(f"cd/{axis}/lower-bandwidth")},
    data=(*TABLES, "data/red_book.csv"),
    added=("gain", "delay", "noise", "noise_fixed"),
)
def best_gains(
    axis: Axis,
    lower: Run,
    scenarios: Annotated[int, Field(ge=14, le=100_000)] = 84,
    drives: Annotated[int, Field(ge=1, le=12)] = 2,
    workers: Annotated[int, Field(ge=1, le=256)] = 2,
    gain: Gain = "own",
    delay: Annotated[float, Field(ge=0, le=2)] = 1.0,
    noise: Amplitude = "rms",
    noise_fixed: Fixed = "metres",
) -> BestGains:
    """The best gain of every strategy, and what a second controller gains (1.3, 2.5.1, 9.1).

    The cases are strategies at six gains of the reference controller, among them the controller
    alone, and twelve pairs of a fast and a slow controller that are switched by the quality signal.
    The best of each use is chosen on half of the circumstances of `cd/playability` and judged on
    the other half, so that the choice causes no bias. Time out of spec in shocks is judged
    separately, too.

    scenarios: number of circumstances, 7 kinds in turn, for both halves. drives: how many of the
    twelve. workers: number of threads; the answer does not depend on it. gain,
    delay, noise, noise_fixed: as in `cd/<axis>/strategies`.
    """
    reading = BenchReading(gain, delay, noise, noise_fixed)
    cases = Cases(discretise(lower.answer.K, PERIOD), chosen(drives), reading=reading)
    return BestGains(axis, cases, scenarios - scenarios % (2 * len(GROUPS)), workers)


@dataclass(frozen=True, eq=False)
class BestGains(Study):
    """Every case in the same circumstances, and the best of each use."""

    axis: Axis
    cases: Cases
    scenarios: int
    workers: int

    headline: ClassVar[str] = "switched_less_alone_found"

    @property
    def quantifier(self) -> str:
        drives = len(self.cases.drives)
        return f"for {drives} drives, in {self.scenarios // 2} simulated circumstances of each"

    case = dim(lambda: [case.name for case in CASES])
    use, half, group = dim(USES), dim(HALVES), dim(GROUPS)

    @part
    def scores(self, context: Context) -> Scores:
        """Share of time out of spec (cases, circumstances), and the groups of circumstances."""
        rng = np.random.default_rng(context.rng.integers(2**31))
        many = circumstances(self.axis, self.scenarios, self.cases.duration, rng)
        every = met(self.cases, many, self.workers, context.progress, "circumstances")
        return every[..., 0].mean(axis=1), groups(many)

    @array(dims=(half, case, group), unit="1")
    def arm(self, scores: Scores) -> RealArray:
        """Share of time out of spec, by cause"""
        out, group = scores
        halves = (slice(None, self.scenarios // 2), slice(self.scenarios // 2, None))
        return np.array([group_means(out[:, one], group[one]) for one in halves])

    balloon = array(dims=(half, case), value=lambda arm: balloon_size(arm.values))

    @array(dims=use)
    def best(self, balloon: DataArray) -> list[int]:
        """Number of the best case of each use on the circumstances it is chosen on"""
        tried = balloon.sel(half=HALVES[0]).values
        uses = [np.flatnonzero([case.use == use for case in CASES]) for use in USES]
        return [int(one[np.argmin(tried[one])]) for one in uses]

    @part
    def judged_means(self, scores: Scores, best: DataArray, context: Context) -> RealArray:
        """Bootstrapped arms (samples, uses, groups) of the best cases, on the circumstances that
        judge.
        """
        half = self.scenarios // 2
        out, group = scores[0][:, half:], scores[1][half:]
        weight = bootstrap_weights(group, context.rng)
        return np.moveaxis(group_means(out[best.values], group, weight=weight), 0, 1)

    told = dim("found", "low", "high")
    than = dim("alone", "reference")

    @arrays((told, use, than), whole="1", in_shocks="1")
    def less(self, arm: DataArray, best: DataArray, judged_means: RealArray) -> dict[str, Any]:
        """Best of one use minus that of another, with 95 % intervals: balloon, time out of spec in
        shocks.
        """
        found = arm.values[1, best.values][None]
        shocks = GROUPS.index("shocks")
        return {
            "whole": _less(balloon_size(found), balloon_size(judged_means)),
            "in_shocks": _less(found[..., shocks], judged_means[..., shocks]),
        }

    # --- checks -------------------------------------------------------------------------------

    @check(title="loops", at_most=LARGEST_SENSITIVITY)
    def loops(self) -> float:
        """largest |S| of the twelve drives, with any of the gains"""
        return max(peak_sensitivity(self.axis, sampled_controller(self.axis, g)) for g in GAINS)

    @check(title="arms", at_most=1.0)
    def shares(self, arm: DataArray) -> float:
        """largest share of time"""
        return float(arm.max())

    @check(title="a third of the gain alone", at_most=1.0)
    def slow_alone(self, balloon: DataArray) -> float:
        """balloon of the reference controller over that of a third of its gain, both alone"""
        full, third = (Case("alone", gain).name for gain in (0.0, GAINS[0]))
        return float((balloon.sel(case=full) / balloon.sel(case=third)).max())

    # --- what is told -------------------------------------------------------------------------

    def of_best(self, answer: Dataset) -> DataArray:
        """Balloons of the best cases of each use, on the circumstances that judge."""
        return answer["balloon"].sel(half=HALVES[1]).isel(case=answer["best"])

    balloons = metric("balloon_{use}", value=lambda self, answer: self.of_best(answer))
    best_gain = metric(
        template=lambda best: {
            f"best_gain_{use}": CASES[int(n)].fast for use, n in zip(USES, best, strict=True)
        }
    )

    shocks = metric(
        template="shocks_{use}",
        value=lambda arm, best: (
            arm.sel(half=HALVES[1], group="shocks").isel(case=best).drop_vars("case")
        ),
    )
    differences = metric("{use}_less_{than}_{told}", value=lambda whole: whole)
    in_shocks_less = metric(
        template="{use}_less_{than}_in_shocks_{told}", value=lambda in_shocks: in_shocks
    )

    @table
    def compared(self, answer: Dataset) -> Any:
        """Best of each use, minus the best controller alone and minus the reference strategy."""
        balloon, rows = self.of_best(answer), []
        for n, use in enumerate(USES):
            cells = [
                _cell(answer[name].sel(use=use, than=than).values)
                for name in ("whole", "in_shocks")
                for than in ("alone", "reference")
            ]
            best = CASES[int(answer["best"][n])].name
            rows.append([best, f"{float(balloon.sel(use=use)):.3f}", *cells])
        heads = ["best", "balloon", "less alone", "less reference"]
        return [*heads, "in shocks less alone", "less reference"], rows

    @table
    def every(self, answer: Dataset) -> dict[str, str]:
        """Balloons of every case, and the best of each use."""
        best = answer["best"].values.tolist()
        rows = [
            [case.use, case.name, *(f"{one:.3f}" for one in values), "best" if n in best else ""]
            for n, (case, values) in enumerate(
                zip(CASES, answer["balloon"].transpose("case", "half").values, strict=True)
            )
        ]
        return {"balloons": markdown_table(["use", "controller", *HALVES, ""], rows)}

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        """Time out of spec of the best case of each use, by cause."""
        drawn, (panel,) = figures.axes(1, 1, size=(8.0, 4.4))
        place = np.arange(len(GROUPS))
        for n, number in enumerate(answer["best"].values.tolist()):
            share = 100 * answer["arm"].sel(half=HALVES[1]).isel(case=number).values
            label = CASES[number].name
            panel.bar(place + 0.14 * (n - 2.5), share, 0.13, color=figures.CYCLE[n], label=label)
        panel.set_xticks(place, GROUPS, rotation=25, ha="right")
        panel.set_yscale("symlog", linthresh=0.1, linscale=0.4)
        panel.set_ylim(bottom=0.0)
        figures.label(panel, y="time out of spec [%]", title=f"{self.axis}, the best of each use")
        figures.legend_below(drawn, panel, columns=6)
        return {"best": drawn}


def _less(found: RealArray, samples: RealArray) -> RealArray:
    """Each use minus those in `than` (3, uses, 2): of the value found (1, uses), and of samples (S,
    uses).
    """
    others = [USES.index(use) for use in ("alone", "reference")]
    point, less = (one[:, :, None] - one[:, None, others] for one in (found, samples))
    return np.concatenate([point, percentile_interval(np.moveaxis(less, 0, -1))])


def _cell(told: RealArray) -> str:
    """A difference with its interval; empty if there is none."""
    found, low, high = told
    return "" if found == low == high == 0.0 else f"{found:+.3f} ({low:+.3f} to {high:+.3f})"
