"""The ensemble of `cd/playability`: every strategy, and a tuned one, scored and resampled.

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from workbench.errors import InputError
from workbench.executor import Context
from workbench.simulation import balloon_size, bootstrap_weights, group_means, percentile_interval
from workbench.study import Study, array, arrays, check, dim, figure, metric, part, table
from workbench.types import DataArray, Dataset, RealArray, StateSpace

from ...drive.tables import AXES, Axis
from ..ensemble import GROUPS, Circumstance, circumstances, groups
from ..strategy_looks import titled
from .checks import continuous_peak, half_step_change, trace_difference
from .figures import balloons, scores, tuning
from .runs import (
    REPAIRED,
    SCORE_UNITS,
    SCORES,
    Design,
    Player,
    evaluated,
    met,
    played,
    sampled_controller,
)
from .search import BOUNDS, LARGEST_SENSITIVITY, PARAMETERS, Search, peak_sensitivity


@dataclass(frozen=True, eq=False)
class Playability(Study):
    """Every strategy and the tuned one in the same circumstances on the same drives."""

    replacements: Mapping[Axis, StateSpace]
    scenarios: int
    drives: tuple[str, ...]
    strategies: tuple[str, ...]
    tuned: str
    training: int
    trials: int
    duration: float
    workers: int

    headline: ClassVar[str] = "in_spec_focus_reference"

    @property
    def quantifier(self) -> str:
        return f"for {len(self.drives)} drives, in {self.scenarios} simulated scenarios of each"

    def __post_init__(self) -> None:
        if self.tuned not in self.strategies:
            raise InputError(
                f"tuned is {self.tuned!r}; it must be one of {', '.join(self.strategies)}"
            )

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.strategies, "tuned")

    @property
    def split(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Drives for tuning, and the other drives; a single drive is in both."""
        return self.drives[::2], self.drives[1::2] or self.drives

    def design(self, axis: Axis, name: str) -> Design:
        """The untuned design of a strategy."""
        return Design(name, replacement=self.replacements[axis])

    def drawn(self, axis: Axis, part: str, seed: int) -> list[Circumstance]:
        """Circumstances of a part, "training" or "held-out"; the two have no seed in common."""
        number = 2 * AXES.index(axis) + ("training", "held-out").index(part)
        rng = np.random.default_rng([seed, number])
        count = self.training if part == "training" else self.scenarios
        return circumstances(axis, count, self.duration, rng)

    def run(self, context: Context, designs: Any, drives: Any, many: Any, what: str) -> RealArray:
        """Scores of designs (designs, drives, circumstances, SCORES)."""
        player = Player(tuple(designs), drives, self.duration)
        return met(player, many, self.workers, context.progress, what)

    def search(self, axis: Axis, seed: int, context: Context) -> tuple[Design, Any, Any]:
        """Tune a strategy on training discs: the best design, all designs tried, and their
        costs.
        """
        training = self.drawn(axis, "training", seed)

        def cost(design: Design) -> float:
            peak = peak_sensitivity(axis, sampled_controller(axis, design.gain_db))
            if peak > LARGEST_SENSITIVITY:
                return 1.0 + peak - LARGEST_SENSITIVITY  # worse than any balloon
            found = self.run(context, [design], self.split[0], training, f"tuning {axis}")
            return float(balloon_size(group_means(found[0, ..., 0].mean(axis=0), groups(training))))

        return Search(self.design(axis, self.tuned), cost, self.trials).run()

    axis = dim(AXES)
    strategy = dim(lambda self: self.names)
    drive = dim(lambda self: self.drives)
    group = dim(GROUPS)
    parameter = dim(PARAMETERS)
    end = dim("low", "high")
    measure = dim("balloon", "out")

    seed = array(dims=(), value=lambda context: int(context.rng.integers(2**31)))
    held_out = part(lambda self, seed: [self.drawn(axis, "held-out", int(seed)) for axis in AXES])

    # --- the search for a tuned strategy ------------------------------------------------------

    searches = part(
        lambda self, seed, context: [self.search(axis, int(seed), context) for axis in AXES]
    )
    best = array(
        dims=(axis, parameter),
        value=lambda searches: [[getattr(one[0], name) for name in PARAMETERS] for one in searches],
    )
    tried = array(
        dims=(axis, "trial", parameter), value=lambda searches: [one[1] for one in searches]
    )
    cost = array(
        dims=(axis, "trial"),
        unit="",
        meaning="size of the balloon on training discs",
        value=lambda searches: [one[2] for one in searches],
    )
    peak = array(
        dims=axis,
        unit="",
        meaning="largest |S| of the twelve drives with the tuned gain",
        value=lambda searches: [
            peak_sensitivity(axis, sampled_controller(axis, one[0].gain_db))
            for axis, one in zip(AXES, searches, strict=True)
        ],
    )

    # --- the ensemble -------------------------------------------------------------------------

    @part
    def runs(self, searches: Any, held_out: list[list[Circumstance]], context: Context) -> Any:
        """Scores (axes, strategies, drives, circumstances, SCORES)."""
        found = []
        for axis, (tuned, *_), many in zip(AXES, searches, held_out, strict=True):
            designs = [*(self.design(axis, name) for name in self.strategies), tuned]
            found.append(self.run(context, designs, self.drives, many, f"ensemble {axis}"))
        return np.array(found)

    @arrays((axis, strategy, drive, "circumstance"), **SCORE_UNITS)
    def scores(self, runs: Any) -> dict[str, Any]:
        return {name: runs[..., n].astype(np.float32) for n, name in enumerate(SCORES)}

    @array(dims=(axis, "sample"), unit="m", meaning="true error of the last scenario")
    def trace(self, held_out: list[list[Circumstance]]) -> Any:
        name, drive = self.strategies[0], self.drives[0]
        designs = [self.design(axis, name) for axis in AXES]
        errors = [
            evaluated(played(many[-1], drive, design, self.duration))
            for many, design in zip(held_out, designs, strict=True)
        ]
        return np.array(errors, np.float32)

    grouped = part(lambda held_out: groups(held_out[0]))
    present = part(lambda grouped: sorted(set(grouped.tolist())))
    known = dim(lambda present: [GROUPS[number] for number in present])
    weight = part(
        lambda grouped, seed: bootstrap_weights(grouped, np.random.default_rng([int(seed), 99]))
    )

    @part
    def samples(self, runs: Any, grouped: Any, weight: Any) -> Any:
        """Means of the groups (axes, strategies, GROUPS), and their bootstrap samples."""
        out = runs[..., 0].mean(axis=2)
        return [group_means(out, grouped, weight=each) for each in (None, weight)]

    arm = array(
        dims=(axis, strategy, known), value=lambda samples, present: samples[0][..., present]
    )
    arm_interval = array(
        dims=(end, axis, strategy, known),
        value=lambda samples, present: percentile_interval(np.moveaxis(samples[1], 2, -1))[
            ..., present
        ],
    )
    balloon = array(dims=(axis, strategy), value=lambda samples: balloon_size(samples[0]))
    balloon_interval = array(
        dims=(end, axis, strategy),
        value=lambda samples: percentile_interval(balloon_size(samples[1])),
    )

    @part
    def gains(self, runs: Any, grouped: Any, weight: Any) -> Any:
        """Tuned minus untuned scores, by measure, with bootstrap samples, on unseen discs and
        drives.
        """
        fresh = [self.drives.index(name) for name in self.split[1]]
        pair = [self.strategies.index(self.tuned), -1]
        unseen = runs[..., 0][:, pair][:, :, fresh].mean(axis=2)
        means = [group_means(unseen, grouped, weight=each) for each in (None, weight)]
        sizes = [balloon_size(each[:, 1]) - balloon_size(each[:, 0]) for each in means]
        less = unseen[:, 1] - unseen[:, 0]
        shares = less.mean(axis=-1), np.einsum("ac,wc->aw", less, weight) / len(grouped)
        return list(zip(sizes, shares, strict=True))

    gained = array(
        dims=(axis, measure),
        unit="",
        meaning="tuned less untuned, on discs and drives it was not tuned on",
        value=lambda gains: np.transpose(gains[0]),
    )
    gained_interval = array(
        dims=(end, axis, measure),
        value=lambda gains: np.stack([percentile_interval(each) for each in gains[1]], axis=-1),
    )

    # --- checks -------------------------------------------------------------------------------

    @check(title="stored traces", at_most=1e-6)
    def traces(self, answer: Dataset) -> float:
        """largest difference of share [1] or burst [m] out of spec from that of the stored trace"""
        first = answer.isel(strategy=0, drive=0, circumstance=-1)
        return max(trace_difference(axis, first.sel(axis=axis)) for axis in AXES)

    @check(title="replay", at_most=0.02)
    def replayed(self, answer: Dataset) -> float:
        """relative change of the rms error at half the step"""
        first, off = answer.isel(drive=0, circumstance=0), []
        for axis in AXES:
            one = self.drawn(axis, "held-out", int(answer["seed"]))[0]
            for name in self.strategies:
                own, design = first.sel(axis=axis, strategy=name), self.design(axis, name)
                off.append(half_step_change(one, design, self.duration, own))
        return max(off)

    @check(title="arms", at_most=1e-6)
    def arms(self, out: DataArray, arm: DataArray) -> float:
        """largest difference of a share out of spec from the mean of the stored runs [1]"""
        off = 0.0
        for name in arm["known"].values:
            own = out.isel(circumstance=slice(GROUPS.index(str(name)), None, len(GROUPS)))
            mean = own.mean(["drive", "circumstance"])
            off = max(off, float(abs(mean - arm.sel(known=name)).max()))
        return off

    bursts = check(
        title="bursts",
        statement="longest burst of a run never out of spec [m]",
        value=lambda burst, out: burst.where(out == 0.0, 0.0).max(),
        at_most=0.0,
    )

    @check(title="intervals", at_most=0.05)
    def intervals(self, balloon: DataArray, balloon_interval: DataArray) -> float:
        """largest distance of a balloon's size from its interval [1]"""
        low, high = (balloon_interval.sel(end=end) for end in ("low", "high"))
        outside = np.maximum(low - balloon, 0.0) + np.maximum(balloon - high, 0.0)
        return float(outside.max())

    training_cost = check(
        title="training",
        statement="cost of the tuned strategy less that of the untuned one [1]",
        value=lambda cost: (cost.min("trial") - cost.isel(trial=0)).max(),
        at_most=0.0,
    )
    margin = check(
        title="margin",
        statement="largest |S| of a continuous loop, tuned",
        value=lambda best: max(
            continuous_peak(axis, float(best.sel(axis=axis)[0])) for axis in AXES
        ),
        at_most=1.05 * LARGEST_SENSITIVITY,
    )

    @check(title="bounds", at_most=0.0)
    def bounds(self, best: DataArray) -> float:
        """number of tuned parameters outside their bounds"""
        least, most = np.transpose([BOUNDS[name] for name in PARAMETERS])
        return float(((best < least - 1e-9) | (best > most + 1e-9)).sum())

    # --- what is told -------------------------------------------------------------------------

    in_spec = metric(
        template="in_spec_{axis}_{strategy}",
        value=lambda out: 1.0 - out.mean(["drive", "circumstance"]).astype(float),
    )
    lost = metric(
        template="lost_{axis}_{strategy}",
        value=lambda losses: (losses > 0).mean(["drive", "circumstance"]),
    )
    unrepaired = metric(
        template="unrepaired_{axis}_{strategy}",
        value=lambda burst: (burst > REPAIRED).mean(["drive", "circumstance"]),
    )
    burst_mm = metric(
        template="burst_{axis}_{strategy}_mm",
        value=lambda burst: 1e3 * burst.median(["drive", "circumstance"]).astype(float),
    )
    balloons = metric("balloon_{axis}_{strategy}", value=lambda balloon: balloon)
    tuned_peak = metric("tuned_{axis}_peak_sensitivity", value=lambda peak: peak)
    tuned_gain = metric("tuned_{axis}_{measure}", value=lambda gained: gained)
    tuned_interval = metric(
        template="tuned_{axis}_{measure}_{end}", value=lambda gained_interval: gained_interval
    )

    @table
    def score_table(self, answer: Dataset) -> Any:
        """Scores of each axis and strategy."""
        numbers, rows = self.metrics(answer), []
        for axis in AXES:
            for name in self.names:
                own = {"axis": axis, "strategy": name}
                low, high = answer["balloon_interval"].sel(own).values
                forms = {"in_spec": "{:.2%}", "lost": "{:.1%}", "unrepaired": "{:.1%}"}
                shares = [f.format(numbers[f"{key}_{axis}_{name}"]) for key, f in forms.items()]
                size = f"{numbers[f'balloon_{axis}_{name}']:.3f} ({low:.3f} to {high:.3f})"
                label = f"{titled(self.tuned)}, tuned" if name == "tuned" else titled(name)
                burst = f"{numbers[f'burst_{axis}_{name}_mm']:.2f}"
                rows.append([axis, label, *shares, burst, size])
        heads = ["axis", "strategy", "in spec", "lost", "burst > 2.5 mm", "median burst [mm]"]
        return {"scores": ([*heads, "balloon"], rows)}

    @table
    def tuning(self, answer: Dataset) -> Any:
        """Tuned parameters, and the improvement that they give."""
        level, rows = "95%", []  # the default of `percentile_interval`
        for axis in AXES:
            one = answer.sel(axis=axis)
            gains = []
            for gain, (low, high) in zip(
                one["gained"].values, one["gained_interval"].values.T, strict=True
            ):
                gains += [f"{gain:+.4f}", f"{low:+.4f} to {high:+.4f}"]
            rows.append([axis, *(f"{value:.3g}" for value in one["best"].values), *gains])
        return ["axis", *PARAMETERS, "balloon", level, "out of spec", level], rows

    @figure
    def drawn_figures(self, answer: Dataset) -> Any:
        return {
            "balloon": balloons(answer),
            "scores": scores(answer),
            "tuning": tuning(answer, self.tuned),
        }
