"""A loop is lost, and recovers: how long until the data are back, and by which cause (section
2.5.1)?

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import problem
from workbench.executor import Context
from workbench.study import (
    CLAIM_SHARE,
    Study,
    array,
    arrays,
    check,
    dim,
    figure,
    independent_seeds,
    metric,
    part,
    table,
)
from workbench.types import DataArray, Dataset, RealArray

from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis, drives
from .causes import CAUSES
from .figures import one_recovery, times_by_cause
from .report import times_told, told_by_cause
from .runs import Recovered, Recovery, thinned
from .times import least_search, way_back

PATIENCES = {"focus": (0.5e-3, 2.5e-3, 10e-3, 40e-3), "radial": (0.0,)}
"""Times [s] in the dark after which the focus counts as lost. Radially no search is begun."""
SHOWN = ("shock", "dark patch")
"""Causes that the figure of one run shows."""
EXAMPLE = "dark patch"
"""Cause that is replayed with finer optics."""
QUIET: dict[str, Any] = {"noise": 0.0, "electronics": 0.0, "bits": None}
"""A laboratory without noise, whose converters do not round."""
THIN = 100
"""Number of samples between those of a record that figures show."""


@problem("cd/{axis}/recovery", axis=("focus", "radial"), data=(*TABLES, "data/red_book.csv"))
def recovery(
    axis: Axis,
    speed: Annotated[float, Field(gt=0, le=40e-3)] = 5e-3,
    draws: Annotated[int, Field(ge=1, le=1000)] = 2,
) -> RecoveryStudy:
    """A loop is lost by a shock or a defect: how long until the data are back (section 2.5.1)?

    In the dark the controller reads an error of 0. Focus: if it stays dark for longer than a
    patience, the focus counts as lost, and the search of `cd/focus/start-up` begins. Radial: the
    controller catches a track by itself; the place is read from the subcode, and jumps lead back.

    Assumed: sizes of shocks and defects, a disc with a tenth of the Red Book's deviations, and that
    jumps land inwards as outwards; that the spindle keeps its speed, and that the radial loop
    catches its track at once when the focus is back. Computed: the least time of a search from rest
    for each drive. Simulated: shares and times over all drives and draws.

    speed: speed of the searching lens [m/s]. draws: number of draws of the disc's angle and of
    noise, for every drive and cause.
    """
    return RecoveryStudy(axis, speed, draws)


@dataclass(frozen=True)
class RecoveryStudy(Study):
    """Losses by every cause, on every drive, and the times until the data are back."""

    axis: Axis
    speed: float
    draws: int

    headline: ClassVar[str] = "back_shock_median_s"

    @property
    def quantifier(self) -> str:
        return f"for these 12 drives, in {self.draws} simulated draws of each cause"

    cause = dim(CAUSES)
    patience = dim(lambda self: PATIENCES[self.axis], unit="s")
    drive = dim(lambda self: [one.name for one in drives(self.axis)])
    draw = dim(lambda self: range(self.draws))

    seed = array(
        dims=(drive, draw),
        value=lambda self, context: independent_seeds(context.rng, 12, self.draws),
    )

    @part
    def met(self, context: Context, seed: DataArray) -> RealArray:
        """Recoveries (causes, patiences, drives, draws, 5)."""

        def one(place: tuple[int, ...]) -> list[Recovered]:
            name, number = str(seed[place]["drive"].values), int(seed[place])
            return [
                Recovery(self.axis, patience, self.speed).recovered(name, cause, number)
                for cause in CAUSES
                for patience in PATIENCES[self.axis]
            ]

        found = context.spread(one, list(np.ndindex(seed.shape)), "losses")
        shape = (*seed.shape, len(CAUSES), len(PATIENCES[self.axis]), len(Recovered._fields))
        return np.moveaxis(np.reshape(found, shape), (0, 1), (2, 3))

    told = arrays(
        (cause, patience, drive, draw),
        lambda met: {name: met[..., n].astype("f4") for n, name in enumerate(Recovered._fields)},
        lost=("1", "whether focus or track is lost"),
        away=("1", "tracks from the own one to the one where the loop ends"),
        searches=("1", "number of searches"),
        detected=("s", "time from the cause to the first search"),
        back=("s", "time from the cause until the error stays acceptable"),
    )

    @array(dims=(cause, drive, draw), unit="s", meaning="from the capture to the own track")
    def home(self, away: DataArray, seed: DataArray, context: Context) -> RealArray:
        tracks = np.moveaxis(away.isel(patience=0).values, 0, -1)

        def one(place: tuple[int, ...]) -> list[float]:
            name, number = str(seed[place]["drive"].values), int(seed[place])
            return [way_back(name, round(float(n)), number) for n in tracks[place]]

        found = context.spread(one, list(np.ndindex(seed.shape)), "ways back")
        return np.moveaxis(np.reshape(found, (*seed.shape, len(CAUSES))), -1, 0).astype("f4")

    @array(dims=drive, unit="s", meaning="least time of a search; 0 where there is none")
    def least(self, drive: DataArray) -> list[float]:
        if self.axis == "radial":
            return [0.0] * drive.size
        return [least_search(str(one), self.speed) for one in drive.values]

    @array(dims=drive, unit="s", meaning="change of a recovery by optics followed twice as finely")
    def finer(self, drive: DataArray) -> list[float]:
        one = Recovery(self.axis, PATIENCES[self.axis][-1], self.speed)
        times = [
            [one.recovered(str(name), EXAMPLE, 0, refine=n, **QUIET).back for n in (1, 2)]
            for name in drive.values
        ]
        return [abs(fine - coarse) for coarse, fine in times]

    moment = dim(lambda one_run: one_run[0], unit="s", meaning="time from the cause")
    shown_cause = dim(SHOWN)
    shown = arrays(
        (shown_cause, moment),
        lambda one_run: dict(zip(("shown_error", "shown_sum", "shown_u"), one_run[1], strict=True)),
        shown_error=("m", "true error"),
        shown_sum=("1", "sum over its largest value"),
        shown_u=("V", "control voltage"),
    )

    @part
    def one_run(self) -> tuple[RealArray, RealArray]:
        """Time [s], and error, sum and voltage (3, causes, samples) of runs on CD1."""
        patience = PATIENCES[self.axis][len(PATIENCES[self.axis]) // 2]
        one = Recovery(self.axis, patience, self.speed)
        records = [thinned(one.record("CD1", name, 1), THIN) for name in SHOWN]
        return records[0][0], np.array([row[1] for row in records]).swapaxes(0, 1)

    # --- checks -------------------------------------------------------------------------------

    @check(title="weak shocks", at_most=0.0)
    def stood(self, lost: DataArray) -> float:
        """share of shocks of half the acceptable size that lose the loop"""
        return float(lost.sel(cause="weak shock").mean())

    @check(title="bursts", at_most=1.0 - CLAIM_SHARE)
    def patient(self, searches: DataArray) -> float:
        """share of bursts that start a search, with a patience longer than the longest burst"""
        patience = searches["patience"].values
        long = searches.sel(cause="burst", patience=patience[patience != PATIENCES["focus"][0]])
        return float((long > 0).mean())

    @check(title="least time", at_most=0.02)
    def not_faster(self, back: DataArray, detected: DataArray, least: DataArray) -> float:
        """by which share a search after a defect, from a lens at rest, ends sooner than it can"""
        defects = [name for name, one in CAUSES.items() if one.length]
        taken = (back - detected).where(detected.notnull()).sel(cause=defects)
        return float((least / taken - 1.0).max().fillna(-1.0))

    @check(title="back", at_most=1.0 - CLAIM_SHARE)
    def comes_back(self, back: DataArray) -> float:
        """share of causes after which the error never stays acceptable within the run"""
        return float(back.isnull().mean())

    @check(title="half the step", at_most=1e-4)
    def replayed(self, finer: DataArray) -> DataArray:
        """change of a recovery time [s] when the optics are followed twice as finely"""
        return finer

    # --- what is told -------------------------------------------------------------------------

    told_times = metric(times_told)
    told_causes = table(told_by_cause)

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Any]:
        return {
            "recovery": one_recovery(answer, self.axis),
            "times": times_by_cause(answer, self.axis),
        }
