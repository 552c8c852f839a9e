"""The disc servo by the fill of the buffer, and the strategies that need the rotation (2.5.3).

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
from ...drive.shared_parameters import TABLES
from ...drive.tables import AXES, compact_disc, drives
from .figures import by_error, whole_disc
from .report import discs_told, servo_told, strategies_told, told_by_case
from .runs import QUIET, REFERENCE, TOLD, Met, Turned
from .servo import MASSES, STEP, Played, Spindle, played

STRATEGIES = ("A", "B")
"""The strategies that need the rotation."""
RADII = (compact_disc().lead_in_radius, 0.038, compact_disc().program_end)
"""Radii [m]: at 1.3 m/s the disc turns at 9, 5.4 and 3.6 Hz."""
VELOCITIES = (compact_disc().velocity_min, compact_disc().velocity_max)
"""Ends of the range of velocities that discs may have [m/s]."""
STRETCHES = 150
"""Number of stretches of a whole disc whose extremes are stored."""
WHOLE = ("swing", "deviation", "turn_change")
"""Numbers of a spindle that are certified, and compared with a whole disc."""


@problem("cd/disc-servo", data=(*TABLES, "data/red_book.csv", "data/compact_disc.csv"))
def disc_servo(draws: Annotated[int, Field(ge=1, le=1000)] = 2) -> DiscServoStudy:
    """Constant linear velocity by the buffer, 9 to 3.6 Hz, and what A and B know of it (2.5.3).

    The spindle's motor keeps the fill of the data's buffer. Its friction varies, so the rotation
    does. Strategies A and B of chapter 8 are told the rotation once, when they take over: that of
    the first track, that of the address at 1.3 m/s, or that of the last turn.

    Assumed: motor, inertia and servo, as the thesis prints none; the motor is one of a data sheet,
    and its friction varies by a fifth. Certified for discs of three masses and two velocities at
    three radii: fill and rotation, however the friction varies, if it is constant for 2 ms.
    Simulated: the whole disc, and a scratch on every drive in both loops, with a disc of random
    mass and velocity; shares with 99 % Clopper-Pearson intervals.

    draws: number of draws of disc, friction, scratch and noise, for every drive.
    """
    return DiscServoStudy(draws)


@dataclass(frozen=True)
class DiscServoStudy(Study):
    """Certified bounds of the servo, a whole disc, and strategies on every drive."""

    draws: int

    headline: ClassVar[str] = "turn_change_most"

    @property
    def quantifier(self) -> str:
        return f"for these 12 drives, in {self.draws} simulated draws of each run"

    axis, strategy = dim(AXES), dim(STRATEGIES)
    told = dim(TOLD, meaning="how the rotation is told")
    mass, velocity, radius = (
        dim(MASSES, unit="kg"),
        dim(VELOCITIES, unit="m/s"),
        dim(RADII, unit="m"),
    )
    drive = dim(lambda: [one.name for one in drives("focus")])
    draw = dim(lambda self: range(self.draws))

    # --- certified ----------------------------------------------------------------------------

    certified = arrays(
        (mass, velocity, radius),
        lambda: {
            name: [
                [[getattr(Spindle(m, v), name)(r) for r in RADII] for v in VELOCITIES]
                for m in MASSES
            ]
            for name in WHOLE
        },
        swing=("s", "largest distance of the fill from its middle"),
        deviation=("1", "largest deviation of the rotation from that with a fill that stays"),
        turn_change=("1", "largest change of the rotation's logarithm from a turn ago"),
    )

    # --- a whole disc -------------------------------------------------------------------------

    @part
    def whole(self, context: Context) -> list[Played]:
        """A whole disc of each mass."""
        first, last = compact_disc().lead_in_radius, compact_disc().program_end
        seeds, played_discs = independent_seeds(context.rng, len(MASSES)), []
        for mass, seed in zip(MASSES, seeds, strict=True):
            one = Spindle(mass)
            duration = np.pi * (last**2 - first**2) / (TRACK_PITCH * one.velocity)
            played_discs.append(played(one, first, duration, np.random.default_rng(int(seed))))
        return played_discs

    largest = arrays(
        mass,
        lambda whole: {
            "whole_swing": [abs(one.fill).max() for one in whole],
            "whole_deviation": [abs(one.off).max() for one in whole],
            "whole_turn_change": [abs(one.turn_change).max() for one in whole],
        },
        whole_swing="s",
        whole_deviation="1",
        whole_turn_change="1",
    )
    stretch = dim(
        lambda whole: STEP * len(whole[0].time) * (np.arange(STRETCHES) + 0.5) / STRETCHES,
        unit="s",
        meaning="time",
    )

    @arrays(stretch, shown_rotation="Hz", shown_low="s", shown_high="s")
    def shown(self, whole: list[Played]) -> dict[str, RealArray]:
        """Rotation, and least and largest fill, of stretches of a disc of the second mass."""
        one = whole[1]
        parts = [np.array_split(each, STRETCHES) for each in (one.rotation, one.fill)]
        return {
            "shown_rotation": np.array([part.mean() for part in parts[0]]),
            "shown_low": np.array([part.min() for part in parts[1]]),
            "shown_high": np.array([part.max() for part in parts[1]]),
        }

    # --- strategies ---------------------------------------------------------------------------

    seed = array(
        dims=(drive, draw),
        value=lambda self, context: independent_seeds(context.rng, 12, self.draws),
    )

    @part
    def met(self, context: Context, seed: DataArray) -> RealArray:
        """Runs (axes, radii, 1 + strategies x ways to tell, drives, draws, 3), those of the
        reference strategy first.
        """
        cases = [(REFERENCE, TOLD[-1]), *((one, how) for one in STRATEGIES for how in TOLD)]

        def one(place: tuple[int, ...]) -> list[Met]:
            name, number = str(seed[place]["drive"].values), int(seed[place])
            every = [Turned(axis, name, r, number) for axis in AXES for r in RADII]
            return [turned.met(*case) for turned in every for case in cases]

        found = context.spread(one, list(np.ndindex(seed.shape)), "runs")
        shape = (*seed.shape, len(AXES), len(RADII), len(cases), len(Met._fields))
        return np.moveaxis(np.reshape(found, shape), (0, 1), (3, 4))

    @arrays((axis, radius, drive, draw), reference_excursion="m", reference_lost="1")
    def usual(self, met: RealArray) -> dict[str, RealArray]:
        """Of the reference strategy, which does not use the rotation."""
        reference = met[:, :, 0].astype("f4")
        return {"reference_excursion": reference[..., 0], "reference_lost": reference[..., 1]}

    of_told = arrays(
        (axis, radius, strategy, told, drive, draw),
        lambda met: {
            name: met[:, :, 1:, ..., n].reshape(_split(met)).astype("f4")
            for n, name in enumerate(Met._fields)
        },
        excursion=("m", "largest error after a scratch"),
        lost=("1", "whether focus or track is lost"),
        wrong=("1", "error of the rotation that is told"),
    )

    @array(dims=(axis, drive), unit="1", meaning="change of a quiet excursion by finer optics")
    def finer(self, drive: DataArray, seed: DataArray) -> list[list[float]]:
        def change(axis: Any, name: str) -> float:
            one = Turned(axis, name, RADII[1], int(seed.sel(drive=name)[0]))
            coarse, fine = (one.met("B", TOLD[-1], **QUIET, refine=n).excursion for n in (1, 2))
            return abs(fine / coarse - 1.0)

        return [[change(axis, name) for name in drive.values.tolist()] for axis in AXES]

    # --- checks -------------------------------------------------------------------------------

    @check(title="whole disc", at_most=1.0)
    def within(self, answer: Dataset) -> DataArray:
        """largest simulated fill, deviation and change on a whole disc over the certified ones"""
        import xarray as xr

        each = [
            answer[f"whole_{name}"] / answer[name].max(["radius", "velocity"]) for name in WHOLE
        ]
        return xr.concat(each, "number").assign_coords(number=list(WHOLE))

    @check(title="{strategy} told by the last turn", at_most=0.5, each="strategy")
    def last_turn(self, answer: Dataset) -> DataArray:
        """share of draws in which its excursion is not below the reference strategy's"""
        above = answer["excursion"] >= answer["reference_excursion"]
        return share_of_draws(above.sel(told=TOLD[-1]), "strategy")

    @check(title="{strategy} told by the first track", at_most=1.0, each="strategy")
    def first_track(self, excursion: DataArray) -> DataArray:
        """median excursion at the last radius by the last turn, over that by the first track"""
        median = excursion.isel(radius=-1).median(["axis", "drive", "draw"])
        return median.sel(told=TOLD[-1]) / median.sel(told=TOLD[0])

    @check(title="half the step", at_most=0.02)
    def halved(self, finer: DataArray) -> DataArray:
        """relative change of an excursion without noise, with optics followed twice as finely"""
        return finer

    # --- what is told -------------------------------------------------------------------------

    of_servo = metric(servo_told)
    of_discs = metric(discs_told)
    of_strategies = metric(strategies_told)
    cases = table(told_by_case)

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Any]:
        return {"whole-disc": whole_disc(answer), "told": by_error(answer)}


def _split(met: RealArray) -> tuple[int, ...]:
    """Shape of runs with strategies and ways to tell apart."""
    axes, radii, _, *rest, _ = met.shape
    return (axes, radii, len(STRATEGIES), len(TOLD), *rest)
