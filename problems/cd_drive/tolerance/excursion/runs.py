"""A defect that passes once in the loop under each strategy.

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from workbench.simulation import Cascade
from workbench.types import DataArray, RealArray, StateSpace

from ...diagnosis.scratch_draws import ScratchDraw
from ...drive.disc import VELOCITY, Defect, Disc
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis, red_book
from ...laboratory.bench_setup import RATE
from ...laboratory.record import Record
from ..bench_reading import BenchReading
from ..tactics import STRATEGIES, Strategies, clean_level
from .theory import BlindLens

MET = 0.45
"""Time [s] at which the defect begins; strategies A and B have adapted to the rotation by then."""
RECORDED_AFTER = 5e-3
"""Time [s] after the defect for which the error is recorded."""


class DefectCase(NamedTuple):
    """One defect on one disc: its middle [rad of the deviation], length [m], deviation [m].

    sign: of its false displacement. edge: as in `Defect`.
    """

    angle: float
    length: float
    deviation: float
    sign: float = 1.0
    edge: float = 0.2


@dataclass(frozen=True, eq=False)
class Crossing:
    """Defects of one depth and false displacement, on one drive at one rotation frequency.

    replacement: discrete K'. F: discrete fault filter of strategy C. rotation: of the disc [Hz].
    depth: share of the light that a defect takes. swing: its false displacement, over the
    acceptable error. reading: of what the text leaves open about the bench.
    """

    axis: Axis
    replacement: StateSpace
    F: StateSpace
    drive: str
    rotation: float
    depth: float
    swing: float
    reading: BenchReading = field(default_factory=BenchReading)

    @property
    def allowed(self) -> float:
        """The deviation that the Red Book allows [m]."""
        return red_book(self.axis).deviation

    def blind_lens(self, driven: bool) -> BlindLens:
        """Lens on a disc of the allowed deviation, without an error signal."""
        return BlindLens(self.axis, self.drive, self.allowed, self.rotation, driven)

    def drawn(self, seed: DataArray) -> DefectCase:
        """Defect of a seed at the coordinates angle, length, and share of the deviation."""
        scratch = ScratchDraw.drawn(self.axis, int(seed))
        angle, length, share = (float(seed[name]) for name in ("angle", "length", "share"))
        return DefectCase(angle, length, share * self.allowed, scratch.sign, scratch.edge)

    def disc(self, cell: DefectCase) -> Disc:
        """Disc whose deviation has the cell's angle at the middle of the defect."""
        middle = MET + cell.length / VELOCITY / 2
        phase = (cell.angle / (2 * np.pi) - self.rotation * middle) % 1.0
        return Disc.along(self.axis, cell.deviation, rotation=self.rotation, phase=phase)

    def defect(self, cell: DefectCase) -> Defect:
        """Defect that passes once, from MET on."""
        where = (self.rotation * MET + self.disc(cell).phase) % 1.0
        return Defect(
            length=cell.length,
            angle=where,
            depth=self.depth,
            displacement=cell.sign * self.swing * ACCEPTABLE_ERROR[self.axis],
            edge=cell.edge,
            present=(MET - 1e-6, MET + 1.5 * cell.length / VELOCITY),
        )

    def run(
        self, cell: DefectCase, strategy: str, seed: int | None = None, refine: int = 1
    ) -> Record:
        """Simulate a strategy from the disc's run-up until RECORDED_AFTER the defect; without a
        seed, without noise.
        """
        noisy = seed is not None
        bench = self.reading.laboratory(self.axis, self.drive, noisy=noisy, refine=refine)
        return bench.closed_loop(
            self.strategies[strategy],
            duration=MET + cell.length / VELOCITY + RECORDED_AFTER,
            disc=self.disc(cell),
            defects=[self.defect(cell)],
            seed=0 if seed is None else seed,
        )

    @cached_property
    def strategies(self) -> dict[str, Cascade]:
        """All strategies, by name."""
        level = clean_level(self.reading.laboratory(self.axis, self.drive))
        made = Strategies(self.axis, level, self.rotation, self.F, self.replacement)
        return {name: made.named(name) for name in STRATEGIES}


def excursion_of(record: Record, length: float) -> tuple[float, float]:
    """Largest magnitude of the true error [m] from the defect's start on, and the error
    at its end.
    """
    error: RealArray = record.x_cd - record.x
    start, end = round(MET * RATE), round((MET + length / VELOCITY) * RATE)
    return float(abs(error[start:]).max()), float(error[end])
