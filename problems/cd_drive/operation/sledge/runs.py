"""Rides: a drive follows the spiral until its sledge starts, moves and stands again."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple, Self

import numpy as np

from workbench.simulation import Part
from workbench.types import RealArray

from ...drive.compact_discs import rotations
from ...drive.disc import Disc
from ...drive.photo_diodes import CAPTURE, TRACK_PITCH
from ...drive.tables import Axis, red_book
from ...laboratory.bench_setup import RATE
from .carriage import Carried, CarriedBench, law_beside
from .train import Sledge

ROTATION = rotations()["lead_in"]
"""Rotation frequency [Hz] where a disc begins, and tracks pass fastest."""
SETTLED = 0.3
"""Time [s] in which the disc runs up, and the lens moves to just below the sledge's start."""
JUDGED = 0.35
"""Time [s] from which a ride is judged; what that first motion of the lens left has decayed."""
WAIT = 0.3
"""Time [s] from SETTLED until the mean of the lens reaches the sledge's start."""
WATCHED = 1.4
"""Time [s] for which the sledge is watched after that."""


QUIET: dict[str, Any] = {"noise": False, "bits": None}
"""A bench without noise, whose converters do not round."""


class Ridden(NamedTuple):
    """What a ride did, from JUDGED on.

    largest: true error [m]. lost: whether the track was lost. speed, motor: largest speeds of the
    carriage and of the motor [m/s]. reach: largest distance of the lens from its middle [m].
    """

    largest: float
    lost: float
    speed: float
    motor: float
    reach: float

    @classmethod
    def of(cls, found: Carried) -> Self:
        """What the ride of these signals did."""
        first = slice(round(JUDGED * RATE), None)
        largest = float(abs(found.error[first]).max())
        return cls(
            largest=largest,
            lost=float(largest > CAPTURE["radial"]),
            speed=float(abs(found.speed).max()),
            motor=float(abs(found.parts["motor"]).max()),
            reach=float(abs(found.lens - found.carriage)[first].max()),
        )


@dataclass(frozen=True)
class Ride:
    """A drive on its sledge, on a disc with a share of the Red Book's eccentricity.

    phase: angle of the disc at the start [revolutions].
    """

    drive: str
    sledge: Sledge = field(default_factory=Sledge)
    share: float = 0.0
    phase: float = 0.0
    seed: int = 0

    @classmethod
    def drawn(cls, drive: str, rods: float, share: float, seed: int) -> Self:
        """A draw of the sledge, of the disc's angle and of the noise."""
        rng = np.random.default_rng(seed)
        return cls(drive, Sledge.drawn(rng, rods), share, rng.uniform(), seed)

    @property
    def track(self) -> RealArray:
        """Place of the track [m] at each sample, and at the end."""
        time = np.arange(round((SETTLED + WAIT + WATCHED) * RATE) + 1) / RATE
        drift = TRACK_PITCH * ROTATION
        risen = 0.5 - 0.5 * np.cos(np.pi * np.minimum(time / SETTLED, 1.0))
        begin = self.sledge.start - drift * (SETTLED + WAIT)
        deviation = self.share * red_book("radial").deviation
        disc = Disc.along("radial", deviation, rotation=ROTATION, phase=self.phase, run_up=SETTLED)
        return disc.deviation("radial", time) + begin * risen + drift * time

    def record(self, **bench: Any) -> Carried:
        """Signals of the ride; `bench` are fields of `CarriedBench`."""
        one = CarriedBench("radial", self.drive, **bench)
        servo = Part("sledge", self.sledge.servo(self.drive), ["u_k"], outputs=["v", "motor"])
        return one.run(law_beside("radial", servo), self.track, seed=self.seed)


def largest_error(
    axis: Axis, drive: str, speed: RealArray, false: RealArray | None = None
) -> float:
    """Largest error [m] after motions of the carriage [m/s] (N,) along an axis, on a disc at rest
    and without noise; false (N,): what the diodes see besides [m].
    """
    bench = CarriedBench(axis, drive, **QUIET)
    seen = None if false is None else np.append(false, 0.0)
    found = bench.run(law_beside(axis), np.zeros(len(speed) + 1), speed, seen)
    return float(abs(found.error).max())
