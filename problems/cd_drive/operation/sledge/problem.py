"""The sledge carries the pickup and jerks: what both loops feel of it (sections 2.5.1, 2.5.2).

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Callable
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
    share_of_draws,
    table,
)
from workbench.types import DataArray, Dataset, RealArray

from ...drive.photo_diodes import TRACK_PITCH
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.shared_parameters import TABLES
from ...drive.tables import AXES, drives
from ...laboratory.bench_setup import RATE
from .bounds import SAMPLES, MovedLoop, moved_loop, read_wrong
from .figures import jerks, outcomes
from .report import bounds_told, felt_told, rides_told, shares_told
from .runs import QUIET, ROTATION, Ridden, Ride, largest_error
from .train import Sledge

RODS = (0.0, 0.1, 0.2, 0.5, 1.0, 2.0)
"""Static friction of the rods [N]: 0.1 of a clean carriage, more of dirt or dry grease; with 0 the
motor has no stiction either.
"""
SHARES = (0.0, 0.5, 1.0)
"""Eccentricities of the disc over what the Red Book allows."""
SHOWN = (0.1, 0.5, 1.0)
"""Friction of the rides that a figure shows [N]."""
WINDOW, STRIDE = (0.6, 1.0), 28
"""Times [s] between which they are shown, and distance of the samples."""
SMALL, MISREAD = 0.02, 1e-9
"""Share of the certified speed, and amount read wrong [m], at which the diodes are linear."""
EXAMPLE = 0.5
"""Friction [N] of the rides that are replayed with finer optics."""
QUIETLY = ("quiet_largest", "quiet_speed", "quiet_motor", "quiet_focus")
"""Numbers of rides without noise, in the order of their arrays."""


@problem("cd/sledge", data=(*TABLES, "data/red_book.csv", "data/compact_disc.csv"))
def sledge(draws: Annotated[int, Field(ge=1, le=1000)] = 4) -> SledgeStudy:
    """A sledge carries the pickup, follows its mean, and jerks by stiction (2.5.1, 2.5.2).

    A motor drives the carriage by a worm gear until the lens is in its middle on average. Motor and
    rods have Coulomb friction, so the carriage sticks and slips on its way. Every ride lasts from
    the start of the sledge until it stands again, at 9 Hz.

    Assumed: all numbers of the sledge; the motor is one of a data sheet, and the others are guesses
    (see `Sledge`). Certified for each drive: the speed of the carriage up to which the error stays
    acceptable, whatever forces move it, without noise; for the focus, the speed along its own axis.
    Simulated: shares of rides that leave the acceptable error or lose the track, with 99 %
    Clopper-Pearson intervals.

    draws: number of draws of the sledge, of the disc's angle and of noise, for every drive.
    """
    return SledgeStudy(draws)


@dataclass(frozen=True)
class SledgeStudy(Study):
    """Certified speeds of the carriage, and rides with every friction on every drive and disc."""

    draws: int

    headline: ClassVar[str] = "kept_speed_radial_least_mm_s"

    @property
    def quantifier(self) -> str:
        return f"for these 12 drives, in {self.draws} simulated draws of each ride"

    axis = dim(AXES)
    rods = dim(RODS, unit="N", meaning="static friction of the rods; 0: no stiction")
    share = dim(SHARES, meaning="eccentricity over the Red Book's")
    drive = dim(lambda: [one.name for one in drives("radial")])
    draw = dim(lambda self: range(self.draws))

    # --- certified ----------------------------------------------------------------------------

    per_speed = array(
        dims=(axis, drive),
        unit="s",
        meaning="largest error over the carriage's largest speed, linear loop",
        value=lambda drive: _each_loop(drive, lambda one: one.error_per_speed),
    )
    per_reading = array(
        dims=(axis, drive),
        unit="1",
        meaning="largest error over what is read wrong",
        value=lambda drive: _each_loop(drive, lambda one: one.per_reading),
    )

    @array(dims=(axis, share, drive), unit="m/s", meaning="certified to keep the acceptable error")
    def kept_speed(self, drive: DataArray) -> list[list[list[float]]]:
        loops = [[moved_loop(axis, name) for name in drive.values.tolist()] for axis in AXES]
        return [
            [[one.kept_speed(one.disc_error(share, ROTATION)) for one in row] for share in SHARES]
            for row in loops
        ]

    replayed = array(
        dims=(axis, drive),
        unit="m",
        meaning="simulated error after the worst motion, small",
        value=lambda drive: _each_loop(
            drive,
            lambda one: largest_error(
                one.axis, one.drive, one.worst_motion(SMALL * one.kept_speed())
            ),
        ),
    )
    replayed_whole = array(
        dims=drive,
        unit="m",
        meaning="the same at the certified speed, radial",
        value=lambda drive: [
            largest_error("radial", one.drive, one.worst_motion(one.kept_speed()))
            for one in (moved_loop("radial", name) for name in drive.values.tolist())
        ],
    )

    misread = array(
        dims=(axis, drive),
        unit="m",
        meaning="simulated error after the worst noise of the reading, small",
        value=lambda drive: _each_loop(
            drive,
            lambda one: largest_error(
                one.axis, one.drive, np.zeros(SAMPLES), one.worst_reading(MISREAD)
            ),
        ),
    )

    # --- rides without noise ------------------------------------------------------------------

    quiet = arrays(
        (rods, drive),
        lambda quietly: {name: quietly[..., n] for n, name in enumerate(QUIETLY)},
        quiet_largest=("m", "radial error on a centred disc, without noise"),
        quiet_speed=("m/s", "largest speed of the carriage"),
        quiet_motor=("m/s", "largest speed of the motor"),
        quiet_focus=("m", "focus error if the carriage moved like this along the focus axis"),
    )

    @part
    def quietly(self, drive: DataArray, context: Context) -> RealArray:
        """Quiet rides (rods, drives, 4)."""

        def one(name: str) -> list[list[float]]:
            told = []
            for friction in RODS:
                found = Ride(name, Sledge.with_rods(friction)).record(**QUIET)
                ridden = Ridden.of(found)
                vertical = largest_error("focus", name, found.speed)
                told.append([ridden.largest, ridden.speed, ridden.motor, vertical])
            return told

        every = context.spread(one, drive.values.tolist(), "quiet rides")
        return np.moveaxis(np.array(every), 0, 1)

    finer = array(
        dims=drive,
        unit="m",
        meaning="quiet error with optics followed twice as finely",
        value=lambda drive: [
            Ridden.of(Ride(name, Sledge.with_rods(EXAMPLE)).record(**QUIET, refine=2)).largest
            for name in drive.values.tolist()
        ],
    )

    # --- simulated ----------------------------------------------------------------------------

    seed = array(
        dims=(drive, draw),
        value=lambda self, context: independent_seeds(context.rng, 12, self.draws),
    )

    @part
    def met(self, context: Context, seed: DataArray) -> RealArray:
        """Rides (rods, shares, drives, draws, 5)."""

        def one(place: tuple[int, ...]) -> list[Ridden]:
            name, number = str(seed[place]["drive"].values), int(seed[place])
            return [
                Ridden.of(Ride.drawn(name, friction, at, number).record())
                for friction in RODS
                for at in SHARES
            ]

        found = context.spread(one, list(np.ndindex(seed.shape)), "rides")
        shape = (*seed.shape, len(RODS), len(SHARES), len(Ridden._fields))
        return np.moveaxis(np.reshape(found, shape), (0, 1), (2, 3))

    told = arrays(
        (rods, share, drive, draw),
        lambda met: {name: met[..., n].astype("f4") for n, name in enumerate(Ridden._fields)},
        largest=("m", "largest radial error"),
        lost=("1", "whether the track is lost"),
        speed=("m/s", "largest speed of the carriage"),
        motor=("m/s", "largest speed of the motor"),
        reach=("m", "largest distance of the lens from its middle"),
    )

    moment = dim(
        lambda: np.arange(round(WINDOW[0] * RATE), round(WINDOW[1] * RATE), STRIDE) / RATE,
        unit="s",
        meaning="time",
    )
    shown_rods = dim(SHOWN, unit="N")

    @arrays((shown_rods, moment), shown_carriage="m", shown_speed="m/s", shown_error="m")
    def shown(self) -> dict[str, Any]:
        """Rides on CD1, on a centred disc."""
        first, last = (round(at * RATE) for at in WINDOW)
        inside, rows = slice(first, last, STRIDE), []
        for friction in SHOWN:
            one = Ride("CD1", Sledge.with_rods(friction), seed=1).record()
            rows.append([each[inside] for each in (one.carriage, one.speed, one.error)])
        every = np.swapaxes(np.array(rows, np.float32), 0, 1)
        return dict(zip(("shown_carriage", "shown_speed", "shown_error"), every, strict=True))

    # --- checks -------------------------------------------------------------------------------

    @check(title="attained", at_most=2e-3)
    def attained(self, replayed: DataArray, kept_speed: DataArray, per_speed: DataArray) -> Any:
        """relative difference of the error after the worst motion from the linear bound"""
        return abs(replayed / (SMALL * kept_speed.sel(share=0.0) * per_speed) - 1.0)

    @check(title="reading", at_most=0.01)
    def attained_by_reading(self, misread: DataArray, per_reading: DataArray) -> DataArray:
        """the same of the worst noise of the reading, which the simulation interpolates"""
        return abs(misread / (MISREAD * per_reading) - 1.0)

    @check(title="speeds", at_most=1e-6)
    def follows(self, answer: Dataset) -> DataArray:
        """difference of kept speeds from those by other numbers, over those on centred discs"""
        found = answer["kept_speed"].copy(deep=True)
        for axis in AXES:
            acceptable = ACCEPTABLE_ERROR[axis]
            wrong = read_wrong(acceptable) if axis == "radial" else 0.0
            loops = [moved_loop(axis, name) for name in found["drive"].values.tolist()]
            for share in SHARES:
                others = [one.disc_error(share, ROTATION) + one.rest for one in loops]
                left = acceptable - wrong * answer["per_reading"].sel(axis=axis) - others
                at = {"axis": axis, "share": share}
                speed = left.clip(0.0) / answer["per_speed"].sel(axis=axis)
                found.loc[at] = abs(answer["kept_speed"].sel(at) - speed)
        return found / answer["kept_speed"].sel(share=0.0)

    @check(title="kept", at_most=1.0)
    def keeps(self, replayed_whole: DataArray) -> DataArray:
        """simulated error after the worst motion at the certified speed over the acceptable one"""
        return replayed_whole / ACCEPTABLE_ERROR["radial"]

    @check(title="rides", at_most=1.0)
    def within(self, answer: Dataset) -> DataArray:
        """error of a quiet ride over the certified bound at its speed, where there is one"""
        found = answer["quiet_largest"].copy()
        drift = TRACK_PITCH * ROTATION  # the spiral's speed counts as the carriage's
        for name in found["drive"].values.tolist():
            bound = [
                moved_loop("radial", name).bound(v + drift)
                for v in answer["quiet_speed"].sel(drive=name).values
            ]
            found.loc[{"drive": name}] = found.sel(drive=name) / bound
        return found

    @check(title="slips", at_most=1.0 + 1e-2)
    def not_faster(self, quiet_speed: DataArray, quiet_motor: DataArray) -> DataArray:
        """largest speed of the carriage in a quiet ride over that of a slip by Coulomb's law"""
        found = quiet_speed.copy()
        for friction in RODS:
            at = {"rods": friction}
            slip = [Sledge.with_rods(friction).slip_speed(v) for v in quiet_motor.sel(at).values]
            found.loc[at] = quiet_speed.sel(at) / slip
        return found

    @check(title="smooth", at_most=1.0 - CLAIM_SHARE)
    def smooth(self, largest: DataArray) -> float:
        """share of rides without stiction, on centred discs, whose error is not acceptable"""
        beyond = largest.sel(rods=0.0, share=0.0) > ACCEPTABLE_ERROR["radial"]
        return float(share_of_draws(beyond))

    @check(title="half the step", at_most=1e-3)
    def halved(self, finer: DataArray, quiet_largest: DataArray) -> DataArray:
        """relative change of a quiet error with optics followed twice as finely"""
        return abs(finer / quiet_largest.sel(rods=EXAMPLE) - 1.0)

    # --- what is told -------------------------------------------------------------------------

    told_bounds = metric(bounds_told)
    told_felt = metric(felt_told)
    told_shares = metric(shares_told)
    rides = table(rides_told)

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Any]:
        return {"jerks": jerks(answer), "outcomes": outcomes(answer)}


def _each_loop(drive: DataArray, told: Callable[[MovedLoop], float]) -> list[list[float]]:
    """A number of the loop of each axis and drive."""
    return [[told(moved_loop(axis, name)) for name in drive.values.tolist()] for axis in AXES]
