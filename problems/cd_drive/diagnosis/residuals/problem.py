"""How shallow, short and noisy defects can be detected: ROC curves of residuals (section 7.1).

It is also found how early a fading laser is noticed, and how well three residuals distinguish
defects and shocks. Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field
from scipy import stats

from workbench import Check, problem
from workbench.executor import Context
from workbench.study import (
    SUMMARY,
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
    table,
)
from workbench.types import DataArray, Dataset

from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from ...laboratory.bench_setup import NOISE, RATE
from ..defect_claims import claim_checks, claims_in_words
from ..defect_statistics import STATISTICS
from . import figures
from .claims import CLAIMED, isolated_share, residual_claims
from .figures import SHOWN_DEPTH
from .sets import (
    FAULTS,
    RESIDUALS,
    STRUCTURE,
    WAYS,
    fading,
    isolation,
    lost_at_alarm_without_noise,
)
from .trials import (
    BLOCK,
    CLEAN_TIME,
    DEPTHS,
    FACTORS,
    LENGTHS,
    RATES,
    DefectTrials,
    Trial,
    at_usual_noise,
)

DOUBT = 1e-3
"""Probability below which the false alarms on fresh runs contradict the promised rate."""
EXPERIMENTS = ("clean", "fresh", "defects", "fading", "isolation")
"""Experiments that have a seed of their own in each draw."""

Share = Annotated[float, Field(ge=0, le=1)]


@problem(
    "cd/{axis}/residuals", slow=True, axis=("focus", "radial"), data=(*TABLES, "data/red_book.csv")
)
def residuals(
    axis: Axis,
    drive: str = "CD1",
    defects: Annotated[int, Field(ge=10, le=500)] = 20,
    displacement: Share = 0.2,
    draws: Annotated[int, Field(ge=1, le=1000)] = 12,
) -> ResidualCurves:
    """ROC curves of residuals over defect depth, length and noise (section 7.1).

    Sum signal, quality signal, high-passed error, and cumulative sum and likelihood ratio of the
    lost light are compared on a disc with the Red Book's deviation under the reference controller.
    Results are the area under the curve for 36 kinds of defects, and delay and misses at one false
    alarm per second. A fading laser is noticed by level and by a slow cumulative sum; signatures
    isolate black dots, scratches and shocks. Each number is a distribution over draws of noise and
    defects; the statistics are compared in the same draw.

    drive: "CD1" to "CD12", or "nominal". defects: number of defects of each kind in a draw.
    displacement: false swing of the error, over the acceptable error. draws: number of draws of the
    whole experiment.
    """
    return ResidualCurves(DefectTrials(axis, drive, defects, displacement), draws)


@dataclass(frozen=True)
class ResidualCurves(Study):
    """Runs with defects of one depth and length each, and runs without defects, at three noises."""

    trials: DefectTrials
    draws: int

    headline: ClassVar[str] = "area_cusum_mean"

    @property
    def quantifier(self) -> str:
        return f"in {self.draws} simulated draws"

    draw, experiment = dim(lambda self: range(self.draws)), dim(EXPERIMENTS)
    statistic, summary = dim(STATISTICS), dim(SUMMARY)
    depth, length = dim(DEPTHS, unit="1"), dim(LENGTHS, unit="m")
    noise = dim(lambda self: np.array(FACTORS) * NOISE[self.trials.axis], unit="m")
    rate = dim(RATES, unit="1", meaning="false-alarm rate")
    fault, isolated_as = dim(FAULTS), dim(*FAULTS, "none or several")
    residual, way = dim(RESIDUALS), dim(WAYS)

    seed = array(
        dims=(draw, experiment),
        value=lambda self, context: independent_seeds(context.rng, self.draws, len(EXPERIMENTS)),
    )

    # --- statistics of defects ----------------------------------------------------------------

    @part
    def found(self, seed: DataArray, context: Context) -> dict[str, Any]:
        """Results of all draws and noises by name, (draw, noise, ...)."""
        cells = [(factor, seeds[:3]) for seeds in seed.values.tolist() for factor in FACTORS]
        every = context.spread(lambda cell: self.trials.trial(*cell), cells, "draws and noises")
        return {
            name: np.reshape(value, (self.draws, len(FACTORS), *np.shape(value)[1:]))
            for name, value in zip(Trial._fields, zip(*every, strict=True), strict=True)
        }

    thresholds = arrays(
        (draw, noise, statistic),
        lambda found: {"level": np.float32(found["level"]), "alarms": np.int16(found["alarms"])},
        level="",
        alarms=("", "blocks of the fresh run above the threshold"),
    )
    promised = array(
        dims=(),
        unit="1",
        meaning="end of the interval of the false-alarm rate",
        value=lambda found: found["promised"].max(),
    )
    blocks = array(
        dims=(),
        unit="",
        meaning="of a run without defects",
        value=lambda: int(CLEAN_TIME * RATE) // BLOCK,
    )
    condition = (statistic, depth, length)
    curves = arrays(
        (draw, noise, *condition),
        lambda found: {name: np.float32(found[name]) for name in ("area", "delay", "missed")},
        area="1",
        delay=("s", "mean over what was found"),
        missed="1",
    )

    @array(
        dims=(noise, *condition, rate, summary), unit="1", meaning="detection rate over the draws"
    )
    def detection(self, found: dict[str, Any]) -> DataArray:
        import xarray as xr

        dims = ("draw", "noise", "statistic", "depth", "length", "rate")
        return draws_summary(xr.DataArray(found["detection"], dims=dims)).astype("f4")

    lost = array(dims=draw, value=lambda found: found["lost"].sum(axis=1))
    delay_without_noise = array(
        dims=condition,
        unit="s",
        meaning="at the mean thresholds of the usual noise",
        value=lambda self, level: self.trials.delays_without_noise(
            at_usual_noise(level).mean("draw").values
        ),
    )

    # --- a laser that fades -------------------------------------------------------------------

    @arrays((draw, way), fade=("1", "light lost at the alarm"), fade_level="")
    def fading(self, seed: DataArray, context: Context) -> dict[str, Any]:
        seeds = seed.sel(experiment="fading").values.tolist()
        every = context.spread(lambda one: fading(self.trials.bench(), one), seeds, "fading laser")
        found = np.array(every, np.float32)
        return {"fade": found[..., 0], "fade_level": found[..., 1]}

    fade_without_noise = array(
        dims=way,
        unit="1",
        meaning="at the mean thresholds",
        value=lambda self, fade_level: lost_at_alarm_without_noise(
            self.trials.bench(0.0), fade_level.mean("draw").values.tolist()
        ),
    )

    # --- isolation ----------------------------------------------------------------------------

    @part
    def fired_and_found(self, seed: DataArray, context: Context) -> Any:
        seeds = seed.sel(experiment="isolation").values.tolist()
        every = context.spread(lambda one: isolation(self.trials.bench(), one), seeds, "isolation")
        return tuple(zip(*every, strict=True))

    fired = array(
        dims=(draw, fault, residual),
        unit="1",
        meaning="",
        value=lambda fired_and_found: np.float32(fired_and_found[0]),
    )
    confusion = array(
        dims=(draw, fault, isolated_as), value=lambda fired_and_found: np.int16(fired_and_found[1])
    )
    structure = array(dims=(residual, fault), value=lambda: STRUCTURE)

    # --- checks -------------------------------------------------------------------------------

    @check()
    def of_draws(self, answer: Dataset) -> list[Check]:
        """The loop stays closed, the curves are valid ROC curves, and the claimed
        statements hold.
        """
        rises = float(-answer["detection"].diff("rate").min())
        under = answer["detection"].sel(summary="mean").integrate("rate")
        off = abs(under - answer["area"].mean("draw")).max()
        loop = "times that it was lost or regained, all draws"
        fall = "largest fall of a detection rate from one false-alarm rate to the next [1]"
        area = "largest difference of a mean area from the integral of the mean curve [1]"
        return [
            Check("loop", loop, float(answer["lost"].sum()), 0.0),
            Check("curves rise", fall, rises, 0.0),
            Check("area", area, float(off), 0.02),
            *claim_checks(residual_claims(answer), CLAIMED),
        ]

    @check(title="promised rate", at_most=1.0 - DOUBT)
    def kept_rate(self, alarms: DataArray, blocks: DataArray, promised: DataArray) -> DataArray:
        """one minus the probability of the false alarms on the fresh runs of all draws, at the end
        of the promised interval"""
        tried = int(blocks) * self.draws
        chance = stats.binom.sf(alarms.sum("draw") - 1, tried, float(promised))
        return alarms.sum("draw").copy(data=1.0 - chance)

    # --- what is told -------------------------------------------------------------------------

    isolated = metric(
        template="isolated_{summary}",
        value=lambda confusion: draws_summary(isolated_share(confusion)),
    )
    light_lost = metric(
        template="light_lost_at_alarm_{way}_{summary}", value=lambda fade: draws_summary(fade)
    )
    light_lost_without_noise = metric(
        template="light_lost_at_alarm_{way}_without_noise",
        value=lambda fade_without_noise: fade_without_noise,
    )
    false_alarms = metric(
        template="false_alarms_{statistic}_{summary}",
        value=lambda alarms, blocks: draws_summary(at_usual_noise(alarms) / blocks),
    )
    areas_of_all = metric(
        template="area_{statistic}_{summary}",
        value=lambda area: draws_summary(at_usual_noise(area).mean(["depth", "length"])),
    )

    @metric
    def areas_of_shallow(self, area: DataArray) -> dict[str, DataArray]:
        shallow = draws_summary(at_usual_noise(area).sel(depth=SHOWN_DEPTH))
        return {
            f"area_{name}_10pct_{1e3 * length:g}mm_{end}": shallow.sel(
                statistic=name, length=length, summary=end
            )
            for name in STATISTICS
            for length in LENGTHS
            for end in SUMMARY
        }

    delays_of_deep = metric(
        template="delay_{statistic}_40pct_1mm_{summary}_us",
        value=lambda delay: draws_summary(1e6 * _deep(at_usual_noise(delay))),
    )
    delays_without_noise = metric(
        template="delay_{statistic}_40pct_1mm_without_noise_us",
        value=lambda delay_without_noise: 1e6 * _deep(delay_without_noise),
    )
    missed_of_deep = metric(
        template="missed_{statistic}_40pct_1mm_{summary}",
        value=lambda missed: draws_summary(_deep(at_usual_noise(missed))),
    )

    claims = table(lambda answer: claims_in_words(residual_claims(answer)))

    @table
    def areas(self, area: DataArray) -> str:
        """Areas of all conditions."""
        heads = ["light taken", "length [mm]", "noise [um]", *figures.NAMES.values()]
        rows = draws_summary(area).stack(condition=("depth", "length", "noise"))
        cells = [
            [f"{depth:.0%}", f"{1e3 * length:g}", f"{1e6 * noise:.3g}", *_each(one)]
            for (depth, length, noise), one in zip(
                rows["condition"].values, rows.transpose("condition", ...), strict=True
            )
        ]
        return self._title("Area under the ROC curve") + markdown_table(heads, cells)

    @table
    def isolation(self, confusion: DataArray, fired: DataArray) -> str:
        """Confusion of the faults and how often each residual fired."""
        shares = confusion / confusion.sum("isolated_as")
        return "\n".join(
            self._title(title)
            + markdown_table(
                ["fault", *map(str, one[one.dims[-1]].values)],
                [
                    [str(row["fault"].values), *_each(row)]
                    for row in draws_summary(one).transpose("fault", ...)
                ],
            )
            for title, one in (
                ("Share of the faults taken for each", shares),
                ("Share at which each residual fired", fired),
            )
        )

    def _title(self, text: str) -> str:
        return f"{text}: mean, and the interval of 90 % of {self.draws} draws.\n\n"

    roc, area_ = figure(figures.curves), figure(figures.areas)


def _deep(values: DataArray) -> DataArray:
    """Values for defects that take 40 % of the light over 1 mm."""
    return values.sel(depth=0.4, length=1e-3, drop=True)


def _each(rows: DataArray) -> list[str]:
    """Mean and interval of each entry, in words."""
    return [interval_text(one, form="{:.2f}") for one in rows.transpose(..., "summary")]
