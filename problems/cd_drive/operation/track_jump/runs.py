"""One jump of a drive, and where it landed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from workbench.simulation import Controller
from workbench.types import RealArray

from ...drive.disc import Disc
from ...drive.photo_diodes import TRACK_PITCH
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import red_book
from ...laboratory.bench_setup import RATE
from ...laboratory.experiment import Laboratory
from ...laboratory.record import Record
from ...tolerance.tactics import clean_level
from .laws import Jump

LAWS = ("error and sum", "error alone", "clock", "fastest")
"""Two laws count zeros of the error: those that the sum confirms, or all. Two laws play pulses from
the nominal model: kick and brake of a free mass, and the fastest jump of the whole lens.
"""
COUNTING = LAWS[:2]
START = 0.25
"""Time [s] at which a jump starts; the disc is at full deviation since 0.2 s."""
ROTATION = 6.0
"""Rotation frequency [Hz]."""
LANDING = 25e-3
"""Time [s] in which a jump must end and settle."""
JUDGED = 5e-3
"""Time [s] at the end of a record in which it is judged whether the track is held."""


class Landing(NamedTuple):
    """Where a jump ended.

    off: tracks beyond the target, rounded. held: whether the lens ends in the middle of a track and
    stays there. time [s]: from the start until the error from the target stays acceptable; NaN if
    it never does. speed: largest speed of the lens across the tracks [m/s].
    """

    off: float
    held: float
    time: float
    speed: float


@dataclass(frozen=True, eq=False)
class Setting:
    """Jumps on a disc with this share of the Red Book's eccentricity.

    contrast: light between two tracks over that on a track, minus 1.
    """

    contrast: float
    share: float

    def record(self, jump: Jump, law: str, drive: str, seed: int, pulse: RealArray) -> Record:
        """A record of one draw; pulse [V]: for laws that play one."""
        bench = Laboratory("radial", drive, contrast=self.contrast)
        eccentricity = self.share * red_book("radial").deviation
        phase = float(np.random.default_rng(seed).uniform())
        disc = Disc.along("radial", eccentricity, rotation=ROTATION, phase=phase)
        controller = jump.cascade(self.law(jump, law, bench, pulse))
        return bench.closed_loop(controller, duration=START + LANDING, disc=disc, seed=seed)

    def law(self, jump: Jump, law: str, bench: Laboratory, pulse: RealArray) -> Controller:
        """The part of the cascade that jumps."""
        if law not in COUNTING:
            return jump.played(pulse)
        middle = clean_level(bench) * (1.0 + self.contrast / 2) if law == COUNTING[0] else 0.0
        return jump.counted(middle)

    def landing(self, jump: Jump, law: str, drive: str, seed: int, pulse: RealArray) -> Landing:
        """Where the jump of one draw ended."""
        return landed(self.record(jump, law, drive, seed, pulse), jump)


def landed(record: Record, jump: Jump) -> Landing:
    """Where the jump of a record ended."""
    first = round(jump.start * RATE)
    crossed = (record.x - record.x_cd)[first:] / TRACK_PITCH  # in tracks from the first one
    end = crossed[-round(JUDGED * RATE) :]
    track = round(float(end.mean()))
    held = float(abs(end - track).max() < 0.5)
    off = abs(crossed - jump.tracks) * TRACK_PITCH > ACCEPTABLE_ERROR["radial"]
    late = np.flatnonzero(off)
    settled = len(late) == 0 or late[-1] + 1 < len(off)
    time = (late[-1] + 1) / RATE if settled and len(late) else np.nan
    speed = float(abs(np.diff(crossed)).max() * TRACK_PITCH * RATE)
    return Landing(float(track - jump.tracks), held, float(time), speed)
