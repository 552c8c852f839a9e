"""How far the focus point strays while a defect passes, and which defects each strategy survives.

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Run, Study, problem, ref
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure
from workbench.systems.storage import restored

from ...drive.disc import VELOCITY
from ...drive.photo_diodes import CAPTURE
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis, red_book
from ..tactics import STRATEGIES
from .checks import checks_of
from .report import figures_of, tables_of
from .runs import Cell, Crossing, excursion_of
from .theory import WORST, standing

LENGTHS = (0.3e-3, 2.5e-3)
"""Shortest and longest defect [m]; the error correction repairs 2.5 mm."""
SHARES = (0.25, 0.5, 1.0, 1.5, 2.0)
"""Amplitudes of the disc's deviation over what the Red Book allows."""


@problem(
    "cd/{axis}/excursion",
    axis=("focus", "radial"),
    needs=lambda axis, **_: {"slower": ref(f"cd/{axis}/lower-bandwidth")},
    data=(*TABLES, "data/red_book.csv"),
)
def excursion(
    axis: Axis,
    slower: Run,
    drive: str = "nominal",
    rotation: Annotated[float, Field(ge=3, le=20)] = 9.0,
    angles: Annotated[int, Field(ge=2, le=90)] = 6,
    lengths: Annotated[int, Field(ge=2, le=50)] = 5,
    depth: Annotated[float, Field(gt=0, le=1)] = 0.9,
    swing: Annotated[float, Field(ge=0, le=5)] = 0.5,
) -> Excursion:
    """Excursion of the lens in a defect (eq. 8.1), and a map of the defects that are survived.

    The disc deviates by shares of what the Red Book allows; a defect's middle comes at an angle of
    that deviation. Equation 8.1, of a lens that stops, is compared with a lens that moves freely,
    with one that the blind controller drives, and with the simulated loop under the reference
    strategy. The map says whether focus, or the track, is kept (true error within the diodes'
    capture range) over angle, length and deviation, for each strategy.

    drive: "CD1" to "CD12", or "nominal". rotation [Hz]. angles: how many from 0 (the disc is
    fastest) to below 180 degrees. lengths: how many from 0.3 to 2.5 mm. depth: share of the light
    that the defect takes. swing: its false displacement as a share of the acceptable error.
    """
    replacement = restored(slower.data, "sampled")
    crossing = Crossing(axis, replacement, drive, rotation, depth, swing)
    return Excursion(crossing, angles, lengths)


@dataclass(frozen=True, eq=False)
class Excursion(Study):
    """Every strategy over angle, length and deviation, and what eq. 8.1 says of them."""

    crossing: Crossing
    angles: int
    lengths: int

    headline: ClassVar[str] = "survived_reference"

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        crossing = self.crossing
        angle = np.pi * np.arange(self.angles) / self.angles
        length = np.linspace(*LENGTHS, self.lengths)
        share = np.array(SHARES)
        grid = list(product(range(self.angles), range(self.lengths), range(len(share))))
        shape = (len(STRATEGIES), self.angles, self.lengths, len(share))
        peak, end = np.zeros(shape), np.zeros(shape)
        seeds = context.rng.integers(2**31, size=len(grid))
        for place, seed in context.track(list(zip(grid, seeds, strict=True)), "defects"):
            i, j, k = place
            cell = Cell(angle[i], length[j], share[k] * crossing.allowed)
            for s, name in enumerate(STRATEGIES):
                record = crossing.run(cell, name, int(seed))
                peak[s, i, j, k], end[s, i, j, k] = excursion_of(record, cell.length)
        time = length / VELOCITY
        free, driven = (crossing.blind_lens(driven) for driven in (False, True))
        everywhere, along = ("strategy", "angle", "length", "share"), ("theta", "length")
        units, theta = {"units": "m"}, np.unique(np.append(np.radians(np.arange(0, 181, 3)), angle))
        theory = {
            "standing": standing(crossing.allowed, crossing.rotation, time, theta[:, None]),
            "free": np.transpose([free.error(each, theta) for each in time]),
            "driven": np.transpose([driven.error(each, theta) for each in time]),
        }
        return xr.Dataset(
            {
                "peak": (
                    everywhere,
                    peak,
                    units | {"long_name": "largest true error, defect and 5 ms after"},
                ),
                "end": (everywhere, end, units | {"long_name": "true error at the defect's end"}),
                **{name: (along, values, units) for name, values in theory.items()},
                "seed": (everywhere[1:], seeds.reshape(shape[1:])),
            },
            coords={
                "strategy": list(STRATEGIES),
                "angle": ("angle", angle, {"units": "rad", "long_name": "middle of the defect"}),
                "theta": ("theta", theta, {"units": "rad", "long_name": "middle, finer"}),
                "length": ("length", length, {"units": "m"}),
                "share": ("share", share, {"long_name": "deviation over the Red Book's"}),
            },
        )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        return checks_of(self.crossing, answer)

    def metrics(self, answer: Dataset) -> dict[str, float]:
        kept = answer["peak"] <= CAPTURE[self.crossing.axis]
        numbers = {
            "thesis_um": 1e6 * float(standing(red_book("focus").deviation, *WORST, 0.0)),
            **{
                f"{name}_um": 1e6 * float(abs(answer[name]).max())
                for name in ("standing", "free", "driven")
            },
        }
        for name in answer["strategy"].values:
            own, held = answer["peak"].sel(strategy=name), kept.sel(strategy=name)
            safe = held.sel(share=1.0).all("angle")
            beyond = answer["length"].where(~safe).min()
            numbers |= {
                f"survived_{name}": float(held.mean()),
                f"survived_red_book_{name}": float(held.sel(share=1.0).mean()),
                f"in_spec_red_book_{name}": float(
                    (own.sel(share=1.0) <= ACCEPTABLE_ERROR[self.crossing.axis]).mean()
                ),
                f"worst_red_book_{name}_um": 1e6 * float(own.sel(share=1.0).max()),
                f"first_lost_{name}_mm": 1e3 * float(beyond),
            }
        return numbers

    def tables(self, answer: Dataset) -> dict[str, str]:
        return tables_of(answer, self.metrics(answer))

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return figures_of(answer, self.crossing.axis)
