"""Strategies A and B with a wrong rotation frequency, in the loop (section 8.7).

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import figures, problem
from workbench.executor import Context
from workbench.study import (
    Study,
    array,
    arrays,
    check,
    dim,
    draws_summary,
    figure,
    independent_seeds,
    interval_text,
    markdown_table,
    metric,
    part,
    share_of_draws,
    table,
    verdict_of_share,
)
from workbench.types import DataArray, Dataset, Figure, RealArray

from ...diagnosis.defect_runs import ROTATION
from ...diagnosis.quality import Quality
from ...diagnosis.scratch_draws import ScratchDraw
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from ...laboratory.printed_noise import Amplitude, Fixed
from ..bench_reading import BenchReading
from ..strategies.runs import LENGTH, Experiment, StrategyOutcome
from ..strategy_looks import titled

WRONG = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
"""Relative errors of the rotation frequency that the strategies are given."""
TOLD = ("A", "B")
"""The strategies that need the rotation frequency."""


@problem(
    "cd/{axis}/wrong-rotation",
    axis=("focus", "radial"),
    data=(*TABLES, "data/red_book.csv"),
    added=("delay", "noise", "noise_fixed", "quality", "length"),
)
def wrong_rotation(
    axis: Axis,
    drive: str = "nominal",
    draws: Annotated[int, Field(ge=1, le=1000)] = 12,
    delay: Annotated[float, Field(ge=0, le=2)] = 1.0,
    noise: Amplitude = "rms",
    noise_fixed: Fixed = "metres",
    quality: Quality = "graded",
    length: Annotated[float, Field(gt=0, le=2.5e-3)] = LENGTH,
) -> WrongRotation:
    """Strategies A and B with a wrong rotation frequency, beside the reference strategy (8.7).

    The experiment of `cd/<axis>/strategies` is run with the repetitive control and the estimators
    set to a rotation frequency that is up to one half too high. The excursion is the largest true
    error within 5 ms after the scratch, in the same draws for all.

    drive: "CD1" to "CD12", or "nominal". draws: number of draws of noise, place, sign and edge of
    the scratch. delay, noise, noise_fixed, quality, length: as in `cd/<axis>/strategies`.
    """
    reading = BenchReading(delay=delay, noise=noise, noise_fixed=noise_fixed)
    experiment = Experiment(axis, length=length, reading=reading, quality=quality)
    return WrongRotation(experiment, drive, draws)


@dataclass(frozen=True, eq=False)
class WrongRotation(Study):
    """Both strategies at every error of the rotation, and the reference strategy, which does not
    use it.
    """

    experiment: Experiment
    drive: str
    draws: int

    headline: ClassVar[str] = "over_reference_B_10pct_mean"

    @property
    def quantifier(self) -> str:
        return f"in {self.draws} simulated draws on {self.drive}"

    strategy = dim(TOLD)
    wrong = dim(WRONG, meaning="error of the rotation that is told")
    draw = dim(lambda self: range(self.draws))

    @array(dims=draw)
    def seed(self, context: Context) -> Any:
        return independent_seeds(context.rng, self.draws)

    def outcome(self, strategy: str, wrong: float, scratch: ScratchDraw) -> StrategyOutcome:
        """Outcome of a strategy for a scratch, if it is given a wrong rotation frequency."""
        true = self.experiment.scenario(self.drive, strategy, scratch)
        told = replace(true, rotation=ROTATION * (1.0 + wrong))
        return self.experiment.outcome(told.run(), scratch.angle)

    @part
    def met(self, context: Context, seed: DataArray) -> RealArray:
        """Outcomes (draws, 1 + strategies x errors, 4), those of the reference strategy first."""
        cases = [("reference", 0.0), *((name, wrong) for name in TOLD for wrong in WRONG)]

        def outcomes(place: int) -> list[StrategyOutcome]:
            scratch = ScratchDraw.drawn(self.experiment.axis, int(seed[place]))
            return [self.outcome(*case, scratch) for case in cases]

        return np.array(context.spread(outcomes, list(range(self.draws)), "draws"))

    @arrays((draw, strategy, wrong), excursion="m", periodic="m", events="")
    def told(self, met: RealArray) -> dict[str, RealArray]:
        """Excursion, periodic error, and how often the loop was lost or regained."""
        of_told = met[:, 1:].reshape(self.draws, len(TOLD), len(WRONG), -1)
        fields = ("excursion", "periodic", "events")
        return {name: of_told[..., n] for n, name in enumerate(fields)}

    @arrays(draw, reference_excursion="m", reference_periodic="m")
    def untold(self, met: RealArray) -> dict[str, RealArray]:
        """The same for the reference strategy."""
        return {"reference_excursion": met[:, 0, 0], "reference_periodic": met[:, 0, 1]}

    # --- checks -------------------------------------------------------------------------------

    @check(title="{strategy} with the right rotation", at_most=0.25, each="strategy")
    def right(self, answer: Dataset) -> DataArray:
        """share of draws in which its excursion is not below the reference strategy's"""
        return 1.0 - self.below(answer).sel(wrong=0.0)

    @check(title="{strategy} suffers", at_most=0.5, each="strategy")
    def suffers(self, excursion: DataArray) -> DataArray:
        """mean excursion with the right rotation over that with one half too fast"""
        mean = excursion.mean("draw")
        return mean.sel(wrong=0.0) / mean.sel(wrong=max(WRONG))

    def below(self, answer: Dataset) -> DataArray:
        """Share of draws in which an excursion is below the reference strategy's."""
        less = answer["excursion"] < answer["reference_excursion"]
        return share_of_draws(less, "strategy", "wrong")

    # --- what is told -------------------------------------------------------------------------

    @metric
    def excursions(self, answer: Dataset) -> dict[str, float]:
        """Excursions [um], absolute and over the reference strategy's, and share of draws
        below it.
        """
        below, numbers = self.below(answer), {}
        ratio = answer["excursion"] / answer["reference_excursion"]
        kinds = {"excursion_{}_um": 1e6 * answer["excursion"], "over_reference_{}": ratio}
        for name in TOLD:
            for wrong in WRONG:
                at, key = {"strategy": name, "wrong": wrong}, f"{name}_{100 * wrong:.0f}pct"
                for kind, values in kinds.items():
                    told = draws_summary(values.sel(at))
                    for summary in told["summary"].values:
                        found = float(told.sel(summary=summary))
                        numbers[f"{kind.format(key)}_{summary}"] = found
                numbers[f"below_reference_{key}"] = float(below.sel(at))
                numbers[f"lost_{key}"] = float((answer["events"].sel(at) > 0).mean())
        return numbers

    @table
    def rotations(self, answer: Dataset) -> dict[str, str]:
        """Each strategy at each error: mean, and 90 % range of the draws."""
        below, reference = self.below(answer), draws_summary(1e6 * answer["reference_excursion"])
        rows = [["reference", "", interval_text(reference), "", "", ""]]
        for name in TOLD:
            for wrong in WRONG:
                at = {"strategy": name, "wrong": wrong}
                told = interval_text(draws_summary(1e6 * answer["excursion"].sel(at)))
                share = float(below.sel(at))
                lost = f"{float((answer['events'].sel(at) > 0).mean()):.0%}"
                claim = verdict_of_share(share)
                rows.append([titled(name), f"{wrong:.0%}", told, lost, f"{share:.0%}", claim])
        heads = ["strategy", "rotation off by", "excursion [um]", "lost"]
        heads += ["below the reference", "claim"]
        return {"wrong-rotation": markdown_table(heads, rows)}

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        """Excursion over the error of the rotation frequency."""
        drawn, (panel,) = figures.axes(1, 1, size=(7.0, 4.4))
        off, axis = 100 * answer["wrong"].values, self.experiment.axis
        mean, low, high = (1e6 * draws_summary(answer["reference_excursion"])).values
        panel.axhspan(low, high, color="0.9")
        panel.axhline(mean, color="0.4", linestyle="--", label="reference strategy")
        for n, name in enumerate(TOLD):
            told = draws_summary(answer["excursion"].sel(strategy=name)).transpose("summary", ...)
            mean, low, high = (1e6 * told).values
            look: Any = {"color": figures.CYCLE[n], "capsize": 2, "marker": "o", "markersize": 3}
            panel.errorbar(off, mean, [mean - low, high - mean], label=titled(name), **look)
        panel.axhline(1e6 * ACCEPTABLE_ERROR[axis], color="0.4", linewidth=0.8, linestyle=":")
        panel.set_xscale("symlog", linthresh=1.0)
        panel.set_xlim(-0.3, 60.0)
        panel.set_xticks(off, [f"{one:g}" for one in off])
        panel.set_yscale("log")
        title = f"{axis}, {self.draws} draws: mean, and 90 % of them"
        figures.label(
            panel, x="error of the rotation told [%]", y=r"excursion [$\mu$m]", title=title
        )
        figures.legend_below(drawn, panel)
        return {"wrong-rotation": drawn}
