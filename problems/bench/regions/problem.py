"""Regions of responses from records, judged on plants whose true responses are known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, figures, problem
from workbench.executor import Context
from workbench.study import Study, array, check, dim, figure, metric, part, table
from workbench.types import DataArray, Figure, RealArray

from .covers import BANDS, LENGTHS, heater_draw
from .design import Case, cases
from .judged import THIRDS, judged, records
from .yardsticks import narrowest, output_error_width

LEAST_COVERAGE, LEAST_END = 0.93, 0.88
"""Least coverage over all cases; and for a third of a case's band the least upper end of its 99 %
interval.
"""
LARGEST_WIDTH = 1.5
"""Largest accepted width of a case, over that of the narrowest setting that keeps its coverage."""
LEAST_HELD = 184 / 200
"""Least share of draws in which a cover contains all plants at once."""
FREQUENCIES = 40
"""Number of frequencies at which each record's regions are asked for."""
COMPARED = 12
"""Number of records of a case on which settings are compared."""


@problem("bench/regions", slow=True)
def regions(
    records: Annotated[int, Field(ge=2, le=2000)] = 300,
    draws: Annotated[int, Field(ge=1, le=1000)] = 200,
    every: Annotated[int, Field(ge=1, le=20)] = 1,
) -> Regions:
    """Do the 95 % regions of responses from records hold the true plants, and how wide are they?

    The plants have lags, dead time, resonances, an integrator, a zero in the right half plane,
    friction or two inputs. There are six kinds of excitation, two lengths, noise of 20 to 60 dB and
    converters of 12 bits. Widths are compared with the narrowest setting of the library's local
    polynomials and local rational functions that keeps its coverage, chosen with knowledge of the
    truth. Covers are those of six heaters.

    records: of each case, all with seeds of their own.
    draws: of six heaters' records, each with a cover.
    every: takes each so-manieth case only, for a quick look.
    """
    return Regions(records, draws, every)


@dataclass(frozen=True, eq=False)
class Regions(Study):
    """Coverage and widths of regions on all cases, and of covers of heaters."""

    records: int
    draws: int
    every: int

    headline: ClassVar[str] = "coverage"

    @property
    def quantifier(self) -> str:
        return f"for {self.records} records of each of {len(self._cases)} cases"

    @property
    def _cases(self) -> list[Case]:
        return cases()[:: self.every]

    case = dim(lambda self: [case.name for case in self._cases])
    third, end = dim(*[f"third {k + 1}" for k in range(THIRDS)]), dim("mean", "upper")
    length, band = dim(*LENGTHS), dim(lambda: np.arange(BANDS))
    draw, kind = dim(lambda self: np.arange(self.draws)), dim("today", "local polynomials")

    @part
    def found(self, context: Context) -> list[tuple[RealArray, float, float, float]]:
        """For each case: thirds (THIRDS, 2), our width, the narrowest width, and that of output
        error.
        """
        seed = int(context.rng.integers(2**31))
        answers = []
        for case in context.track(self._cases, "cases"):
            made = records(case, self.records, seed)
            ours = judged(case, made, FREQUENCIES)
            some = tuple(x[:COMPARED] for x in made)
            best, _ = narrowest(case, (some[0], some[1], some[2]), ours)
            error = output_error_width(case, made[0][0, 0], float(made[2][0]), ours)
            answers.append((np.array(ours.thirds()), ours.width, best, error))
        return answers

    coverage = array(
        dims=(case, third, end), unit="1", meaning="share of regions that hold the truth"
    )(lambda found: np.array([one[0] for one in found]))
    width = array(dims=case, unit="1", meaning="median radius over the response")(
        lambda found: np.array([one[1] for one in found])
    )
    narrowest_width = array(
        dims=case, unit="1", meaning="that of the narrowest setting that keeps its coverage"
    )(lambda found: np.array([one[2] for one in found]))
    output_error = array(dims=case, unit="1", meaning="that of output error of the true order")(
        lambda found: np.array([one[3] for one in found])
    )

    @part
    def heated(self, context: Context) -> list[list[tuple[bool, RealArray, RealArray]]]:
        """For each length and draw the answer of `heater_draw`."""
        seed = int(context.rng.integers(2**31))
        return [
            [heater_draw(length, k, seed) for k in context.track(range(self.draws), length)]
            for length in LENGTHS
        ]

    held = array(
        dims=(length, draw), unit="1", meaning="1 for a cover that holds all plants at once"
    )(lambda heated: np.array([[float(one[0]) for one in row] for row in heated]))
    outside = array(
        dims=(length, kind, band), unit="1", meaning="share of points outside the 95 % regions"
    )(
        lambda heated: np.array(
            [[np.mean([one[k] for one in row], axis=0) for k in (1, 2)] for row in heated]
        )
    )

    # --- checks -------------------------------------------------------------------------------

    @check()
    def promises(self, coverage: DataArray, held: DataArray) -> list[Check]:
        mean = coverage.sel(end="mean")
        return [
            Check(
                "coverage",
                f"{LEAST_COVERAGE} less the share of regions that hold the truth",
                LEAST_COVERAGE - float(mean.mean()),
                0.0,
            ),
            Check(
                "thirds of bands",
                f"{LEAST_END} less the least upper end of a 99 % interval",
                LEAST_END - float(coverage.sel(end="upper").min()),
                0.0,
            ),
            Check(
                "covers",
                f"{LEAST_HELD} less the share of covers that hold all plants at once",
                LEAST_HELD - float(held.mean("draw").min()),
                0.0,
            ),
        ]

    @check()
    def narrow(self, width: DataArray, narrowest_width: DataArray) -> list[Check]:
        over = (width / narrowest_width).max()
        return [Check("width", "largest over the narrowest", float(over), LARGEST_WIDTH)]

    # --- what is told -------------------------------------------------------------------------

    @metric
    def numbers(
        self,
        coverage: DataArray,
        held: DataArray,
        width: DataArray,
        narrowest_width: DataArray,
        output_error: DataArray,
    ) -> dict[str, float]:
        """Shares and ratios of widths; a case in which no setting keeps its coverage has the ratio
        0.
        """
        over = width / narrowest_width
        return {
            "coverage": float(coverage.sel(end="mean").mean()),
            "least_third": float(coverage.sel(end="mean").min()),
            "thirds_below": float((coverage.sel(end="upper") < LEAST_END).sum()),
            "covers_held_30": float(held.sel(length=LENGTHS[0]).mean()),
            "covers_held_18": float(held.sel(length=LENGTHS[1]).mean()),
            "width_over_narrowest": float(over.median()),
            "largest_width_over_narrowest": float(over.max()),
            "cases_wider": float((over > LARGEST_WIDTH).sum()),
            "cases_without_setting": float(np.isinf(narrowest_width).sum()),
            "width_over_output_error": float((width / output_error).median()),
        }

    @table
    def each(
        self,
        coverage: DataArray,
        width: DataArray,
        narrowest_width: DataArray,
        output_error: DataArray,
    ) -> tuple[list[str], list[list[str]]]:
        rows = []
        for name in coverage["case"].values:
            thirds = coverage.sel(case=name, end="mean").values
            one = float(width.sel(case=name))
            ratios = [one / float(x.sel(case=name)) for x in (narrowest_width, output_error)]
            rows.append(
                [str(name), *(f"{x:.3f}" for x in thirds), f"{one:.3g}"]
                + [f"{x:.2f}" if np.isfinite(x) else "-" for x in ratios]
            )
        heads = ["case", *(f"third {k + 1}" for k in range(THIRDS)), "width"]
        return [*heads, "over narrowest", "over output error"], rows

    @table
    def heaters(self, outside: DataArray, held: DataArray) -> tuple[list[str], list[list[str]]]:
        rows = []
        for length in LENGTHS:
            share = f"{float(held.sel(length=length).mean()):.3f}"
            for kind in outside["kind"].values:
                bands = outside.sel(length=length, kind=kind).values
                rows.append([length, str(kind), *(f"{x:.3f}" for x in bands), share])
        return ["records", "regions", *(f"outside {k + 1}" for k in range(BANDS)), "held"], rows

    @figure
    def coverages(
        self, coverage: DataArray, width: DataArray, narrowest_width: DataArray
    ) -> Figure:
        plot, (left, right) = figures.axes(1, 2, size=(11.0, 0.17 * len(width) + 2.0))
        place = np.arange(len(width))
        for number, third in enumerate(coverage["third"].values):
            shares = coverage.sel(end="mean", third=third)
            left.plot(shares, place, "o|x"[number], markersize=5, label=str(third))
        left.axvline(LEAST_COVERAGE, color="k", linewidth=0.8)
        left.set_yticks(place, [str(name) for name in coverage["case"].values], fontsize=6.5)
        figures.label(left, x="share of regions that hold the truth")
        left.legend(loc="lower left")
        over = (width / narrowest_width).values
        right.plot(np.where(over > 0, over, np.nan), place, "o", markersize=4)
        right.axvline(LARGEST_WIDTH, color="k", linewidth=0.8)
        right.set_yticks(place, [])
        figures.label(right, x="width over that of the narrowest setting")
        return plot
