"""Strategies A and B on a disc that its servo turns: how they know the rotation, and what it costs.

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...diagnosis.scratch_draws import ScratchDraw
from ...drive.disc import VELOCITY, Defect, Disc
from ...drive.photo_diodes import CAPTURE
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis, compact_disc, red_book
from ...laboratory.bench_setup import RATE
from ...laboratory.experiment import Laboratory
from ...tolerance.scenario import Scenario, Stage
from .servo import MASSES, STEP, Played, Spindle, played

REFERENCE = "reference"
TOLD = ("first track", "address", "last turn")
"""How A and B know the rotation. "first track": it stays that of the lead-in at 1.3 m/s.
"address": that at 1.3 m/s at the radius that the address tells. "last turn": the mean of the turn
before they take over.
"""
SHARE = 0.5
"""Deviation of the disc over the Red Book's."""
SCRATCH, DEPTH, DISPLACEMENT = 1.2e-3, 0.7, 0.5
"""Length along the track [m], depth, and false displacement over the acceptable error, as in the
experiment of section 8.6.
"""
ENGAGED = 0.6
"""Time [s] at which another strategy takes over from the reference strategy."""
SETTLING, EVALUATED = 3.0, 2.2
"""Number of turns in which a strategy settles, and of those that are evaluated then."""
AFTER = 5e-3
"""Time [s] after a scratch in which the largest error is the excursion."""
LEAD = 1.0
"""Time [s] for which the servo runs before the laboratory does."""
QUIET: dict[str, Any] = {"noise": 0.0, "electronics": 0.0, "bits": None}
"""A laboratory without noise, whose converters do not round."""
CORNERS = 0.02
"""Time [s] between the corners of the rotation's profile in the laboratory."""


class Met(NamedTuple):
    """What a strategy did.

    excursion: largest error [m] after a scratch. lost: whether focus or track was lost. wrong:
    relative error of the rotation that it was told, on average over what is evaluated.
    """

    excursion: float
    lost: float
    wrong: float


@dataclass(frozen=True)
class Turned:
    """A drive with a scratched disc at a radius [m], turned by its servo; all that is drawn follows
    from the seed. The laboratory takes 1.3 m/s for the length of the scratch.
    """

    axis: Axis
    drive: str
    radius: float
    seed: int

    @cached_property
    def spindle(self) -> Spindle:
        rng, disc = np.random.default_rng([self.seed, 7]), compact_disc()
        velocity = rng.uniform(disc.velocity_min, disc.velocity_max)
        return Spindle(float(rng.uniform(MASSES[0], MASSES[-1])), float(velocity))

    @cached_property
    def ride(self) -> Played:
        """The run of the servo; that of the laboratory begins LEAD later."""
        rng = np.random.default_rng([self.seed, 8])
        return played(self.spindle, self.radius, LEAD + self.duration + CORNERS, rng)

    @property
    def duration(self) -> float:
        """Length of the laboratory's run [s]."""
        slowest = 0.95 * float(self.spindle.rotation(self.radius))
        return ENGAGED + (SETTLING + EVALUATED) / slowest

    @cached_property
    def disc(self) -> Disc:
        corners = slice(round(LEAD / STEP), None, round(CORNERS / STEP))
        begin = float(self.spindle.rotation(self.radius))
        factors, times = self.ride.rotation[corners] / begin, self.ride.time[corners]
        return Disc.along(
            self.axis,
            SHARE * red_book(self.axis).deviation,
            rotation=begin,
            speed=tuple(zip((times - times[0]).tolist(), factors.tolist(), strict=True)),
        )

    def told(self, how: str) -> float:
        """Rotation [Hz] that a strategy is told."""
        if how == "first track":
            return VELOCITY / (2 * np.pi * compact_disc().lead_in_radius)
        if how == "address":
            return VELOCITY / (2 * np.pi * self.radius)
        turn = 1.0 / float(self.spindle.rotation(self.radius))
        revolutions, _ = self.disc.turned(np.array([ENGAGED - turn, ENGAGED]))
        return float(np.diff(revolutions)[0]) / turn

    def met(self, strategy: str, how: str, **bench: Any) -> Met:
        """Run a strategy that is told the rotation in one way; `bench` are fields of the
        laboratory.
        """
        scratch = ScratchDraw.drawn(self.axis, self.seed)
        spot = Defect(
            SCRATCH,
            scratch.angle,
            DEPTH,
            displacement=scratch.sign * DISPLACEMENT * ACCEPTABLE_ERROR[self.axis],
            edge=scratch.edge,
            present=(0.3, np.inf),
        )
        rotation, stages = self.told(how), [Stage(REFERENCE)]
        if strategy != REFERENCE:
            stages.append(Stage(strategy, ENGAGED))
        record = Scenario(
            Laboratory(self.axis, self.drive, **bench),
            self.disc,
            (spot,),
            stages=tuple(stages),
            rotation=rotation,
            duration=self.duration,
            seed=scratch.seed,
        ).run()
        revolutions, true = self.disc.turned(record.time)
        on, _ = spot.met(revolutions, record.time, true)
        begun = np.interp(ENGAGED, record.time, revolutions) + SETTLING
        first = int(np.searchsorted(revolutions, begun))
        ends = np.flatnonzero(on[:-1] & ~on[1:]) + 1
        ends = ends[(ends > first) & (ends + round(AFTER * RATE) <= len(on))]
        error = abs(record.x_cd - record.x)
        excursion = max(error[k : k + round(AFTER * RATE)].max() for k in ends)
        wrong = rotation / float(true[first:].mean()) - 1.0
        lost = error[first:].max() > CAPTURE[self.axis]
        return Met(float(excursion), float(lost), wrong)
