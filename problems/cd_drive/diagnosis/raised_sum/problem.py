"""Do white dots and jumped tracks raise the sum of the diodes (section 7.1.3)?

Section and equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Run, problem, ref
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import DataArray, Dataset
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
    metric,
    part,
    share_of_draws,
    table,
)
from workbench.study.draws import SURE

from ...drive.shared_parameters import TABLES
from ...drive.tables import AXES, drives
from ...laboratory.bench_setup import RATE
from ..defect_runs import SETTLING
from .figures import one_jump, sums_of_kinds
from .runs import BEFORE, DEFECTS, SHOWN, WHITE_DOT, Jump, Met, jump, meet, shaken


@problem(
    "cd/raised-sum",
    needs={"tracks": ref("cd/radial-error")},
    data=(*TABLES, "data/red_book.csv"),
)
def raised_sum(
    tracks: Run,
    draws: Annotated[int, Field(ge=1, le=1000)] = 12,
) -> RaisedSum:
    """The sum of the diodes in white dots, and while tracks are jumped (section 7.1.3).

    The reference controller follows discs that deviate by all the Red Book allows. A white dot is
    an area of the layer with shallow pits or none. A mirror's light is taken from
    `cd/radial-error`, and the radial error is assumed to be sensed in the dot as beside it. White
    dots and defects of each other kind pass on twelve drives and both axes. The binary detector
    reacts to missing light; the quality signal of equation 7.13 measures distances in either
    direction.

    A shock makes the radial loop jump tracks, or the loop withstands it. The focus sum is that of
    `cd/radial-error` at the position between the tracks, after the anti-aliasing filter.

    draws: number of draws of noise, defects and shocks, on each drive.
    """
    light = tracks.answer["light"].median(["width", "bits", "stagger"]).values
    return RaisedSum(np.asarray(light, float), draws)


@dataclass(frozen=True, eq=False)
class RaisedSum(Study):
    """Sums in defects and in jumps, over draws."""

    over_track: RealArray
    draws: int

    headline: ClassVar[str] = "sum_white_dot_mean"

    @property
    def quantifier(self) -> str:
        return f"for these 12 drives, in {self.draws} simulated draws"

    axis, kind = dim(AXES), dim(DEFECTS)
    drive = dim(lambda: [one.name for one in drives("focus")])
    shock = dim("stood", "jumping")
    draw = dim(lambda self: range(self.draws))
    place = dim(lambda self: np.linspace(-0.5, 0.5, len(self.over_track)), unit="pitch")
    light = array(
        dims=place, unit="1", meaning="light over a mirror's", value=lambda self: self.over_track
    )

    @array(dims=(draw, axis, drive))
    def seed(self, context: Context) -> Any:
        return independent_seeds(context.rng, self.draws, len(AXES), 12)

    @part
    def met(self, context: Context, seed: DataArray) -> RealArray:
        """A defect of every kind, by draw, axis and drive."""
        mirror = 1.0 / float(self.over_track[len(self.over_track) // 2])

        def one(place: tuple[int, ...]) -> Met:
            at = seed[place]
            return meet(AXES[place[1]], str(at["drive"].values), int(at), mirror)

        found = context.spread(one, list(np.ndindex(seed.shape)), "white dots")
        return np.reshape(np.array(found), (*seed.shape, len(Met._fields), len(DEFECTS)))

    @arrays((draw, axis, drive, kind), raised="1", by_binary="1", by_quality="1")
    def defects_met(self, met: RealArray) -> dict[str, RealArray]:
        """Sum in a defect, over that of the clean disc; and whether the detectors report it."""
        names = ("raised", "by_binary", "by_quality")
        return {name: met[..., n, :].astype("f4") for n, name in enumerate(names)}

    @part
    def jumps(self, context: Context, seed: DataArray) -> RealArray:
        """A shock that the loop withstands and one that it does not, by draw and drive."""
        every = seed.sel(axis="radial")

        def one(place: tuple[int, ...]) -> list[Jump]:
            at = every[place]
            name, number = str(at["drive"].values), int(at)
            return [jump(name, number, self.over_track, jumping) for jumping in (False, True)]

        found = context.spread(one, list(np.ndindex(every.shape)), "jumps")
        return np.reshape(np.array(found), (*every.shape, 2, len(Jump._fields)))

    @arrays((draw, drive, shock), tracks="1", sum_most="1", sum_mean="1")
    def jumped(self, jumps: RealArray) -> dict[str, RealArray]:
        """Number of tracks that pass; largest and mean focus sum, over that on the track."""
        names = ("tracks", "sum_most", "sum_mean")
        return {name: jumps[..., n].astype("f4") for n, name in enumerate(names)}

    time = dim(
        lambda: (np.arange(SHOWN) - BEFORE) / RATE, unit="s", meaning="time from the shock on"
    )

    @arrays((time,), shown_error="m", shown_sum="1")
    def record(self, seed: DataArray) -> dict[str, RealArray]:
        """One record of a jump: radial error, and focus sum over that on the track."""
        one = int(seed.sel(axis="radial")[0, 0])
        error, total = shaken("CD1", one, self.over_track, True)
        start = round(SETTLING * RATE) - BEFORE
        return {"shown_error": error[start:][:SHOWN], "shown_sum": total[start:][:SHOWN]}

    # --- checks ---------------------------------------------------------------------------------

    @check(at_most=1.0 - SURE)
    def white(self, raised: DataArray) -> float:
        """share of draws in which a white dot does not raise the sum"""
        return float(share_of_draws(raised.sel(kind=WHITE_DOT) <= 1.0))

    @check(at_most=1.0 - SURE)
    def dark(self, raised: DataArray) -> float:
        """share of draws in which a defect of another kind does not lower the sum"""
        return float(share_of_draws(raised.sel(kind=list(DEFECTS[1:])) >= 1.0))

    @check(at_most=1.0 - SURE)
    def jumps_raise(self, sum_mean: DataArray, tracks: DataArray) -> float:
        """share of draws in which tracks that pass do not raise the mean sum"""
        jumping = tracks.sel(shock="jumping") > 1.0
        return float(share_of_draws(jumping & ~(sum_mean.sel(shock="jumping") > 1.0)))

    # --- what is told ---------------------------------------------------------------------------

    sums = metric(
        template="sum_{kind}_{summary}", value=lambda raised: draws_summary(raised, "axis", "drive")
    )
    told = metric(
        template="told_by_binary_{kind}",
        value=lambda by_binary: by_binary.mean(["draw", "axis", "drive"]),
    )
    told_too = metric(
        template="told_by_quality_{kind}",
        value=lambda by_quality: by_quality.mean(["draw", "axis", "drive"]),
    )

    @metric
    def in_jumps(self, answer: Dataset) -> dict[str, float]:
        """Focus sum in jumps, and under a shock that the loop withstands."""
        numbers = {}
        for shock in answer["shock"].values.tolist():
            one = answer.sel(shock=shock)
            for name in ("sum_most", "sum_mean", "tracks"):
                for summary, value in zip(*_summary(one[name]), strict=True):
                    if np.isfinite(value):
                        numbers[f"{name}_{shock}_{summary}"] = value
            numbers[f"jumped_{shock}"] = float((one["tracks"] > 1.0).mean())
        return numbers

    @table
    def white_dots(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        """Every kind in both axes: the sum, and the detectors that report it."""
        heads = ["kind", "axis", "sum over the clean one", "told by binary", "told by quality"]
        rows = []
        for kind in DEFECTS:
            for axis in AXES:
                one = answer.sel(kind=kind, axis=axis)
                told = interval_text(draws_summary(one["raised"].mean("drive")), form="{:.2f}")
                shares = (f"{float(one[name].mean()):.0%}" for name in ("by_binary", "by_quality"))
                rows.append([kind, axis, told, *shares])
        return heads, rows

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Any]:
        return {"sums": sums_of_kinds(answer), "jump": one_jump(answer)}


def _summary(values: DataArray) -> tuple[list[str], list[float]]:
    told = draws_summary(values, "drive")
    return told["summary"].values.tolist(), told.values.tolist()
