"""Stability while controllers switch, which the thesis leaves open (sections 8.5 to 8.7).

Section and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from workbench import Check, solve
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.study import Study, array, arrays, dim, part, system
from workbench.synthesis import SAMPLINGS, SwitchedStability, proven_share
from workbench.types import DataArray, Dataset, Figure, RealArray, StateSpace

from ...drive.photo_diodes import CAPTURE
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis, drives
from ..switched_laboratory import Rig
from ..switched_loop import MICRO
from .box import LABEL
from .checks import switching_checks
from .margins import CONTROLLERS, FREQUENCY
from .report import proven, switching_figures, switching_tables
from .switched_drives import DEFECTS, ROTATIONS, SwitchedDrives

STRATEGIES = ("open", "filter", "lower")
"""Strategies that are studied, see `switched_loop`."""
MULTIPLES: dict[Axis, tuple[float, ...]] = {"focus": (1.0, 2.0), "radial": (1.0,)}
"""Multiples of the parametric set that are tried, up to the first that cannot be proven."""
CASES = ("rotation", "envelope")
"""Discs, see `SwitchedDrives.disc`."""
DISTANCES = np.unique(np.geomspace(30, 4000, 12).round().astype(np.int64))
"""Distances between two defects [samples]."""
LENGTHS = 12
"""Number of lengths of simulated defects, up to the longest."""
SIZES = (0.1, 1.0)
"""Sizes of the disc's deviation in the laboratory over the largest one; at the first the optics are
linear.
"""


class Functions(NamedTuple):
    """A proven dwell time, the longest one found unstable [samples], and the functions P."""

    dwell: float
    unstable: int
    P: RealArray


def _proof(program: SwitchedStability) -> Functions:
    """The least dwell time found. Raises SolverError if none is proven."""
    found = solve(program)
    if found.answer is None or not (found.certificate and found.certificate.valid):
        raise SolverError(f"no dwell time is proven: {found.message}")
    return Functions(found.answer.samples, program.destabilising[0], found.answer.P)


def _each_drive(strategy: str) -> Any:
    """Declare the functions of a strategy for each drive."""
    state = f"state_{strategy}"
    meaning = f"functions of {strategy}, V = x' P x at each mode's entry"
    over = ("drive", "mode", state, f"{state}_")
    return array(
        dims=over,
        unit="",
        meaning=meaning,
        value=lambda proofs: np.stack([one.P for one in proofs[strategy]]),
    )


def _all_drives(strategy: str) -> Any:
    """Declare the functions of a strategy that hold for all drives at once."""
    over = ("mode", f"state_{strategy}", f"state_{strategy}_")
    return array(dims=over, value=lambda together: together[strategy].P if together else None)


@dataclass(frozen=True, eq=False)
class SwitchingStability(SwitchedDrives, Study):
    """Margins, dwell times, and errors of an axis."""

    common: bool

    headline: ClassVar[str] = "dwell_open"

    @property
    def quantifier(self) -> str:
        return "for these 12 drives"

    strategy = dim(STRATEGIES)
    case = dim(CASES)
    drive = dim(lambda self: [one.name for one in drives(self.axis)])
    mode = dim("clean", "defect")
    length = dim(lambda self: np.arange(1, self.longest + 1), unit="1")
    played = dim(lambda self: _lengths(self.longest), unit="1")
    tested = dim(lambda played: played.values[3::4], unit="1")
    size = dim(SIZES, unit="1")
    distance = dim(DISTANCES, unit="1")
    spaced = dim(DISTANCES[::2], unit="1")

    @system(called="lower")
    def K_prime(self) -> StateSpace:
        return self.lower

    # --- each controller by itself ------------------------------------------------------------

    controller = dim(CONTROLLERS)
    sampling = dim(SAMPLINGS)
    plant = dim(lambda self: list(self.alone.plants))
    late = dim("none", "delay")
    limit = dim("lower", "upper")
    frequency = dim(FREQUENCY, unit="Hz")

    @arrays(
        (controller, sampling, plant),
        gain_margin=("dB", "gain margin of the loops that are stable"),
        phase_margin=("deg", "phase margin of the loops that are stable"),
        growth=("1/s", "rate of the slowest motion"),
    )
    def margins(self) -> dict[str, Any]:
        found = self.alone.loops.margins()
        return {
            "gain_margin": found.gain_db,
            "phase_margin": found.phase_deg,
            "growth": found.growth,
        }

    nominal = part(lambda self: self.alone.nominal(FREQUENCY))
    L_real = array(
        dims=(controller, frequency), unit="1", meaning="", value=lambda nominal: nominal.real
    )
    L_imag = array(
        dims=(controller, frequency), unit="1", meaning="", value=lambda nominal: nominal.imag
    )
    mu = array(
        dims=(controller, late, limit),
        unit="1",
        meaning="mixed mu of robust stability, parametric set",
        value=lambda self, context: self.alone.robust(context),
    )

    # --- dwell times --------------------------------------------------------------------------

    switched = part(lambda self: {name: self.loops(name) for name in STRATEGIES})

    @part
    def proofs(self, switched: Any, context: Context) -> dict[str, list[Functions]]:
        """Dwell times of every drive, by strategy."""
        return {
            name: [
                _proof(self.program([loop]))
                for loop in context.track(loops, f"dwell times, {name}")
            ]
            for name, loops in switched.items()
        }

    @part
    def together(self, switched: Any, context: Context) -> dict[str, Functions]:
        """Dwell times with one set of functions for all drives, by strategy, if asked for."""
        wanted = STRATEGIES if self.common else ()
        tracked = context.track(list(wanted), "dwell times of all drives at once")
        return {name: _proof(self.program(switched[name])) for name in tracked}

    dwell = array(
        dims=(strategy, drive),
        unit="1",
        meaning="proven distance between defects, in samples",
        value=lambda proofs: [[one.dwell for one in each] for each in proofs.values()],
    )
    unstable = array(
        dims=(strategy, drive),
        unit="1",
        meaning="longest distance that a periodic switching makes unstable, of every pair of stays",
        value=lambda proofs: [[one.unstable for one in each] for each in proofs.values()],
    )
    dwell_common = array(
        dims=strategy,
        unit="1",
        meaning="proven distance, one set of functions for all drives",
        value=lambda together: [one.dwell for one in together.values()] or None,
    )
    P_open, P_filter, P_lower = map(_each_drive, STRATEGIES)
    P_common_open, P_common_filter, P_common_lower = map(_all_drives, STRATEGIES)

    # --- the parametric set, cell by cell -----------------------------------------------------

    boxes = part(lambda self, context: proven_share(self.box, MULTIPLES[self.axis], context))
    box_share = dim(lambda boxes: boxes.multiples, unit="1", meaning="multiple of the set")
    box_volume = array(
        dims=box_share, unit="1", meaning="proven volume", value=lambda boxes: boxes.volumes
    )
    box_of_cells = array(
        dims=(),
        unit="1",
        meaning="multiple that the cells fill",
        value=lambda boxes: boxes.multiple,
    )
    cell_low = array(
        dims=("cell", "parameter"), unit="", meaning=LABEL, value=lambda boxes: boxes.low
    )
    cell_high = array(
        dims=("cell", "parameter"), unit="", meaning=LABEL, value=lambda boxes: boxes.high
    )
    cell_P = array(dims=("cell", mode, "state_box", "state_box_"), value=lambda boxes: boxes.P)
    cell_dwell = array(
        dims="cell", unit="", meaning="proven distance, in samples", value=lambda boxes: boxes.dwell
    )

    # --- true errors --------------------------------------------------------------------------

    @array(
        dims=(strategy, case, length, distance),
        unit="um",
        meaning="true error proven at the stored frequencies, all drives",
    )
    def bound(self, switched: Any, proofs: Any, context: Context) -> RealArray:
        found = np.zeros((len(STRATEGIES), len(CASES), self.longest, len(DISTANCES)))
        for s, name in enumerate(context.track(list(STRATEGIES), "bounds of the error")):
            for loop, proof in zip(switched[name], proofs[name], strict=True):
                for c, case in enumerate(CASES):
                    one = self.deviations(loop, case).proven(proof.P, DISTANCES)
                    found[s, c] = np.maximum(found[s, c], one)
        return found

    @array(
        dims=(strategy, case, drive, played, spaced),
        unit="um",
        meaning="largest true error of six equal defects, worst phase",
    )
    def simulated(
        self, switched: Any, played: DataArray, spaced: DataArray, context: Context
    ) -> RealArray:
        found = np.zeros((len(STRATEGIES), len(CASES), len(self.lenses), played.size, spaced.size))
        for s, c, i in context.track(list(np.ndindex(found.shape[:3])), "simulated errors"):
            deviations = self.deviations(switched[STRATEGIES[s]][i], CASES[c])
            found[s, c, i] = [
                [deviations.simulated(int(n), int(d), DEFECTS) for d in spaced] for n in played
            ]
        return found

    @arrays((case, drive), alone=("um", "no switching"))
    def unswitched(self) -> dict[str, Any]:
        """Largest errors of the loops without switching."""
        loops = self.loops("none")
        errors = [[self.deviations(loop, case).steady_error for loop in loops] for case in CASES]
        return {"alone": [[abs(one).max() for one in each] for each in errors]}

    @array(
        dims=(size, strategy, drive, tested),
        unit="um",
        meaning="largest true error in the virtual laboratory",
    )
    def laboratory(self, drive: DataArray, tested: DataArray, context: Context) -> RealArray:
        """Errors at the highest rotation frequency.

        There defects last one sample longer, in which the light returns.
        """
        found = np.zeros((len(SIZES), len(STRATEGIES), drive.size, tested.size))
        false = self.false * MICRO
        rigs = [Rig(self.axis, one, ROTATIONS[-1], self.gain, self.delay, false) for one in SIZES]
        for place in context.track(list(np.ndindex(found.shape)), "laboratory"):
            size, strategy, i, length = place
            name, samples = str(drive.values[i]), int(tested[length]) - 1
            found[place] = rigs[size].largest_error(name, STRATEGIES[strategy], samples, self.lower)
        return found / MICRO

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
            found[f"undecided_{strategy}"] = float((one["dwell"] - 1 - one["unstable"]).max())
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


def _lengths(longest: int) -> Any:
    """Lengths of simulated defects [samples]."""
    return np.unique(np.linspace(1, longest, LENGTHS + 1).round().astype(np.int64)[1:])
