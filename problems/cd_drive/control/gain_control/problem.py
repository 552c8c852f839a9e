"""Differences of the drives' gains, and the gain control that removes them (section 4.4).

Section and table numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players
(2003).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import problem
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
)
from workbench.study.draws import SURE

from ...drive.plants import crossover
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis, drives
from ...laboratory.experiment import Laboratory
from .figures import levels, spreads
from .runs import ARMS, END, START, STEPS, WITHIN, Start, crossover_of, level_of, started

CLAIMED = "ordinary"
"""The disc on which the statement of section 4.4 is checked."""
REMOVED = 1 / 3
"""Largest spread of the loop gains, over that before, that counts as removed."""
LATEST = 1.5
"""Largest accepted time [s] to adjust a gain."""
EXACT = 0.1
"""Largest accepted error of the level [dB] without noise and without a turning disc."""
LOW = 100.0
"""A frequency [Hz] far below crossover at which the loop gains are compared, too."""
GRID = np.geomspace(300.0, 2000.0, 400)
"""Frequencies [Hz] between which a crossover is found."""


@problem(
    "cd/{axis}/gain-control",
    slow=True,
    axis=("focus", "radial"),
    data=(*TABLES, "data/red_book.csv"),
)
def gain_control(axis: Axis, draws: Annotated[int, Field(ge=1, le=1000)] = 12) -> GainControl:
    """Automatic gain control of the twelve drives by a wobble at crossover (section 4.4).

    A sine with twice the noise's size, at the nominal crossover frequency, is added to the error
    while the loop is closed. Synchronous detection before and behind this point measures |L| there,
    and a gain in front of the controller is adjusted, with a time constant of 0.2 s, until |L| is
    1. Every drive starts with the gain of its own optics, coil and masses. The spread of |L| over
    the drives before and after, and the time needed, are found on a disc at rest, one that deviates
    by a fifth of what the Red Book allows, one that deviates by all of it, one with a scratch of
    1.2 mm in every turn, and one that reflects half of the light.

    draws: number of draws of the noise, on each drive and disc.
    """
    return GainControl(axis, draws)


@dataclass(frozen=True)
class GainControl(Study):
    """Starts of twelve drives on several discs."""

    axis: Axis
    draws: int

    headline: ClassVar[str] = "spread_ordinary_mean"

    @property
    def quantifier(self) -> str:
        return f"for these 12 drives, in {self.draws} simulated draws on each"

    drive = dim(lambda self: [one.name for one in drives(self.axis)])
    arm = dim(ARMS)
    draw = dim(lambda self: range(self.draws))
    time = dim(lambda: np.linspace(0.0, END - START, STEPS + 1), unit="s", meaning="time")

    @array(dims=(drive, draw))
    def seed(self, context: Context) -> Any:
        return independent_seeds(context.rng, 12, self.draws)

    @part
    def benches(self, drive: DataArray) -> list[Laboratory]:
        return [Laboratory(self.axis, name) for name in drive.values.tolist()]

    @part
    def starts(self, context: Context, seed: DataArray, benches: list[Laboratory]) -> list[Start]:
        """Starts in the order of arm, drive, draw."""
        arms = list(ARMS.values())

        def played(place: tuple[int, ...]) -> Start:
            which, n, k = place
            return started(benches[n], arms[which], int(seed.values[n, k]))

        return context.spread(played, list(np.ndindex(len(arms), *seed.shape)), "starts")

    def _every(self, starts: list[Start], name: str) -> Any:
        found = np.array([getattr(one, name) for one in starts])
        return found.reshape(len(ARMS), 12, self.draws, *found.shape[1:])

    # --- arrays -------------------------------------------------------------------------------

    before = array(dims=drive, unit="dB", meaning="|L| at the wobble before")(
        lambda benches: [level_of(one) for one in benches]
    )
    low_before = array(dims=drive, unit="dB", meaning="|L| at 100 Hz before")(
        lambda benches: [level_of(one, LOW) for one in benches]
    )
    crossover_before = array(dims=drive, unit="Hz", meaning="crossover before")(
        lambda benches: [crossover_of(one, 0.0, GRID) for one in benches]
    )
    after = array(dims=(arm, drive, draw), unit="dB", meaning="|L| at the wobble after")(
        lambda self, starts: self._every(starts, "level")[..., -1]
    )
    settled = array(dims=(arm, drive, draw), unit="s", meaning="time that it takes")(
        lambda self, starts: self._every(starts, "settled")
    )
    events = array(
        dims=(arm, drive, draw), unit="", meaning="times that the loop was lost or regained"
    )(lambda self, starts: self._every(starts, "events"))
    level = array(dims=(arm, drive, time), unit="dB", meaning="|L| at the wobble, first draw")(
        lambda self, starts: self._every(starts, "level")[:, :, 0].astype("f4")
    )

    @array(dims=(arm, drive, draw), unit="Hz", meaning="crossover after")
    def crossover_after(
        self, benches: list[Laboratory], after: DataArray, before: DataArray
    ) -> RealArray:
        changed = (after - before).transpose("arm", "drive", "draw").values
        return np.array(
            [
                [
                    [crossover_of(one, gain, GRID) for gain in row]
                    for one, row in zip(benches, rows, strict=True)
                ]
                for rows in changed
            ]
        )

    @array(
        dims=drive,
        unit="dB",
        meaning="|L| at the wobble after, without noise, on a disc that stands",
    )
    def quiet(self, benches: list[Laboratory]) -> list[float]:
        silent = [replace(one, noise=0.0, electronics=0.0, bits=None) for one in benches]
        return [float(started(one, ARMS["still"], 0).level[-1]) for one in silent]

    # --- checks -------------------------------------------------------------------------------

    exact = check(
        title="detection",
        statement="level that the gain control leaves without noise and disc [dB]",
        value=lambda quiet: abs(quiet),
        at_most=EXACT,
    )
    kept = check(
        title="the loop holds",
        statement="times that the loop was lost or regained on an ordinary disc, any draw",
        value=lambda events: events.sel(arm=CLAIMED),
        at_most=0.0,
    )
    removed = check(
        title="differences are removed",
        statement="share of draws whose spread over the drives is above a third of that before, "
        "ordinary",
        value=lambda before, after: (
            1.0 - (_spread(after.sel(arm=CLAIMED)) <= REMOVED * _spread(before)).mean("draw")
        ),
        at_most=1.0 - SURE,
    )
    set_ = check(
        title="gain is set",
        statement="share of starts that leave |L| more than 1 dB off, ordinary disc",
        value=lambda after: 1.0 - share_of_draws(abs(after.sel(arm=CLAIMED)) <= WITHIN),
        at_most=1.0 - SURE,
    )
    soon = check(
        title="gain is set in time",
        statement="share of starts that take longer than 1.5 s, ordinary disc",
        value=lambda settled: 1.0 - share_of_draws(settled.sel(arm=CLAIMED) <= LATEST),
        at_most=1.0 - SURE,
    )

    # --- what is told -------------------------------------------------------------------------

    wobble_hz = metric(lambda self: crossover(self.axis))
    spread_before = metric(lambda before: _spread(before))
    spread_after = metric(
        template="spread_{arm}_{summary}", value=lambda after: draws_summary(_spread(after))
    )
    low_spread_before = metric(lambda low_before: _spread(low_before))
    low_spread_after = metric(
        template="low_spread_{arm}_{summary}",
        value=lambda low_before, after, before: draws_summary(_spread(low_before + after - before)),
    )
    crossover_spread_before = metric(lambda crossover_before: _spread(crossover_before))
    crossover_spread_after = metric(
        template="crossover_spread_{arm}_{summary}",
        value=lambda crossover_after: draws_summary(_spread(crossover_after)),
    )
    removed_share = metric(
        template="removed_{arm}",
        value=lambda before, after: (_spread(after) <= REMOVED * _spread(before)).mean("draw"),
    )
    set_share = metric(
        template="set_{arm}", value=lambda after: share_of_draws(abs(after) <= WITHIN, "arm")
    )
    error_db = metric(
        template="error_db_{arm}_{summary}", value=lambda after: draws_summary(after, "drive")
    )
    time_s = metric(
        template="time_{arm}_{summary}", value=lambda settled: draws_summary(settled, "drive")
    )
    in_time = metric(
        template="in_time_{arm}", value=lambda settled: share_of_draws(settled <= LATEST, "arm")
    )
    lost = metric("lost_{arm}", value=lambda events: share_of_draws(events > 0, "arm"))

    @table
    def spread(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        """Spread before, and on each disc after: mean and 90 % range of the draws."""
        before = [_spread(answer[name]) for name in ("before", "low_before", "crossover_before")]
        first = [f"{float(one):.2f}" for one in before[:2]] + [f"{float(before[2]):.0f}"]
        rows = [["before", *first, "", "", ""]]
        low = answer["low_before"] + answer["after"] - answer["before"]
        for arm in ARMS:
            cells = [
                interval_text(draws_summary(_spread(one.sel(arm=arm))), form=form)
                for one, form in (
                    (answer["after"], "{:.2f}"),
                    (low, "{:.2f}"),
                    (answer["crossover_after"], "{:.0f}"),
                )
            ]
            settled, after = answer["settled"].sel(arm=arm), answer["after"].sel(arm=arm)
            cells += [
                interval_text(draws_summary(settled, "drive"), form="{:.2f}"),
                f"{float((abs(after) <= WITHIN).mean()):.0%}",
                f"{float((answer['events'].sel(arm=arm) > 0).mean()):.0%}",
            ]
            rows.append([f"after, {arm.replace('_', ' ')} disc", *cells])
        heads = ["", "spread at the wobble [dB]", "at 100 Hz [dB]", "of the crossover [Hz]"]
        return [*heads, "takes [s]", "within 1 dB", "loop lost"], rows

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        return {"levels": levels(answer, self.axis), "spread": spreads(answer, self.axis)}


def _spread(values: DataArray) -> DataArray:
    """Largest minus smallest value over the drives."""
    return values.max("drive") - values.min("drive")
