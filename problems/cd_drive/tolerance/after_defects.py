"""How long the effect of a past defect is visible in the error and in the sum (section 7.1.2).

Section and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import figures, problem
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import DataArray, Dataset, Figure
from workbench.executor import Context
from workbench.study import (
    Study,
    array,
    check,
    dim,
    draws_summary,
    figure,
    independent_seeds,
    interval_text,
    metric,
    part,
    share_of_draws,
    table,
    verdict_of_share,
)
from workbench.study.draws import SURE

from ..diagnosis.defect_kinds import draw
from ..diagnosis.defect_runs import ROTATION, SPACING, DefectRun, run
from ..diagnosis.defect_statistics import high_passed
from ..drive.disc import Disc
from ..drive.shared_parameters import TABLES
from ..drive.tables import Axis, red_book
from ..laboratory.bench_setup import RATE
from ..laboratory.experiment import Laboratory
from .tactics import Strategies, clean_level

KINDS = ("scratch", "black dot", "dropout")
"""Kinds of defects. Finger prints are left out: a loop that is open for so long is lost."""
LOOPS = ("no detector", "reference strategy")
"""The reference controller alone, and with its error set to 0 while a defect is detected."""
SIGNALS = ("error", "sum", "high-passed error")
"""Signals that are compared; a clean disc's sum is 1."""
SHARES: dict[Axis, float] = {"focus": 1.0, "radial": 0.5}
"""Deviations of the disc, over the Red Book's, at which no loop is lost."""
SIGMAS = 3.0
"""The effect of a defect is visible beyond this many standard deviations of the signal's noise."""
SETTLED = 0.05
"""Share of its largest value below which the effect of a scratch has settled, without noise."""
WATCHED = 15e-3
"""Time [s] after a defect in which its effect is evaluated: ten periods of the loop's crossover."""
CLEAN_TIME = 3.0
"""Duration [s] of the record without defects that gives the clean levels."""
SHOWN = (-2e-3, 8e-3)
"""Times [s] before and after the end of a scratch that figures show."""


@problem("cd/{axis}/after-defects", axis=("focus", "radial"), data=(*TABLES, "data/red_book.csv"))
def after_defects(
    axis: Axis,
    drive: str = "CD1",
    share: Annotated[float, Field(ge=0, le=1)] | None = None,
    defects: Annotated[int, Field(ge=1, le=100)] = 6,
    draws: Annotated[int, Field(ge=1, le=1000)] = 12,
) -> AfterDefects:
    """How long a defect is seen after it has passed, in the error and in the sum (7.1.2, fig. 7.4).

    Scratches, black dots and dropouts pass on a wobbling disc, with the reference controller alone
    and with the reference strategy. The effect of a defect is the difference from the same record
    without defects. It is visible while it exceeds three standard deviations of the signal's noise.
    Without noise, the effect of a scratch has settled when it is below a twentieth of its largest
    value. In addition the error is high-passed, as for a detector, and compared with its largest
    value on a clean record.

    drive: "CD1" to "CD12", or "nominal". share: deviation of the disc over the Red Book's; by
    default 1 in focus and a half radially, where the reference strategy loses the track of the
    worst disc at some angles. defects: number of each kind in a draw. draws: number of draws of
    noise and defects.
    """
    return AfterDefects(axis, drive, SHARES[axis] if share is None else share, defects, draws)


@dataclass(frozen=True)
class AfterDefects(Study):
    """Runs with defects of every kind, and runs without defects."""

    axis: Axis
    drive: str
    share: float
    defects: int
    draws: int

    headline: ClassVar[str] = "error_settles_reference_strategy_mean_ms"

    @property
    def quantifier(self) -> str:
        return f"in {self.draws} simulated draws of {self.defects} defects of each kind"

    loop, kind, signal = dim(LOOPS), dim(KINDS), dim(SIGNALS)
    signal_without_noise = dim(*SIGNALS[:2])
    draw = dim(lambda self: range(self.draws))
    time = dim(
        lambda: np.arange(round(SHOWN[0] * RATE), round(SHOWN[1] * RATE)) / RATE,
        unit="s",
        meaning="time from the end of a scratch",
    )
    seed = array(dims=draw, value=lambda self, context: independent_seeds(context.rng, self.draws))

    @part
    def found(self, seed: DataArray, context: Context) -> Any:
        """Clean levels, times after the defects and losses, for every draw and loop."""
        cells = [(loop, int(one)) for one in seed.values for loop in LOOPS]
        every = context.spread(lambda cell: self.one_draw(*cell), cells, "draws")
        return tuple(
            np.reshape(one, (self.draws, len(LOOPS), *np.shape(one)[1:])).astype("f4")
            for one in zip(*every, strict=True)
        )

    level = array(
        dims=(draw, loop, signal), unit="1", meaning="clean level", value=lambda found: found[0]
    )
    after = array(
        dims=(draw, loop, kind, signal),
        unit="s",
        meaning="mean time beyond it",
        value=lambda found: found[1],
    )
    lost = array(
        dims=(draw, loop),
        unit="1",
        meaning="times that the loop was lost",
        value=lambda found: found[2],
    )

    settles = array(
        dims=(draw, loop, signal_without_noise),
        unit="s",
        meaning="mean time in which a scratch's effect settles, without noise",
    )(lambda found: found[3])

    @array(
        dims=(loop, signal, time), unit="1", meaning="effect of the first scratch of the first draw"
    )
    def shown(self, seed: DataArray) -> Any:
        found = []
        for loop in LOOPS:
            passed, clean = self.pair(loop, int(seed[0]))
            end = passed.faults[0][1]
            window = slice(*(end + round(one * RATE) for one in SHOWN))
            found.append([one[window] for one in effects(passed, clean)])
        return np.array(found, np.float32)

    def run(self, loop: str, defects: Any, seed: int, duration: float, noisy: bool) -> DefectRun:
        """A record with or without defects."""
        quiet: dict[str, Any] = {} if noisy else {"noise": 0.0, "electronics": 0.0}
        bench = Laboratory(self.axis, self.drive, **quiet)
        disc = Disc.along(self.axis, self.share * red_book(self.axis).deviation, rotation=ROTATION)
        law = None
        if loop == LOOPS[1]:
            law = Strategies(self.axis, clean_level(bench), ROTATION).named("reference")
        return run(bench, defects, seed, duration=duration, disc=disc, law=law)

    def pair(self, loop: str, seed: int, noisy: bool = True) -> tuple[DefectRun, DefectRun]:
        """The record of a seed with its defects, kind after kind, and the same record
        without them.
        """
        rng = np.random.default_rng(seed)
        drawn = [draw(kind, rng, self.axis) for kind in KINDS for _ in range(self.defects)]
        noise, duration = int(rng.integers(2**31)), SPACING * len(drawn)
        passed, clean = (self.run(loop, one, noise, duration, noisy) for one in (drawn, []))
        return passed, clean

    def one_draw(self, loop: str, seed: int) -> tuple[RealArray, RealArray, int, RealArray]:
        """Levels (signal,), mean times (kind, signal), losses, and settling times of a seed."""
        quiet = int(np.random.default_rng([seed, 1]).integers(2**31))
        noisy, still = (self.run(loop, [], quiet, CLEAN_TIME, one) for one in (True, False))
        noise = [np.std(a - b) for a, b in zip(watched(noisy), watched(still), strict=True)]
        level = SIGMAS * np.array(noise)
        level[2] = abs(high_passed(noisy.record.f_en)).max()
        passed, clean = self.pair(loop, seed)
        found = [
            [self.beyond(one, fault, limit) for fault in passed.faults]
            for one, limit in zip(effects(passed, clean), level, strict=True)
        ]
        mean = np.array(found).reshape(len(SIGNALS), len(KINDS), -1).mean(axis=2).T
        lost = len(noisy.record.events) + len(passed.record.events)
        return level, mean, lost, self.settling(loop, seed)

    def settling(self, loop: str, seed: int) -> RealArray:
        """Mean time [s] (2,) in which the effects of a seed's scratches settle, without noise."""
        passed, clean = self.pair(loop, seed, noisy=False)
        length, scratches = round(WATCHED * RATE), passed.faults[: self.defects]
        found = [
            [
                self.beyond(one, fault, SETTLED * float(one[fault[0] : fault[1] + length].max()))
                for fault in scratches
            ]
            for one in effects(passed, clean)[:2]
        ]
        return np.array(found).mean(axis=1)

    def beyond(self, values: RealArray, fault: tuple[int, int], limit: float) -> float:
        """Time [s] from the end of a defect to the last sample beyond a limit."""
        return last_beyond(values[fault[1] : fault[1] + round(WATCHED * RATE)], limit) / RATE

    # --- checks -------------------------------------------------------------------------------

    @check(title="{loop}: error settles later than the sum", at_most=1.0 - SURE, each="loop")
    def later(self, settles: DataArray) -> DataArray:
        """share of draws in which a scratch's effect on the sum settles no sooner, without noise"""
        error, total = (settles.sel(signal_without_noise=one) for one in SIGNALS[:2])
        return share_of_draws(error <= total, "loop")

    @check(title="error seen longer than the sum", at_most=1.0 - SURE)
    def longer(self, after: DataArray) -> DataArray:
        """share of draws, reference strategy, in which the sum is seen no less after scratches"""
        one = after.sel(kind="scratch", loop=LOOPS[1])
        return share_of_draws(one.sel(signal="error") <= one.sel(signal="sum"))

    @check(title="loop", statement="share of draws in which a loop is lost", at_most=1.0 - SURE)
    def held(self, lost: DataArray) -> DataArray:
        return (lost > 0).mean("draw").max()

    # --- what is told -------------------------------------------------------------------------

    times_ms = metric(
        template="{signal}_after_{kind}_{loop}_{summary}_ms",
        value=lambda after: draws_summary(1e3 * after),
    )
    settling_ms = metric(
        template="{signal_without_noise}_settles_{loop}_{summary}_ms",
        value=lambda settles: draws_summary(1e3 * settles),
    )

    share_lost = metric("lost_{loop}", value=lambda lost: (lost > 0).mean("draw"))

    @table
    def durations(self, after: DataArray, settles: DataArray) -> Any:
        """Each loop and kind: the times, and whether the error's is longer than the sum's."""
        rows = []
        for loop in LOOPS:
            for kind in KINDS:
                one = 1e3 * after.sel(loop=loop, kind=kind)
                told = [interval_text(draws_summary(one.sel(signal=name))) for name in SIGNALS]
                share = float(share_of_draws(one.sel(signal="error") > one.sel(signal="sum")))
                rows.append([loop, kind, *told, f"{share:.0%}", verdict_of_share(share)])
            one = 1e3 * settles.sel(loop=loop)
            error, total = (one.sel(signal_without_noise=name) for name in SIGNALS[:2])
            told = [interval_text(draws_summary(each)) for each in (error, total)]
            share = float(share_of_draws(error > total))
            row = [loop, "scratch, settled", *told, "", f"{share:.0%}", verdict_of_share(share)]
            rows.append(row)
        heads = ["loop", "after a", *(f"{name} [ms]" for name in SIGNALS)]
        return [*heads, "error longer than sum in draws", "claim"], rows

    @figure
    def figure_7_4(self, answer: Dataset) -> Figure:
        """Effects of a scratch on error and sum, and the times after it."""
        drawn, panels = figures.axes(1, 3, size=(10.5, 3.8))
        time, level = 1e3 * answer["time"].values, answer["level"].mean("draw")
        for panel, name in zip(panels, SIGNALS[:2], strict=False):
            for n, loop in enumerate(LOOPS):
                at = {"signal": name, "loop": loop}
                panel.plot(time, answer["shown"].sel(at), color=figures.CYCLE[n], label=loop)
                panel.axhline(float(level.sel(at)), color=figures.CYCLE[n], linestyle=":")
            panel.axvline(0.0, color="0.4", linewidth=0.8)
            words = f"effect on the {name} [1]"
            figures.label(
                panel, "time from its end [ms]", words, f"{self.axis}, a scratch, fig. 7.4"
            )
        told = 1e3 * draws_summary(answer["after"].sel(signal=list(SIGNALS[:2])))
        for k, (name, mark) in enumerate(zip(SIGNALS[:2], "os", strict=True)):
            for n, loop in enumerate(LOOPS):
                mean, low, high = told.sel(signal=name, loop=loop).transpose("summary", ...).values
                place = np.arange(len(KINDS)) + 0.15 * (2 * n + k - 1.5)
                colour = figures.CYCLE[n]
                panels[2].hlines(place, low, high, color=colour, linewidth=1.0)
                panels[2].plot(mean, place, mark, color=colour, markersize=4)
        panels[2].set_yticks(np.arange(len(KINDS)), list(KINDS))
        panels[2].invert_yaxis()
        figures.label(panels[2], "seen after a defect [ms]", "", "dot: error, square: sum")
        figures.legend_below(drawn, panels[0])
        return drawn


def watched(one: DefectRun) -> tuple[RealArray, RealArray, RealArray]:
    """SIGNALS of a record (N,)."""
    error = one.record.f_en
    return error, one.diodes.sum(axis=1), high_passed(error)


def effects(passed: DefectRun, clean: DefectRun) -> tuple[RealArray, RealArray, RealArray]:
    """Effect of defects on SIGNALS (N,); for the last signal its own magnitude, as a detector sees
    it.
    """
    error, total = passed.record.f_en - clean.record.f_en, passed.record.sum - clean.record.sum
    return abs(error), abs(total) / clean.level, abs(high_passed(passed.record.f_en))


def last_beyond(values: RealArray, limit: float) -> int:
    """Number of samples up to the last one beyond a limit; 0 if there is none."""
    beyond = np.flatnonzero(values > limit)
    return int(beyond[-1]) + 1 if beyond.size else 0
