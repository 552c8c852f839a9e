"""The switched loop in the virtual laboratory: its strategies, optics and quality signal.

The bounds of the linear loop are compared with these simulations. Defects begin and end abruptly,
so the strategy is in charge for the given number of samples, and for one more in which the light
returns. The converters' noise and rounding are left out, since the bounds do not include them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from workbench.types import StateSpace

from ..drive.disc import VELOCITY, Defect, Disc
from ..drive.plants import Gain
from ..drive.tables import Axis, red_book
from ..laboratory.bench_setup import RATE
from ..laboratory.experiment import Laboratory
from .tactics import Strategies, clean_level

NAMES = {"open": "reference", "filter": "C", "lower": "K_prime"}
"""Names of the strategies in `tactics`, by what replaces K during a defect."""
FIRST = 3
"""Revolution of the first defect; the disc has run up and the loop has settled by then."""
ANGLES = (0.0, 0.125, 0.25, 0.375)
"""Angles [revolutions] at which the defects begin, one defect in each revolution."""
LENGTH_FACTOR = 1.0 - 1e-9
"""Factor that shortens a defect so that the sample after it is not on it."""


@dataclass(frozen=True)
class Rig:
    """Drives with a disc at a rotation frequency [Hz].

    size: factor on the disc's largest deviation and on the defects' displacement [m]. delay: of the
    computer [samples].
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
        """Defects of this length [samples], one at every angle, one in each revolution."""
        return [
            Defect(
                LENGTH_FACTOR * samples / RATE * VELOCITY,
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
        """Largest true error [m] of a strategy in NAMES after the loop has settled."""
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
