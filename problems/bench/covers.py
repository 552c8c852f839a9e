"""How fast a cover by stadiums is, against the same steps by convex programs per frequency."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, fields
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Options, Study, figures, problem, solve
from workbench.errors import SolverError
from workbench.executor import WALL_TIME, Context
from workbench.fitting import MagnitudeFit, ResponseFit
from workbench.geometry import narrowest_stadium
from workbench.heavy_types import Dataset, Figure
from workbench.uncertainty import CircleCover, CoverSteps, Responses, StadiumCover, limited
from workbench.uncertainty.covers.sets import stadiums_about_nominal
from workbench.uncertainty.covers.weights import needed_radius, unwrapped

from ..cd_drive.drive.actuator import specific_model, stack
from ..cd_drive.drive.plants import nominal_parameters, total_gain
from ..cd_drive.drive.shared_parameters import TABLES
from ..cd_drive.drive.tables import ActuatorParameters, nominal_table
from ..cd_drive.uncertainty.measured_drives import measured_drives
from .scanned import ScannedStadiums

ORDER, ZEROS, WEIGHT = 4, 2, 4
"""Orders of the nominal, its zeros, and of both weights."""
WANTED = 20.0
"""How many times faster than the peer the seven steps must be."""
SECONDS, GIBIBYTES = 60.0, 2.0
"""What the large family may take."""
CLOSE = 0.02
"""How much wider than the narrowest the peer's stadiums may be in the median, relative."""


@problem("bench/covers", data=tuple(f"../cd_drive/{name}" for name in TABLES))
def covers(
    frequencies: Annotated[int, Field(ge=10)] = 400,
    plants: Annotated[int, Field(ge=2, le=10_000)] = 1000,
    grid: Annotated[int, Field(ge=10, le=10_000)] = 1000,
) -> CoverSpeed:
    """Speed of the whole focus stadium cover: ratio to the same seven steps through CVXPY.

    Twelve drives at so many frequencies. The peer asks Clarabel through CVXPY, by parametrised
    programs that are re-solved, at each frequency for the narrowest stadium at each of a scan of
    angles, and for every fit. Then the same cover, by both methods, of so many plants on so large
    a grid, drawn from the tolerances of Table 5.2.
    """
    return CoverSpeed(frequencies, plants, grid)


@dataclass(frozen=True)
class CoverSpeed(Study):
    """Times of the seven steps and of their peer on the same responses, in one run."""

    frequencies: int
    plants: int
    grid: int

    headline: ClassVar[str] = "steps_over_conic"

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        drives = measured_drives("focus", self.frequencies, 5.0, 5000.0)
        cover = _cover(drives)
        _timed(_cover(measured_drives("focus", 10, 5.0, 5000.0)), "steps", context)  # compile
        own, seconds = _timed(cover, "steps", context)
        start = time.perf_counter()
        scan = ScannedStadiums(cover.points.shape[1], context)
        peer = _by_conic(cover, scan, context)
        conic = time.perf_counter() - start
        large = _family(self.plants, self.grid, context.rng)
        _, large_steps = _timed(_cover(large), "steps", context)
        _, large_joint = _timed(_cover(large), "joint", context)
        _, large_circle = _timed(CircleCover(large, ORDER, ZEROS, WEIGHT), "joint", context)
        tasks = {
            "steps": seconds,
            "conic": conic,
            "large, steps": large_steps,
            "large, joint": large_joint,
            "large, circles": large_circle,
        }
        wall = {"units": "s"} | WALL_TIME
        first = own.first.radius
        return xr.Dataset(
            {
                "seconds": ("task", list(tasks.values()), wall),
                "memory": ((), _peak_memory(), {"units": "GiB"} | WALL_TIME),
                "exact": ("frequency", first, {"units": "units/V"}),
                "scanned": ("frequency", peer, {"units": "units/V"}),
            },
            coords={
                "task": list(tasks),
                "frequency": ("frequency", drives.frequency, {"units": "Hz"}),
            },
        )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        apart = float((answer["scanned"] / answer["exact"] - 1).median())
        below = float((1 - answer["scanned"] / answer["exact"]).max())
        large = answer["seconds"].sel(task=[t for t in answer["task"].values if "large" in t])
        asked = 1 / WANTED
        ratio = 1 / self.metrics(answer)["steps_over_conic"]
        return [
            Check("peer near", "excess of the median scanned width, relative", apart, CLOSE),
            Check("peer not below", "the narrowest width over a scanned one", below, 1e-6),
            Check("steps over conic", f"time over the peer's, at most {asked:.3g}", ratio, asked),
            Check("large seconds", "longest cover of the family [s]", float(large.max()), SECONDS),
            Check("memory", "peak of the process [GiB]", float(answer["memory"]), GIBIBYTES),
        ]

    def metrics(self, answer: Dataset) -> dict[str, float]:
        seconds = answer["seconds"]
        return {
            "steps_over_conic": float(seconds.sel(task="conic") / seconds.sel(task="steps")),
            "large_over_small": float(seconds.sel(task="large, steps") / seconds.sel(task="steps")),
            "memory_gib": float(answer["memory"]),
        }

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        figure, (panel,) = figures.axes(size=(7.5, 3.4))
        seconds = answer["seconds"] / answer["seconds"].sel(task="steps")
        labels = {
            "steps": "seven steps, twelve drives",
            "conic": "the same through CVXPY",
            "large, steps": f"seven steps, {self.plants} plants",
            "large, joint": f"joint stadiums, {self.plants} plants",
            "large, circles": f"joint circles, {self.plants} plants",
        }
        place = np.arange(seconds.size)
        panel.barh(place, seconds.values, color=figures.BLUE, height=0.55)
        for y, value in zip(place, seconds.values, strict=True):
            panel.annotate(
                f"{value:.3g}", (value, y), (4, 0), textcoords="offset points", va="center"
            )
        panel.set_yticks(place, [labels[str(task)] for task in answer["task"].values])
        panel.invert_yaxis()
        panel.set_xscale("log")
        panel.set_xlabel("time over that of the seven steps, in one run")
        panel.margins(x=0.12)
        return {"ratios": figure}


def _cover(responses: Responses) -> StadiumCover:
    return StadiumCover(responses, ORDER, ZEROS, WEIGHT, WEIGHT, orientation=limited())


def _timed(cover: Any, method: str, context: Context) -> tuple[CoverSteps, float]:
    start = time.perf_counter()
    solution = solve(cover, method, context.options)
    if solution.certificate is None or not solution.certificate.valid:
        raise SolverError(f"{method}: {solution.message}")
    return solution.answer, time.perf_counter() - start


def _by_conic(cover: StadiumCover, scan: ScannedStadiums, context: Context) -> np.ndarray:
    """The seven steps by convex programs; the radii (F,) of their first set."""
    omega, points = cover.responses.omega, cover.points
    options = Options("middle")

    def fitted(program: Any) -> Any:
        solution = solve(program, "clarabel", options)
        if solution.answer is None:
            raise SolverError(f"clarabel: {solution.message}")
        return solution.answer

    first, angles = scan.narrowest(points, None, "first set")
    stadium = narrowest_stadium(points, angle=angles)  # only the place of the centre is taken
    size = np.maximum(first + stadium.half_length, 1e-3 * np.abs(stadium.center))
    weight = np.abs(stadium.center) / size**2
    nominal = fitted(ResponseFit(omega, stadium.center, ORDER, weight=weight, zeros=ZEROS))
    away = cover.away(nominal, points)
    _, angles = scan.narrowest(away, 0.0, "second set")
    third = scan.at(away, np.where(np.abs(np.sin(angles)) > 0.5, 0.0, angles), "third set")
    sets = stadiums_about_nominal(away, angles)
    end = unwrapped(sets.half_length * np.exp(1j * sets.angle))
    weight = 1 / (third + 2 * sets.half_length)
    W_r = fitted(ResponseFit(omega, end, WEIGHT, weight=weight))
    radius = needed_radius(away, W_r.response(omega))
    fitted(MagnitudeFit(omega, radius, WEIGHT, cover=True))
    return first


def _family(plants: int, grid: int, rng: np.random.Generator) -> Responses:
    """Focus actuators drawn from the tolerances of Table 5.2, with the nominal gain."""
    table, nominal = nominal_table("focus"), nominal_parameters("focus")
    names = [field.name for field in fields(ActuatorParameters)]
    drawn = rng.uniform(-1, 1, (plants, len(names)))
    models = [
        ActuatorParameters(
            **{
                name: getattr(nominal, name) * (1 + table[name].tolerance * delta)
                for name, delta in zip(names, row.tolist(), strict=True)
            }
        )
        for row in drawn
    ]
    frequency = np.geomspace(5.0, 5000.0, grid)
    values = total_gain("focus") * stack([specific_model(m) for m in models]).response(frequency)
    return Responses(2 * np.pi * frequency, values.T, unit="units/V")


def _peak_memory() -> float:
    """Peak resident memory of this process [GiB]."""
    import resource  # Windows has none, where the rest of this module may still be imported

    unit = 1 if sys.platform == "darwin" else 1024  # bytes there, kibibytes elsewhere
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 2**30
