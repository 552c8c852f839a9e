"""Runs of the virtual laboratory over a disc with many defects, and the defects' places in the
record.

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from workbench.diagnosis import clean_level
from workbench.simulation import Cascade, Controller, linear_controller
from workbench.types import RealArray

from ..drive.disc import VELOCITY, Defect, Disc
from ..drive.plants import controller
from ..drive.tables import Axis, red_book
from ..laboratory.bench_setup import PERIOD, RATE
from ..laboratory.experiment import Laboratory
from ..laboratory.record import Record
from .defect_kinds import SHOCK_DURATION, shocks

ROTATION = 5.5
"""Rotation frequency of the disc [Hz] (eq. 7.31)."""
SETTLING = 0.4
"""Time [s] in which the disc runs up and the loop settles; nothing before is evaluated."""
DEFECT_SLOTS = 4
"""Number of defects in a revolution."""
SPACING = 1.0 / (DEFECT_SLOTS * ROTATION)
"""Time from one defect to the next [s]."""
SHOCK_PERIOD = 0.05
"""Time from one shock to the next [s]."""


@dataclass(frozen=True, eq=False)
class DefectRun:
    """A record from SETTLING on, the level [V] of its sum on a clean disc, and its defects.

    faults: for each defect in order its first sample, and the one after its last.
    """

    record: Record
    level: float
    faults: list[tuple[int, int]]

    @property
    def diodes(self) -> RealArray:
        """d1n and d2n (N, 2), whose sum is 1 on a clean disc."""
        return np.column_stack([self.record.d1, self.record.d2]) / self.level


def wobbling(axis: Axis) -> Disc:
    """A disc with the deviation that the Red Book allows, 500 um in focus (eq. 7.31)."""
    focus, radial = (red_book(each).deviation for each in ("focus", "radial"))
    return Disc(
        warp=(focus,) if axis == "focus" else (),
        eccentricity=(radial,) if axis == "radial" else (),
        rotation=ROTATION,
    )


def run(
    bench: Laboratory,
    defects: Sequence[Defect],
    seed: int,
    acceleration: float = 0.0,
    duration: float | None = None,
    spacing: float = SPACING,
    disc: Disc | None = None,
    law: Controller | Cascade | None = None,
) -> DefectRun:
    """Run of a controller on a disc that has one defect after the other.

    Each defect passes once, `spacing` [s] after the previous one. Shocks with peak `acceleration`
    [m/s^2] follow each other at SHOCK_PERIOD. duration: evaluated time [s]; by default as long as
    the defects need. disc: by default the wobbling one. law: by default the reference controller,
    without a detector.
    """
    disc = disc or wobbling(bench.axis)
    evaluated = spacing * len(defects) if duration is None else duration
    samples = round((SETTLING + evaluated) * RATE)
    starts = SETTLING + spacing * (0.25 + np.arange(len(defects)))
    placed = [
        replace(
            defect,
            angle=float((disc.rotation * start) % 1.0),
            present=(float(start) - 1e-9, float(start) + 0.5 * spacing),
        )
        for defect, start in zip(defects, starts, strict=True)
    ]
    times = np.arange(SETTLING, SETTLING + evaluated - SHOCK_PERIOD, SHOCK_PERIOD)
    played = shocks(bench, [(float(t), acceleration, SHOCK_DURATION) for t in times], samples)
    law = law or linear_controller(controller(bench.axis), PERIOD)
    whole = bench.closed_loop(law, played, disc=disc, defects=placed, seed=seed)
    skip = round(SETTLING * RATE)
    arrays: dict[str, Any] = {
        name: value[skip:] for name, value in vars(whole).items() if isinstance(value, np.ndarray)
    }
    faults = [
        (round(start * RATE) - skip, round((start + defect.length / VELOCITY) * RATE) + 1 - skip)
        for defect, start in zip(placed, starts, strict=True)
    ]
    record = replace(whole, **arrays)
    return DefectRun(record, clean_level(record.sum), faults)
