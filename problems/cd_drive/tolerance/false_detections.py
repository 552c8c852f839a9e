"""Cost of a false detection: each strategy reacts as in a defect although there is none (A.3).

Section and appendix numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import figures, problem
from workbench.executor import Context
from workbench.study import (
    CLAIM_SHARE,
    Study,
    array,
    arrays,
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
from workbench.types import DataArray, Dataset, Figure, RealArray

from ..diagnosis.defect_runs import ROTATION
from ..diagnosis.quality import Quality
from ..diagnosis.scratch_draws import ScratchDraw
from ..drive.red_book import ACCEPTABLE_ERROR
from ..drive.shared_parameters import TABLES
from ..drive.tables import Axis
from ..laboratory.bench_setup import RATE
from ..laboratory.printed_noise import Amplitude, Fixed
from ..laboratory.record import Record
from .bench_reading import BenchReading
from .strategies.runs import AFTER, FALSE, Experiment
from .strategy_looks import COLOURS, titled

SHOWN = (-1e-3, 6e-3)
"""Times [s] before and after the start of a false detection for which the error is shown."""
STRATEGIES = ("reference", "A", "B", "C")
"""Strategies in figures A.1 to A.3."""
CASES = ("with", "without")
"""Records with and without the false detection, with the same noise."""


@problem(
    "cd/{axis}/false-detections",
    axis=("focus", "radial"),
    data=(*TABLES, "data/red_book.csv"),
    added=("delay", "noise", "noise_fixed", "quality"),
)
def false_detections(
    axis: Axis,
    drive: str = "nominal",
    lasts: Annotated[float, Field(gt=0, le=5e-3)] = FALSE[1],
    draws: Annotated[int, Field(ge=1, le=1000)] = 12,
    delay: Annotated[float, Field(ge=0, le=2)] = 1.0,
    noise: Amplitude = "rms",
    noise_fixed: Fixed = "metres",
    quality: Quality = "graded",
) -> FalseDetections:
    """What a false detection costs each strategy on a disc of the largest deviation (appendix A.3).

    The experiment of `cd/<axis>/strategies` is run on a disc without defects: the reference
    strategy for a second, then another one, which settles before the detection. Compared are the
    largest true error from the detection's start to 5 ms after its end, the same without the
    detection, and how often the detector itself calls a clean disc bad.

    drive: "CD1" to "CD12", or "nominal". lasts: duration of the false detection [s]. draws: number
    of draws of noise and of the disc's angle at the detection. delay, noise, noise_fixed,
    quality: as in `cd/<axis>/strategies`.
    """
    reading = BenchReading(delay=delay, noise=noise, noise_fixed=noise_fixed)
    experiment = Experiment(axis, reading=reading, quality=quality)
    return FalseDetections(experiment, drive, lasts, draws)


@dataclass(frozen=True)
class FalseDetections(Study):
    """Every strategy with and without a false detection, in the same draws."""

    experiment: Experiment
    drive: str
    lasts: float
    draws: int

    headline: ClassVar[str] = "error_reference_with_mean_um"

    @property
    def quantifier(self) -> str:
        return f"in {self.draws} simulated draws on {self.drive}"

    strategy, case = dim(STRATEGIES), dim(CASES)
    draw = dim(lambda self: range(self.draws))
    time = dim(
        lambda: np.arange(round(SHOWN[0] * RATE), round(SHOWN[1] * RATE)) / RATE,
        unit="s",
        meaning="time from the start of the detection",
    )
    seed = array(dims=draw, value=lambda self, context: independent_seeds(context.rng, self.draws))

    def start(self, scratch: ScratchDraw) -> float:
        """Start [s] of the detection: at the scratch's angle, once the strategy has settled."""
        return self.experiment.first + scratch.angle / ROTATION

    def record(self, strategy: str, scratch: ScratchDraw, case: str, noisy: bool = True) -> Record:
        """A record of the experiment without its scratches."""
        whole = self.experiment.scenario(self.drive, strategy, scratch, noisy=noisy)
        start = self.start(scratch)
        alarms = ((start, start + self.lasts),) if case == "with" else ()
        ends = start + self.lasts + 2 * AFTER
        return replace(whole, defects=(), false_alarms=alarms, duration=ends).run()

    def outcome(self, strategy: str, scratch: ScratchDraw, noisy: bool = True) -> list[list[float]]:
        """Largest error [m], number of losses, and clean samples called bad, for both CASES."""
        start, found = self.start(scratch), []
        for case in CASES:
            one = self.record(strategy, scratch, case, noisy)
            window = (one.time >= start) & (one.time <= start + self.lasts + AFTER)
            bad = one.signals["w_Q"][(one.time >= self.experiment.first) & ~window] < 1.0
            error = abs(one.x_cd - one.x)[window].max()
            found.append([float(error), float(len(one.events)), float(bad.sum())])
        return found

    @part
    def met(self, seed: DataArray, context: Context) -> RealArray:
        """Outcomes (draws, strategies, cases, 3)."""
        axis = self.experiment.axis
        cells = [
            (name, ScratchDraw.drawn(axis, int(one))) for one in seed.values for name in STRATEGIES
        ]
        found = context.spread(lambda cell: self.outcome(*cell), cells, "draws and strategies")
        return np.reshape(found, (self.draws, len(STRATEGIES), len(CASES), 3))

    told = arrays(
        (draw, strategy, case),
        lambda met: {name: met[..., n] for n, name in enumerate(("error", "lost", "called_bad"))},
        error=("m", "largest true error to 5 ms after the detection"),
        lost=("1", "times that focus or track was lost or regained"),
        called_bad=("1", "clean samples that the detector itself calls bad"),
    )

    @array(dims=(strategy, case), unit="m", meaning="the same without noise, first draw")
    def error_without_noise(self, seed: DataArray) -> list[list[float]]:
        scratch = ScratchDraw.drawn(self.experiment.axis, int(seed[0]))
        every = [self.outcome(name, scratch, noisy=False) for name in STRATEGIES]
        return [[one[0] for one in each] for each in every]

    @array(
        dims=(strategy, case, time), unit="m", meaning="true error of the first draw, without noise"
    )
    def shown(self, seed: DataArray) -> Any:
        scratch, found = ScratchDraw.drawn(self.experiment.axis, int(seed[0])), []
        at = round(self.start(scratch) * RATE)
        window = slice(*(at + round(one * RATE) for one in SHOWN))
        for name in STRATEGIES:
            both = (self.record(name, scratch, case, noisy=False) for case in CASES)
            found.append([(one.x_cd - one.x)[window] for one in both])
        return np.array(found, np.float32)

    # --- checks -------------------------------------------------------------------------------

    @check(title="it costs", at_most=1.0)
    def costs(self, error: DataArray) -> DataArray:
        """mean largest error without a false detection over that with it, reference strategy"""
        mean = error.sel(strategy="reference").mean("draw")
        return mean.sel(case="without") / mean.sel(case="with")

    @check(title="{strategy} costs less", at_most=1.0, each="strategy")
    def less(self, error: DataArray) -> DataArray:
        """mean largest error with a false detection over the reference strategy's, A and B"""
        mean = error.sel(case="with").mean("draw")
        return mean.sel(strategy=["A", "B"]) / mean.sel(strategy="reference")

    @check(
        title="loop",
        statement="share of draws in which a strategy loses the loop",
        at_most=1.0 - CLAIM_SHARE,
    )
    def held(self, lost: DataArray) -> DataArray:
        return (lost.sel(case="with") > 0).mean("draw").max()

    # --- what is told -------------------------------------------------------------------------

    errors_um = metric(
        template="error_{strategy}_{case}_{summary}_um",
        value=lambda error: draws_summary(1e6 * error),
    )
    errors_without_noise_um = metric(
        template="error_{strategy}_{case}_without_noise_um",
        value=lambda error_without_noise: 1e6 * error_without_noise,
    )
    out_of_range = metric(
        template="beyond_acceptable_{strategy}",
        value=lambda self, error: share_of_draws(
            error.sel(case="with") > ACCEPTABLE_ERROR[self.experiment.axis], "strategy"
        ),
    )
    losses = metric(
        template="lost_{strategy}", value=lambda lost: (lost.sel(case="with") > 0).mean("draw")
    )
    called_bad_samples = metric(lambda called_bad: called_bad.sum())

    @table
    def cost(self, error: DataArray, lost: DataArray) -> Any:
        """Each strategy: largest error, how often the loop is lost, and whether its error is
        smaller.
        """
        rows = []
        for name in STRATEGIES:
            one = 1e6 * error.sel(strategy=name)
            told = [interval_text(draws_summary(one.sel(case=case))) for case in CASES]
            share = float(share_of_draws(one < 1e6 * error.sel(strategy="reference"), "case")[0])
            claim = "" if name == "reference" else verdict_of_share(share)
            times = f"{float((lost.sel(strategy=name, case='with') > 0).mean()):.0%}"
            rows.append([titled(name), *told, times, claim])
        heads = ["strategy", *(f"{case} it [um]" for case in CASES), "lost in draws"]
        return [*heads, "less than reference"], rows

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        drawn, panels = figures.axes(1, len(STRATEGIES), size=(11.0, 3.6), sharey=True)
        for panel, name in zip(panels, STRATEGIES, strict=True):
            for case, style in zip(CASES, ("-", ":"), strict=True):
                one = 1e6 * answer["shown"].sel(strategy=name, case=case)
                panel.plot(1e3 * answer["time"], one, style, color=COLOURS[name])
            panel.axvspan(0.0, 1e3 * self.lasts, color="0.92")
            figures.label(panel, x="time [ms]", y="", title=f"{titled(name)}")
        figures.label(panels[0], y=rf"true {self.experiment.axis} error [$\mu$m], without noise")
        panels[0].plot([], [], "k-", label="with a false detection, in grey")
        panels[0].plot([], [], "k:", label="without")
        figures.legend_below(drawn, panels[0])
        return {"false-detection": drawn}
