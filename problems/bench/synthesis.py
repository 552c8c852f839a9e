"""How fast and how good synthesis is, against dkpy and python-control's hinfsyn."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar

import numpy as np
from pydantic import Field

from workbench import Check, Study, figures, problem, solve
from workbench.errors import SolverError
from workbench.executor import WALL_TIME, Context
from workbench.mu import upper_bound
from workbench.synthesis import MuController, MuSynthesis, hinf, regularised
from workbench.synthesis.hinf_riccati import central
from workbench.synthesis.loops import restored, stored
from workbench.synthesis.standard import realisation
from workbench.uncertainty import GeneralisedPlant
from workbench.uncertainty.generalised import response

from ..cd_drive.control_problem import generalised
from ..cd_drive.parametric import parametric_plant
from ..cd_drive.sets import TABLES
from ..cd_drive.tables import Axis
from ..textbook.distillation import distillation_column
from .synthesis_peers import ITERATIONS, OMEGA, achieved, dk_iteration, hinfsyn

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

T = TypeVar("T")
SIZES = (10, 20, 40)
"""States of the random plants."""
FASTER, SLOWER = 20.0, 5.0
"""Least ratio of dkpy's time to ours, and largest of ours to hinfsyn's, that are asked for."""
ABOVE = 1e-3
"""Largest excess of our norm over hinfsyn's asked for, relative."""
SAME = 1e-9
"""Largest difference of the two distillation plants, relative."""
HONEST, WORSE = 1.01, 2.0
"""A peer fails whose loop's norm is larger than it claims, or than ours, by such a factor."""
SMALL = 1e-4
"""Size of what makes the CD drive's plant regular."""
REPEATS = 3
DENSE = np.logspace(-6, 6, 4000)
"""Frequencies [rad/s] at which the peak of dkpy's loop is looked for again."""
DRIVE = "CD drive"


@problem("bench/synthesis", data=tuple(f"../cd_drive/{name}" for name in TABLES), slow=True)
def synthesis(
    largest: Annotated[int, Field(ge=2)] = 40,
    plants: Annotated[int, Field(ge=1)] = 3,
    distillation: bool = True,
    drives: bool = True,
) -> SynthesisSpeed:
    """Speed and success of synthesis: ratios to dkpy and to python-control's hinfsyn.

    So many random plants each of 10, 20 and 40 states, to the largest, by H-infinity synthesis.
    The control problems of the CD drive in SI units, nominal and with the channels of parametric
    uncertainty. The distillation column by D-K iteration until the certified peak of mu is at most
    the one that dkpy claims for the same plant.

    drives: whether the CD drive is among them. distillation: whether dkpy, which must be installed,
    is run.
    """
    sizes = tuple(size for size in SIZES if size <= largest) or (largest,)
    return SynthesisSpeed(sizes, plants, drives, distillation)


@dataclass(frozen=True)
class SynthesisSpeed(Study):
    """Times, norms and peaks of our controllers and of the peers', taken in one run."""

    sizes: tuple[int, ...]
    plants: int
    drives: bool
    distillation: bool

    headline: ClassVar[str] = "dkpy_over_ours"

    @property
    def groups(self) -> list[str]:
        return [*map(_states, self.sizes), *([DRIVE] if self.drives else [])]

    def compute(self, context: Context) -> xr.Dataset:
        import xarray as xr

        hinf(random_plant(np.random.default_rng(0), 2))  # compile before the clock starts
        cases = [
            (_states(size), f"random {number}", random_plant(context.rng, size))
            for size in self.sizes
            for number in range(1, self.plants + 1)
        ]
        if self.drives:
            cases += [(DRIVE, name, plant) for name, plant in drive_plants().items()]
        rows = [_compared(plant) for _, _, plant in context.track(cases, "H-infinity")]
        seconds, bare, norms, claims = (np.array(part) for part in zip(*rows, strict=True))
        one, wall = {"units": "1"}, {"units": "s"} | WALL_TIME
        found = xr.Dataset(
            {
                "group": ("case", [group for group, _, _ in cases]),
                "seconds": (("case", "by"), seconds, wall),
                "riccati_seconds": ("case", bare, wall),
                "norm": (("case", "by"), norms, one | {"long_name": "norm of the loop"}),
                "claim": (("case", "by"), claims, one | {"long_name": "level claimed"}),
            },
            coords={
                "case": [f"{group}, {name}" for group, name, _ in cases],
                "by": ["workbench", "hinfsyn"],
            },
        )
        return found.assign(_dk_iterations(context)) if self.distillation else found

    # --- checks and metrics -------------------------------------------------------------------

    def checks(self, answer: xr.Dataset, tolerance: float) -> list[Check]:
        found = []
        for group in self.groups:
            some = _of(answer, group)
            statement = f"time over hinfsyn's, asked to be at most {SLOWER:g}, at worst"
            found.append(Check(f"{group}, time", statement, _slower(some), SLOWER))
            statement = "norm over hinfsyn's where it succeeds, less 1, at worst"
            found.append(Check(f"{group}, norm", statement, _excess(some), ABOVE))
            statement = "plants without a certified controller of ours"
            lost = float(np.isinf(some["norm"].sel(by="workbench")).sum())
            found.append(Check(f"{group}, success", statement, lost, 0.0))
        if self.distillation:
            upper = math.inf
            certified = MuSynthesis(distillation_column()).certified(restored(answer, "own"))
            if certified is not None:
                upper = certified.upper
            claimed = float(answer["dk_peak"].sel(package="dkpy"))
            statement = "certified peak of mu over the one dkpy claims, less 1"
            found += [
                Check("same column", "difference of plants", float(answer["dk_apart"]), SAME),
                Check("peak", statement, upper / claimed - 1.0, 0.0),
                Check(
                    "time to dkpy's peak",
                    f"over dkpy's, asked to be at most 1/{FASTER:g}",
                    1.0 / _faster(answer),
                    1.0 / FASTER,
                ),
            ]
        return found

    def metrics(self, answer: xr.Dataset) -> dict[str, float]:
        numbers = {}
        for group in self.groups:
            some, name = _of(answer, group), group.replace(" states", "").replace(" ", "_")
            bare = some["riccati_seconds"] / some["seconds"].sel(by="hinfsyn")
            numbers[f"hinf_over_hinfsyn_{name}"] = _slower(some)
            numbers[f"riccati_over_hinfsyn_{name}"] = float(bare.max())
            numbers[f"norm_over_hinfsyn_{name}"] = 1.0 + _excess(some)
            numbers[f"hinfsyn_failures_{name}"] = float(failed(some).sum())
        if self.distillation:
            numbers["dkpy_over_ours"] = _faster(answer)
            for package, name in (("workbench", ""), ("dkpy", "_dkpy")):
                one = answer.sel(package=package)
                numbers[f"peak{name}"] = float(one["dk_peak"])
                numbers[f"order{name}"] = float(one["dk_states"])
        return numbers

    # --- figures and tables -------------------------------------------------------------------

    def figures(self, answer: xr.Dataset) -> dict[str, Figure]:
        figure, (times, norms) = figures.axes(1, 2, size=(10.0, 4.4))
        place = np.arange(answer["case"].size)
        own, theirs = (answer.sel(by=name) for name in answer["by"].values)
        times.plot(own["seconds"], place, "o", label="workbench, certified")
        times.plot(answer["riccati_seconds"], place, "|", ms=10, label="its Riccati method alone")
        times.plot(theirs["seconds"], place, "s", label="hinfsyn")
        times.set_xlabel("time of a controller [s]")
        times.set_yticks(place, list(answer["case"].values))
        norms.plot(own["norm"] / own["claim"], place, "o")
        # Loops that are not stable stand at the right edge.
        ratio = (theirs["norm"] / own["claim"]).values
        stable = np.isfinite(ratio)
        most = 10.0 ** np.ceil(np.log10(max(10.0, float(ratio[stable].max(initial=1.0))))) * 10.0
        norms.plot(ratio[stable], place[stable], "s", color=figures.GREEN, label="hinfsyn, norm")
        norms.plot(
            np.full((~stable).sum(), most),
            place[~stable],
            "x",
            color=figures.ORANGE,
            label="hinfsyn, unstable",
        )
        norms.plot(
            theirs["claim"] / own["claim"],
            place,
            "s",
            mfc="none",
            color=figures.GREEN,
            label="hinfsyn, claim",
        )
        norms.set_xlabel("norm of the loop over our level")
        norms.set_yticks(place, [""] * len(place))
        for panel in (times, norms):
            panel.set_xscale("log")
            panel.invert_yaxis()
        handles = [panel.get_legend_handles_labels() for panel in (times, norms)]
        figure.legend(
            *(a + b for a, b in zip(*handles, strict=True)),
            loc="outside lower center",
            ncols=3,
            frameon=False,
        )
        return {"hinf": figure}

    def tables(self, answer: xr.Dataset) -> dict[str, str]:
        lines = [
            "| plant | time | Riccati method | hinfsyn's | norm | hinfsyn's | it claims |",
            "| :--- |" + " ---: |" * 6,
        ]
        for case in answer["case"].values:
            one = answer.sel(case=case)
            own, theirs = (one.sel(by=name) for name in answer["by"].values)
            times = own["seconds"], one["riccati_seconds"], theirs["seconds"]
            cells = [f"{float(value):.3g} s" for value in times]
            values = own["norm"], theirs["norm"], theirs["claim"]
            cells += [f"{float(value):.6g}" for value in values]
            lines.append(f"| {case} | {' | '.join(cells)} |")
        found = {"hinf": "\n".join(lines) + "\n"}
        if not self.distillation:
            return found
        lines = [
            "| package | time | controllers made | states | peak claimed | mu attained |",
            "| :--- |" + " ---: |" * 5,
        ]
        for package in answer["package"].values:
            one = answer.sel(package=package)
            lines.append(
                f"| {package} | {float(one['dk_seconds']):.3g} s | {int(one['dk_rounds'])} | "
                f"{int(one['dk_states'])} | {float(one['dk_peak']):.4f} | "
                f"{float(one['dk_lower']):.4f} |"
            )
        return found | {"distillation": "\n".join(lines) + "\n"}


def random_plant(rng: np.random.Generator, states: int) -> GeneralisedPlant:
    """Stable, its rightmost pole at -0.1 rad/s, with two controls and two measurements.

    z = (C1 x, u) and y = C2 x + w2, so that every assumption of H-infinity synthesis holds.
    """
    import control

    A = rng.normal(size=(states, states)) / math.sqrt(states)
    A -= (np.linalg.eigvals(A).real.max() + 0.1) * np.eye(states)
    B, C = rng.normal(size=(states, 6)), rng.normal(size=(6, states))
    C[2:4], B[:, 2:4] = 0.0, 0.0
    D = np.zeros((6, 6))
    D[2:4, 4:], D[4:, 2:4] = np.eye(2), np.eye(2)
    return GeneralisedPlant(control.ss(A, B / states**0.5, C / states**0.5, D), None, 2, 2)


def drive_plants() -> dict[str, GeneralisedPlant]:
    """The control problems of both axes, made regular: nominal ones and the whole ones."""
    found = {}
    axes: tuple[Axis, ...] = ("focus", "radial")
    for axis in axes:
        plant = generalised(axis, parametric_plant(axis))
        for name, one in (("nominal", _nominal(plant)), ("parametric", plant)):
            found[f"{axis} {name}"] = regularised(one, SMALL)
    return found


def _nominal(plant: GeneralisedPlant) -> GeneralisedPlant:
    """w_p, u -> z_p, z_u, y without the perturbation."""
    part = plant.channel(["z_p", "z_u"], "w_p")
    assert part.structure is not None
    system, rows, columns = part.system, part.structure.columns, part.structure.rows
    matrices = system.A, system.B[:, columns:], system.C[rows:], system.D[rows:, columns:]
    labels = {"inputs": system.input_labels[columns:], "outputs": system.output_labels[rows:]}
    return GeneralisedPlant(realisation(matrices, 0.0, **labels), None, 1, 1)


def failed(some: xr.Dataset) -> np.ndarray:
    """Where hinfsyn gives no controller, one that does not stabilise, or one far from its claim."""
    own, theirs = (some["norm"].sel(by=name).values for name in ("workbench", "hinfsyn"))
    claimed = theirs <= HONEST * some["claim"].sel(by="hinfsyn").values
    lost: np.ndarray = ~(np.isfinite(theirs) & claimed & (theirs <= WORSE * own))
    return lost


def _compared(
    plant: GeneralisedPlant,
) -> tuple[tuple[float, float], float, tuple[float, float], tuple[float, float]]:
    """Times, that of the bare method, norms and claims of us and of hinfsyn."""
    system = plant.system
    matrices = system.A, system.B, system.C, system.D
    bare, _ = _timed(partial(central, *matrices, plant.controls, plant.measurements), REPEATS)
    norm, level = math.inf, math.nan
    try:
        seconds, answer = _timed(partial(hinf, plant), REPEATS)
        norm, level = achieved(plant, answer.K), answer.gamma
    except SolverError:
        seconds = math.nan
    theirs = hinfsyn(plant)
    reached = achieved(plant, theirs.K)
    return (seconds, theirs.seconds), bare, (norm, reached), (level, theirs.claim)


def _dk_iterations(context: Context) -> dict[str, Any]:
    for _ in context.track([0], "dkpy"):
        theirs, plant = dk_iteration()
    own = distillation_column()
    a, b = response(own.system, OMEGA), response(plant, OMEGA)
    program = MuSynthesis(own, target=theirs.claim)
    solve(program, "dk")  # compile before the clock starts
    runs = [solve(program, "dk") for _ in context.track(range(REPEATS), "D-K iteration")]
    answer: MuController = runs[0].answer
    if answer is None:
        raise SolverError(runs[0].message)
    seconds = min(run.seconds["solve"] for run in runs)  # a certified peak among them
    assert theirs.K is not None
    loop = own.close(theirs.K)
    seen = float(upper_bound(response(loop, DENSE), program.closed).value.max())
    package, one, wall = ("package",), {"units": "1"}, {"units": "s"} | WALL_TIME
    return {
        "package": (package, ["workbench", "dkpy"]),
        "dk_seconds": (package, [seconds, theirs.seconds], wall),
        "dk_peak": (package, [answer.upper, theirs.claim], one | {"long_name": "peak claimed"}),
        "dk_lower": (package, [answer.lower, seen], one | {"long_name": "mu seen"}),
        "dk_states": (package, [answer.K.nstates, theirs.K.nstates]),
        "dk_rounds": (package, [len(answer.history), ITERATIONS + 1]),
        "dk_apart": ((), float(np.abs(a - b).max() / np.abs(a).max()), one),
        **stored("own", answer.K),
    }


def _states(size: int) -> str:
    return f"{size} states"


def _of(answer: xr.Dataset, group: str) -> xr.Dataset:
    return answer.isel(case=np.flatnonzero(answer["group"].values == group))


def _slower(some: xr.Dataset) -> float:
    """The largest ratio of our time to hinfsyn's."""
    seconds = some["seconds"]
    return float((seconds.sel(by="workbench") / seconds.sel(by="hinfsyn")).max(skipna=False))


def _excess(some: xr.Dataset) -> float:
    """The largest of our norm over hinfsyn's, less 1, where both stabilise; -1 where none does."""
    own, theirs = some["norm"].sel(by="workbench"), some["norm"].sel(by="hinfsyn")
    both = np.isfinite(own) & np.isfinite(theirs)
    return float((own / theirs).where(both, 0.0).max()) - 1.0


def _faster(answer: xr.Dataset) -> float:
    seconds = answer["dk_seconds"]
    return float(seconds.sel(package="dkpy") / seconds.sel(package="workbench"))


def _timed(work: Callable[[], T], repeats: int) -> tuple[float, T]:
    """The least time of some runs, and what the last one gave."""
    best = math.inf
    for _ in range(repeats):
        start = time.perf_counter()
        result = work()
        best = min(best, time.perf_counter() - start)
    return best, result
