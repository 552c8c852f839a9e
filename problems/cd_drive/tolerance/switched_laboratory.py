"""The switched loop in the virtual laboratory: its strategies, optics and quality signal.

What is proven of the linear loop is compared with this. Defects begin and end at once, so that the
strategy is in charge for as many samples as are asked for and the one in which the light comes
back; noise and rounding of the converters are left out, which no bound speaks of.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from workbench.heavy_types import StateSpace

from ..drive.disc import VELOCITY, Defect, Disc
from ..drive.plants import Gain
from ..drive.tables import Axis, red_book
from ..laboratory.bench_setup import RATE
from ..laboratory.experiment import Laboratory
from .tactics import Strategies, clean_level

NAMES = {"open": "reference", "filter": "C", "lower": "K_prime"}
"""Strategies by what they put in the place of K."""
FIRST = 3
"""Revolution of the first defect: the disc has run up, and the loop settled."""
ANGLES = (0.0, 0.125, 0.25, 0.375)
"""Where the defects begin [revolutions], one in each revolution and more than one apart."""
WITHIN = 1.0 - 1e-9
"""Of the length, so that the next sample is not on it."""


@dataclass(frozen=True)
class Rig:
    """Drives that play a disc at a rotation frequency [Hz].

    size: over the largest deviation, and that of the defects' displacement [m]. delay [samples].
    """

    axis: Axis
    size: float
    rotation: float
    gain: Gain
    delay: float
    displacement: float

    @property
    def disc(self) -> Disc:
        deviation = self.size * red_book(self.axis).deviation
        return Disc.along(self.axis, deviation, rotation=self.rotation)

    def defects(self, samples: int) -> Sequence[Defect]:
        """One for every angle, each met in one revolution."""
        return [
            Defect(
                WITHIN * samples / RATE * VELOCITY,
                angle,
                displacement=self.size * self.displacement,
                edge=0.0,
                present=((FIRST + k - 0.1) / self.rotation, (FIRST + k + 0.9) / self.rotation),
            )
            for k, angle in enumerate(ANGLES)
        ]

    def largest_error(
        self, drive: str, strategy: str, samples: int, replacement: StateSpace
    ) -> float:
        """Largest true error [m] of a strategy in NAMES once the loop has settled."""
        bench = Laboratory(
            self.axis,
            drive,
            gain=self.gain,
            delay=self.delay,
            noise=0.0,
            electronics=0.0,
            bits=None,
        )
        made = Strategies(
            self.axis, clean_level(bench), self.rotation, replacement=replacement
        ).named(NAMES[strategy])
        duration = (FIRST + len(ANGLES)) / self.rotation
        record = bench.closed_loop(
            made, duration=duration, disc=self.disc, defects=self.defects(samples)
        )
        settled = record.time > (FIRST - 0.5) / self.rotation
        return float(abs(record.x_cd - record.x)[settled].max())
