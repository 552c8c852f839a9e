"""An ageing suspension: one controller for its whole life, or one for the values found at a start.

Section, equation and table numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import figures, problem
from workbench.executor import Context
from workbench.study import (
    LEAST_COVERAGE_P,
    Study,
    array,
    check,
    coverage_p,
    dim,
    figure,
    independent_seeds,
    metric,
    part,
    table,
)
from workbench.synthesis import PEAK_TOLERANCE
from workbench.types import DataArray, Dataset, Figure, RealArray
from workbench.uncertainty import GeneralisedPlant

from ...drive.plants import controller
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from ...laboratory.experiment import Laboratory
from ...laboratory.known_values import CONFIDENCE
from .sets import AGEING, Design, aged_model, all_known, designed, life, narrowed, peak_of, plant_of
from .start import StartUp, Suspension

SOFTENINGS = (1.0, 0.75, 0.5)
"""Spring and damper of the suspension at the end of its life, relative to those of the new one."""
SETS = ("life", "found", "known")
"""Plants assumed to be possible: all drives from new to the end of life; a drive at the end of its
life, within the intervals found at a start; and the nominal drive with nothing uncertain.
"""
CONTROLLERS = ("reference", *SETS)
"""The reference controller, and the best one for each set."""


@problem("cd/{axis}/ageing", slow=True, axis=("focus", "radial"), data=TABLES)
def ageing(
    axis: Axis, design: Design = "fixed", draws: Annotated[int, Field(ge=1, le=1000)] = 12
) -> Ageing:
    """What an estimate of the ageing suspension at each start gains in robust performance.

    Section 7.1.1. The softening of the suspension is assumed: k1 and b1 fall together to 75 % or 50
    % of those of the new drive, or stay. At a start, the open-loop experiment on the coil finds k
    and b of the nominal drive at the end of its life. k1 and b1 follow from them with 99 %
    intervals, which include the errors of the told values. One controller is made for the whole
    life of every drive, another for the values found at the start of the first draw. R and k2 have
    the tolerances of Table 5.3 for both; the gain control takes care of the gain. The controllers
    are compared by the certified peak of mu of robust performance, each on both sets of plants, and
    with a controller for which nothing is uncertain. Every set takes the best of all controllers
    made, since each search ends in a local minimum.

    design: "fixed", third order from the reference controller; or "dk", of full order, slow. draws:
    number of draws of the noise and of the told values.
    """
    return Ageing(axis, design, draws)


@dataclass(frozen=True)
class Ageing(Study):
    """Starts with a softened suspension, and controllers for three sets of plants."""

    axis: Axis
    design: Design
    draws: int

    headline: ClassVar[str] = "gain_50_percent"

    @property
    def quantifier(self) -> str:
        return "for these controllers and sets of plants"

    softening, parameter = dim(SOFTENINGS), dim(AGEING)
    plants, judged, bound = dim(CONTROLLERS), dim(SETS), dim("lower", "upper")
    end = dim("low", "high")
    draw = dim(lambda self: range(self.draws))

    @array(dims=(softening, draw))
    def seed(self, context: Context) -> Any:
        return independent_seeds(context.rng, len(SOFTENINGS), self.draws)

    @part
    def starts(self, context: Context, seed: DataArray) -> list[list[Suspension]]:
        """Values that every start finds, by softening and draw."""
        found = []
        for n, softening in enumerate(SOFTENINGS):
            start = StartUp(self.axis, softening)
            first, *others = seed.values[n].tolist()
            own = [start.found(first)]  # computes the signals that all draws share
            found.append([*own, *(start.found(one) for one in context.track(others, "starts"))])
        return found

    found = array(dims=(softening, draw, parameter), unit="", meaning="as found")(
        lambda starts: [[(one.k1, one.b1) for one in row] for row in starts]
    )
    half_width = array(
        dims=(softening, draw, parameter), unit="1", meaning="of the 99 % interval, relative"
    )(lambda starts: [[(one.k1_off, one.b1_off) for one in row] for row in starts])

    @array(dims=(softening, parameter))
    def truth(self) -> list[list[float]]:
        """Of the nominal drive at the end of its life."""
        benches = [Laboratory(self.axis, "nominal", suspension=one) for one in SOFTENINGS]
        return [[getattr(one.parameters, name) for name in AGEING] for one in benches]

    @part
    def sets(self, starts: list[list[Suspension]]) -> list[list[GeneralisedPlant]]:
        """Plants of every softening and set."""
        every = []
        for softening, row in zip(SOFTENINGS, starts, strict=True):
            whole = life(self.axis, softening)
            models = [
                aged_model(self.axis, whole),
                aged_model(self.axis, narrowed(whole, row[0])),
                all_known(self.axis, softening),
            ]
            every.append([plant_of(self.axis, one) for one in models])
        return every

    @array(
        dims=(softening, "set", parameter, end),
        unit="",
        meaning="ranges of the sets that are uncertain",
    )
    def ranges(self, starts: list[list[Suspension]]) -> list[Any]:
        """Ranges over a life, and as found at a start."""
        told = []
        for softening, row in zip(SOFTENINGS, starts, strict=True):
            whole = life(self.axis, softening)
            told.append([list(one.values()) for one in (whole, narrowed(whole, row[0]))])
        return told

    @part
    def judged_all(self, sets: list[list[GeneralisedPlant]], context: Context) -> RealArray:
        """Bounds on the peak of every controller (1 + softenings * sets) on every set.

        (controllers, softenings, sets, 2); the reference controller is the first.
        """
        import control

        plants = [plant for row in sets for plant in row]
        made = [
            designed(self.axis, plant, self.design, context.options)
            for plant in context.track(plants, "controllers")
        ]
        pool = [control.ss(controller(self.axis)), *made]
        found = [[peak_of(plant, K) for plant in plants] for K in context.track(pool, "peaks")]
        return np.reshape(found, (len(pool), len(SOFTENINGS), len(SETS), 2))

    @array(
        dims=(softening, plants, judged, bound),
        unit="1",
        meaning="certified bounds on the peak of mu",
    )
    def peak(self, judged_all: RealArray) -> RealArray:
        """A set's controller is the one with the least peak on that set, of all controllers made.

        The search for a controller ends in one of several local minima, so one made for another set
        may be better.
        """
        found = np.empty((len(SOFTENINGS), len(CONTROLLERS), len(SETS), 2))
        best = judged_all[..., 1].argmin(axis=0)
        for n in range(len(SOFTENINGS)):
            for m, which in enumerate([0, *best[n]]):
                found[n, m] = judged_all[which, n]
        return found

    # --- checks -------------------------------------------------------------------------------

    covered_ = check(
        title="intervals of {parameter}",
        statement="1 - probability that 99 % intervals hold the truth in no more starts than here, "
        "any softening",
        value=lambda answer: 1.0 - coverage_p(_covers_truth(answer), CONFIDENCE),
        each="parameter",
        at_most=1.0 - LEAST_COVERAGE_P,
    )
    bounds = check(
        title="bounds",
        statement="largest lower over upper bound of a peak, less 1",
        value=lambda peak: (peak.sel(bound="lower") / peak.sel(bound="upper") - 1).max(),
        at_most=0.0,
    )
    smaller = check(
        title="smaller sets",
        statement="lower bound on a smaller set over the upper one on a larger set, less 1",
        value=lambda peak: (
            peak.sel(bound="lower", judged="found") / peak.sel(bound="upper", judged="life") - 1
        ).max(),
        at_most=PEAK_TOLERANCE,
    )
    best = check(
        title="chosen for it",
        statement="peak of the controller chosen for a set over the least of the others on it, "
        "less 1",
        value=lambda peak: _excess_over_others(peak),
        at_most=PEAK_TOLERANCE,
    )

    # --- what is told -------------------------------------------------------------------------

    @metric
    def numbers(self, answer: Dataset) -> dict[str, float]:
        """Peaks, and gains: 1 minus the quotient of two peaks."""
        told, upper = {}, answer["peak"].sel(bound="upper")
        for softening in SOFTENINGS:
            name, one = f"{100 * softening:.0f}_percent", upper.sel(softening=softening)

            def at(plants: str, judged: str, one: DataArray = one) -> float:
                return float(one.sel(plants=plants, judged=judged))

            for plants in CONTROLLERS:
                for judged in SETS:
                    told[f"peak_{plants}_on_{judged}_{name}"] = at(plants, judged)
            told[f"gain_{name}"] = 1.0 - at("found", "found") / at("life", "found")
            told[f"gain_of_guarantee_{name}"] = 1.0 - at("found", "found") / at("life", "life")
            told[f"most_gain_{name}"] = 1.0 - at("known", "known") / at("life", "life")
            for parameter in AGEING:
                half = answer["half_width"].sel(softening=softening, parameter=parameter)
                told[f"half_width_{parameter}_{name}"] = float(half.mean())
        return told

    covered = metric(
        template="covered_{parameter}",
        value=lambda answer: _covers_truth(answer).mean(["draw", "softening"]),
    )

    @table
    def peaks(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        """Certified upper bounds of the peaks of mu."""
        upper, rows = answer["peak"].sel(bound="upper"), []
        for softening in SOFTENINGS:
            for plants in CONTROLLERS:
                one = upper.sel(softening=softening, plants=plants)
                cells = [f"{float(one.sel(judged=judged)):.4f}" for judged in SETS]
                rows.append([f"{softening:.0%}", plants, *cells])
        heads = ["suspension", "controller for", "on a life", "as found", "all known"]
        return heads, rows

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        """Peaks of mu over the softening of the suspension."""
        drawn, panels = figures.axes(1, 2, size=(9.0, 3.8), sharey=True)
        upper = answer["peak"].sel(bound="upper")
        looks = dict(
            zip(
                CONTROLLERS,
                (figures.BLACK, figures.BLUE, figures.ORANGE, figures.GREEN),
                strict=True,
            )
        )
        across = 100 * np.array(SOFTENINGS)
        words = {"life": "whole life", "found": "what is found", "known": "all known"}
        for panel, judged in zip(panels, ("life", "found"), strict=True):
            for plants, color in looks.items():
                if plants == "found" and judged == "life":
                    continue
                name = f"for {words[plants]}" if plants in words else "eq. 6.12 and its like"
                value = upper.sel(plants=plants, judged=judged).values
                panel.plot(across, value, "o-", color=color, markersize=4, label=name)
            figures.label(
                panel,
                x="suspension at the end of life [%]",
                title=f"{self.axis}, on {words[judged]}",
            )
        figures.label(panels[0], y="certified peak of mu [1]")
        figures.legend_below(drawn, panels[1])
        return {"ageing": drawn}


def _covers_truth(answer: Dataset) -> DataArray:
    """Whether an interval (softening, draw, parameter) holds the truth."""
    return abs(answer["found"] - answer["truth"]) <= answer["half_width"] * answer["found"]


def _excess_over_others(peak: DataArray) -> float:
    """Largest excess of the peak of a set's controller over the peak of another controller on the
    set.
    """
    upper = peak.sel(bound="upper")
    found = [
        upper.sel(plants=name, judged=name) / upper.sel(judged=name).min("plants") - 1
        for name in SETS
    ]
    return max(float(one.max()) for one in found)
