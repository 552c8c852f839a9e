"""How far the focus point strays while a defect passes, and which defects each strategy survives.

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, Annotated, ClassVar, NamedTuple

import numpy as np
from pydantic import Field
from scipy.integrate import solve_ivp

from workbench import Check, Run, Study, problem, ref
from workbench.executor import Context
from workbench.simulation import Cascade
from workbench.synthesis.loops import restored

from .actuator import Real
from .bench_setup import RATE
from .disc import VELOCITY, Defect, Disc
from .excursion_report import figures_of, tables_of
from .excursion_theory import BlindLens, standing
from .laboratory import Laboratory
from .photo_diodes import CAPTURE
from .record import Record
from .red_book import ACCEPTABLE_ERROR
from .sets import TABLES
from .strategies import STRATEGIES, Strategies, clean_level
from .tables import Axis, red_book

if TYPE_CHECKING:
    import xarray as xr
    from control import StateSpace
    from matplotlib.figure import Figure

MET = 0.45
"""When the defect begins [s]: strategies A and B have learnt the rotation by then."""
AFTER = 5e-3
"""How long after the defect the error is looked at [s]."""
LENGTHS = (0.3e-3, 2.5e-3)
"""Shortest and longest defect [m]; the error correction repairs 2.5 mm."""
SHARES = (0.25, 0.5, 1.0, 1.5, 2.0)
"""Amplitudes of the disc's deviation over what the Red Book allows."""
THESIS = (9.0, 1.9e-3)
"""Rotation [Hz] and duration [s] with which eq. 8.1 gives 53.7 um."""


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
    return Excursion(axis, replacement, drive, rotation, angles, lengths, depth, swing)


class Cell(NamedTuple):
    """One defect on one disc: its middle [rad of the deviation], length [m], deviation [m]."""

    angle: float
    length: float
    deviation: float


@dataclass(frozen=True, eq=False)
class Excursion(Study):
    """Every strategy over angle, length and deviation, and what eq. 8.1 says of them."""

    axis: Axis
    replacement: StateSpace
    drive: str
    rotation: float
    angles: int
    lengths: int
    depth: float
    swing: float

    headline: ClassVar[str] = "survived_reference"

    @property
    def allowed(self) -> float:
        """The deviation that the Red Book allows [m]."""
        return red_book(self.axis).deviation

    def disc(self, cell: Cell) -> Disc:
        middle = MET + cell.length / VELOCITY / 2
        phase = (cell.angle / (2 * np.pi) - self.rotation * middle) % 1.0
        focus = self.axis == "focus"
        return Disc(
            warp=(cell.deviation,) if focus else (),
            eccentricity=() if focus else (cell.deviation,),
            rotation=self.rotation,
            phase=phase,
        )

    def defect(self, cell: Cell) -> Defect:
        """Met once, from MET on."""
        where = (self.rotation * MET + self.disc(cell).phase) % 1.0
        return Defect(
            length=cell.length,
            angle=where,
            depth=self.depth,
            displacement=self.swing * ACCEPTABLE_ERROR[self.axis],
            present=(MET - 1e-6, MET + 1.5 * cell.length / VELOCITY),
        )

    def run(self, cell: Cell, strategy: str, seed: int, refine: int = 1) -> Record:
        """The laboratory from the disc's run-up until AFTER the defect."""
        bench = Laboratory(self.axis, self.drive, refine=refine)
        return bench.closed_loop(
            self.strategies[strategy],
            duration=MET + cell.length / VELOCITY + AFTER,
            disc=self.disc(cell),
            defects=[self.defect(cell)],
            seed=seed,
        )

    @cached_property
    def strategies(self) -> dict[str, Cascade]:
        """All of them, by name."""
        level = clean_level(Laboratory(self.axis, self.drive))
        made = Strategies(self.axis, level, self.rotation, replacement=self.replacement)
        return {name: made.named(name) for name in STRATEGIES}

    def compute(self, context: Context) -> xr.Dataset:
        import xarray as xr

        angle = np.pi * np.arange(self.angles) / self.angles
        length = np.linspace(*LENGTHS, self.lengths)
        share = np.array(SHARES)
        grid = list(product(range(self.angles), range(self.lengths), range(len(share))))
        shape = (len(STRATEGIES), self.angles, self.lengths, len(share))
        peak, end = np.zeros(shape), np.zeros(shape)
        seeds = context.rng.integers(2**31, size=len(grid))
        for place, seed in context.track(list(zip(grid, seeds, strict=True)), "defects"):
            i, j, k = place
            cell = Cell(angle[i], length[j], share[k] * self.allowed)
            for s, name in enumerate(STRATEGIES):
                record = self.run(cell, name, int(seed))
                peak[s, i, j, k], end[s, i, j, k] = excursion_of(record, cell.length)
        time = length / VELOCITY
        lens = {
            driven: BlindLens(self.axis, self.drive, self.allowed, self.rotation, driven)
            for driven in (False, True)
        }
        everywhere, along = ("strategy", "angle", "length", "share"), ("theta", "length")
        units, theta = {"units": "m"}, np.unique(np.append(np.radians(np.arange(0, 181, 3)), angle))
        theory = {
            "standing": standing(self.allowed, self.rotation, time, theta[:, None]),
            "free": np.transpose([lens[False].error(each, theta) for each in time]),
            "driven": np.transpose([lens[True].error(each, theta) for each in time]),
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

    def checks(self, answer: xr.Dataset, tolerance: float) -> list[Check]:
        reference = answer.sel(strategy="reference", share=1.0)
        full = float(abs(answer["standing"]).max())
        driven = answer["driven"].sel(theta=answer["angle"]).drop_vars("theta")
        # The false displacement gets through while the light fades and comes back.
        scale = abs(driven).max("angle") + self.swing * ACCEPTABLE_ERROR[self.axis]
        apart = abs(reference["end"] - driven) / scale
        kept = reference["peak"] < CAPTURE[self.axis] / 2  # where the diodes are about linear
        return [
            Check(
                "equation 8.1", "largest difference from the disc [m]", self._disc_off(answer), 1e-9
            ),
            Check("53.7 um", "relative difference", self._thesis_off(), 1e-3),
            Check(
                "lens in flight", "difference from an integration", self._flight_off(answer), 1e-6
            ),
            Check(
                "order",
                "free over standing lens, worst angle and length",
                float(abs(answer["free"]).max()) / full,
                0.1,
            ),
            Check(
                "reference strategy",
                "its end off the blind controller's, over the worst angle's and the swing",
                float(apart.where(kept).max()) if bool(kept.any()) else np.nan,
                0.3,
            ),
            Check(
                "replay", "change of a kept peak at half the step", self._replay_off(answer), 0.02
            ),
            Check(
                "harder",
                "share of defects kept though lost at a smaller deviation, reference",
                self._reversed(answer),
                0.05,
            ),
        ]

    def _disc_off(self, answer: xr.Dataset) -> float:
        """Equation 8.1 against where the laboratory's disc is before and after the defect."""
        worst = 0.0
        for angle, length in product(answer["theta"].values, answer["length"].values):
            disc = self.disc(Cell(angle, length, self.allowed))
            before, after = disc.deviation(self.axis, np.array([MET, MET + length / VELOCITY]))
            stored = float(answer["standing"].sel(theta=angle, length=length))
            worst = max(worst, abs(stored - (after - before)))
        return worst

    def _thesis_off(self) -> float:
        focus = red_book("focus").deviation
        return abs(float(standing(focus, *THESIS, 0.0)) / 53.7e-6 - 1.0)

    def _flight_off(self, answer: xr.Dataset) -> float:
        """Stored flights against an integration of the same equations; relative to the largest."""
        worst, angle, length = 0.0, answer["theta"].values[1], answer["length"].values[-1]
        for name, driven in (("free", False), ("driven", True)):
            lens = BlindLens(self.axis, self.drive, self.allowed, self.rotation, driven)
            step = length / VELOCITY
            start = np.imag(lens.steady * np.exp(1j * (angle - lens.omega * step / 2)))
            # Displacements are micrometres, memories of the controller large: each by its size.
            size = np.maximum(abs(lens.steady), 1e-300)
            flight = solve_ivp(
                lambda _, z, F=lens.free, size=size: F @ (z * size) / size,
                (0.0, step),
                start / size,
                method="LSODA",
                rtol=1e-11,
                atol=1e-13,
            )
            x = flight.y[0, -1] * size[0]  # the lens is the first of the states
            stored = float(answer[name].sel(theta=angle, length=length))
            disc = self.allowed * np.sin(angle + lens.omega * step / 2)
            worst = max(worst, abs(disc - x - stored) / self.allowed)
        return worst

    def _replay_off(self, answer: xr.Dataset) -> float:
        """A defect of middle length at the first angle, again with the optics at half the step."""
        place = answer.isel(angle=0, length=self.lengths // 2).sel(share=1.0)
        cell = Cell(float(place["angle"]), float(place["length"]), self.allowed)
        off = [0.0]
        for name in answer["strategy"].values:
            stored = float(place["peak"].sel(strategy=name))
            if stored < CAPTURE[self.axis]:  # a lost loop is chaotic
                again = self.run(cell, str(name), int(place["seed"]), refine=2)
                off.append(abs(excursion_of(again, cell.length)[0] / stored - 1.0))
        return max(off)

    def _reversed(self, answer: xr.Dataset) -> float:
        kept = (answer["peak"].sel(strategy="reference") <= CAPTURE[self.axis]).values
        return float((kept[..., 1:] & ~kept[..., :-1]).mean())

    def metrics(self, answer: xr.Dataset) -> dict[str, float]:
        kept = answer["peak"] <= CAPTURE[self.axis]
        numbers = {
            "thesis_um": 1e6 * float(standing(red_book("focus").deviation, *THESIS, 0.0)),
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
                    (own.sel(share=1.0) <= ACCEPTABLE_ERROR[self.axis]).mean()
                ),
                f"worst_red_book_{name}_um": 1e6 * float(own.sel(share=1.0).max()),
                f"first_lost_{name}_mm": 1e3 * float(beyond),
            }
        return numbers

    def tables(self, answer: xr.Dataset) -> dict[str, str]:
        return tables_of(answer, self.metrics(answer))

    def figures(self, answer: xr.Dataset) -> dict[str, Figure]:
        return figures_of(answer, self.axis)


def excursion_of(record: Record, length: float) -> tuple[float, float]:
    """Largest size of the true error [m] from the defect's start on, and the error at its end."""
    error: Real = record.x_cd - record.x
    start, end = round(MET * RATE), round((MET + length / VELOCITY) * RATE)
    return float(abs(error[start:]).max()), float(error[end])
