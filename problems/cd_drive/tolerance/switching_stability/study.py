"""Stability while controllers switch, which the thesis leaves open (sections 8.5 to 8.7).

Section and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from workbench import Check, Study, solve
from workbench.arrays import RealArray
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure
from workbench.synthesis import SwitchedStability
from workbench.systems.storage import stored

from ...drive.photo_diodes import CAPTURE
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis, drives
from ..switched_laboratory import Rig
from ..switched_loop import MICRO, SwitchedLoop
from .box import proven_share
from .checks import switching_checks
from .margins import CONTROLLERS
from .report import proven, switching_figures, switching_tables
from .switched_drives import DEFECTS, ROTATION, SwitchedDrives

STRATEGIES = ("open", "filter", "lower")
SHARES: dict[Axis, tuple[float, ...]] = {"focus": (1.0, 2.0), "radial": (1.0,)}
"""Multiples of the parametric set that are tried, up to the first that is not proven."""
CASES = ("rotation", "envelope")
DISTANCES = np.unique(np.geomspace(30, 4000, 12).round().astype(np.int64))
"""Between two defects [samples]."""
SPACED = DISTANCES[::2]
LENGTHS = 12
"""Of defects that are simulated, up to the longest, at every other distance."""
SIZES = (0.1, 1.0)
"""Of the disc in the laboratory over the largest deviation: the optics are linear for the first."""


@dataclass(frozen=True, eq=False)
class SwitchingStability(SwitchedDrives, Study):
    """Margins, dwell times, and errors of an axis."""

    common: bool

    headline: ClassVar[str] = "dwell_open"

    # --- answer -------------------------------------------------------------------------------

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        parts: dict[str, Any] = self.alone.margins() | self.alone.robust(context)
        bounds, sims = [], []
        dwell: list[list[float]] = []
        excluded: list[list[int]] = []
        lengths = self.lengths
        for strategy in STRATEGIES:
            loops = self.loops(strategy)
            tracked = context.track(loops, f"dwell times, {strategy}")
            found = [self._dwell(self.program([loop])) for loop in tracked]
            P = np.stack([each[2] for each in found])
            about = {"long_name": f"functions of {strategy}, V = x' P x at each mode's entry"}
            state = f"state_{strategy}"
            parts[f"P_{strategy}"] = (("drive", "mode", state, f"{state}_"), P, about)
            dwell.append([each[0] for each in found])
            excluded.append([each[1] for each in found])
            bound, sim = self._errors(context, loops, P, strategy)
            bounds.append(bound)
            sims.append(sim)
        parts |= self._common(context) | proven_share(self.box, SHARES[self.axis], context)
        samples, um = {"units": "1"}, {"units": "um"}
        place = ("strategy", "case", "length", "distance")
        return xr.Dataset(
            {
                **parts,
                **stored("lower", self.lower),
                "dwell": (
                    ("strategy", "drive"),
                    dwell,
                    samples | {"long_name": "proven distance between defects, in samples"},
                ),
                "unstable": (
                    ("strategy", "drive"),
                    excluded,
                    samples | {"long_name": "distance that a periodic switching makes unstable"},
                ),
                "bound": (
                    place,
                    bounds,
                    um | {"long_name": "true error proven at the stored frequencies, all drives"},
                ),
                "simulated": (
                    ("strategy", "case", "drive", "played", "spaced"),
                    sims,
                    um | {"long_name": "largest true error of six equal defects, worst phase"},
                ),
                "alone": (("case", "drive"), self._alone(), um | {"long_name": "no switching"}),
                "laboratory": (
                    ("size", "strategy", "drive", "tested"),
                    self._laboratory(context),
                    um | {"long_name": "largest true error in the virtual laboratory"},
                ),
            },
            coords={
                "strategy": list(STRATEGIES),
                "case": list(CASES),
                "drive": [drive.name for drive in drives(self.axis)],
                "mode": ["clean", "defect"],
                "length": ("length", np.arange(1, self.longest + 1), samples),
                "played": ("played", lengths, samples),
                "tested": ("tested", self.tested, samples),
                "size": ("size", list(SIZES), {"units": "1"}),
                "distance": ("distance", DISTANCES, samples),
                "spaced": ("spaced", SPACED, samples),
            },
        )

    @property
    def tested(self) -> Any:
        """Of the defects in the laboratory, with the sample in which the light comes back."""
        return self.lengths[3::4]

    @cached_property
    def lengths(self) -> Any:
        """Of the defects that are simulated [samples]."""
        return np.unique(np.linspace(1, self.longest, LENGTHS + 1).round().astype(np.int64)[1:])

    def _dwell(self, program: SwitchedStability) -> tuple[float, int, RealArray]:
        """The dwell time, what a periodic switching excludes, and the functions."""
        found = solve(program)
        if found.answer is None or not (found.certificate and found.certificate.valid):
            raise SolverError(f"no dwell time is proven: {found.message}")
        return found.answer.samples, program.destabilising[0], found.answer.P

    def _errors(
        self, context: Context, loops: list[SwitchedLoop], P: RealArray, strategy: str
    ) -> tuple[RealArray, RealArray]:
        """Bounds (case, length, distance), and simulated (case, drive, played, spaced)."""
        bound = np.zeros((len(CASES), self.longest, len(DISTANCES)))
        sim = np.zeros((len(CASES), len(loops), len(self.lengths), len(SPACED)))
        for i, loop in enumerate(context.track(loops, f"errors, {strategy}")):
            for c, case in enumerate(CASES):
                deviations = self.deviations(loop, case)
                bound[c] = np.maximum(bound[c], deviations.proven(P[i], DISTANCES))
                sim[c, i] = [
                    [deviations.simulated(int(n), int(d), DEFECTS) for d in SPACED]
                    for n in self.lengths
                ]
        return bound, sim

    def _alone(self) -> RealArray:
        """Largest error of the loop that never switches (case, drive)."""
        loops = self.loops("none")
        return np.array(
            [
                [abs(self.deviations(loop, case).steady_error).max() for loop in loops]
                for case in CASES
            ]
        )

    def _laboratory(self, context: Context) -> RealArray:
        """Largest true errors [um] at the fastest rotation (size, strategy, drive, tested)."""
        found = np.zeros((len(SIZES), len(STRATEGIES), len(self.lenses), len(self.tested)))
        rigs = [
            Rig(self.axis, size, ROTATION[-1], self.gain, self.delay, self.false * MICRO)
            for size in SIZES
        ]
        names = [drive.name for drive in drives(self.axis)]
        for place in context.track(list(np.ndindex(found.shape)), "laboratory"):
            size, strategy, drive, length = place
            found[place] = rigs[size].largest_error(
                names[drive], STRATEGIES[strategy], int(self.tested[length]) - 1, self.lower
            )
        return found / MICRO

    def _common(self, context: Context) -> dict[str, Any]:
        """With one set of functions for all drives."""
        if not self.common:
            return {}
        found = [
            self._dwell(self.program(self.loops(strategy)))
            for strategy in context.track(list(STRATEGIES), "dwell times of all drives at once")
        ]
        about = {"units": "1", "long_name": "proven distance, one set of functions for all drives"}
        parts: dict[str, Any] = {"dwell_common": ("strategy", [each[0] for each in found], about)}
        for strategy, each in zip(STRATEGIES, found, strict=True):
            state = f"state_{strategy}"
            parts[f"P_common_{strategy}"] = (("mode", state, f"{state}_"), each[2])
        return parts

    # --- checks, metrics, report --------------------------------------------------------------

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        return switching_checks(self, answer)

    def metrics(self, answer: Dataset) -> dict[str, float]:
        found = {}
        for name, word in zip(CONTROLLERS, ("K", "filter", "lower"), strict=True):
            one = answer.sel(controller=name, plant="nominal", sampling="sampled")
            found[f"gain_margin_{word}_db"] = float(one["gain_margin"])
            found[f"phase_margin_{word}_deg"] = float(one["phase_margin"])
            found[f"mu_{word}"] = float(
                answer["mu"].sel(controller=name, late="delay", limit="upper")
            )
        for strategy in STRATEGIES:
            one = answer.sel(strategy=strategy)
            found[f"dwell_{strategy}"] = float(one["dwell"].max())
            found[f"unstable_{strategy}"] = float(one["unstable"].max())
            if self.common:
                found[f"dwell_common_{strategy}"] = float(one["dwell_common"])
            for case in CASES:
                far = one["bound"].sel(case=case).isel(distance=[-1]).values * MICRO
                for word, limit in (("longest", ACCEPTABLE_ERROR), ("kept", CAPTURE)):
                    found[f"{word}_{strategy}_{case}_mm"] = float(proven(far, limit[self.axis])[0])
        found["box"] = float(answer["box_of_cells"])
        found["box_volume"] = float(answer["box_volume"][0])
        found["box_dwell"] = float(answer["cell_dwell"].max()) if answer.sizes["cell"] else np.inf
        return found

    def tables(self, answer: Dataset) -> dict[str, str]:
        return switching_tables(self.axis, answer)

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return switching_figures(self.axis, answer)
