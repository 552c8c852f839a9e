"""Speed of the stadium cover, against the same steps by a convex program at each frequency."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, fields, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Options, problem, solve
from workbench.errors import SolverError
from workbench.executor import WALL_TIME, Context, Workers
from workbench.fitting import MagnitudeFit, ResponseFit
from workbench.geometry import narrowest_stadium
from workbench.study import Study, array, check, dim, figure, metric, part
from workbench.types import Array, DataArray, Figure
from workbench.uncertainty import (
    CircleCover,
    CoverSteps,
    Responses,
    StadiumCover,
    limited_orientation,
)
from workbench.uncertainty.covers.sets import stadiums_about_nominal
from workbench.uncertainty.covers.weights import needed_radius, unwrapped

from ..cd_drive.drive.actuator import specific_model, stack
from ..cd_drive.drive.plants import nominal_parameters, total_gain
from ..cd_drive.drive.shared_parameters import TABLES
from ..cd_drive.drive.tables import ActuatorParameters, nominal_table
from ..cd_drive.uncertainty.measured_drives import measured_drives
from .bars import ratio_bars
from .scanned import ScannedStadiums

ORDER, ZEROS, WEIGHT = 4, 2, 4
"""Order of the nominal, number of its zeros, and order of both weights."""
TASKS = {
    "steps": "seven steps, twelve drives",
    "conic": "the same through CVXPY",
    "large, steps": "seven steps, {} plants",
    "large, joint": "joint stadiums, {} plants",
    "large, circles": "joint circles, {} plants",
}
"""Timed tasks, with their labels in the figure."""
LEAST_RATIO = 70.0
"""Least speed of the seven steps, relative to the peer's."""
LARGE_OVER_CONIC, GIBIBYTES = 1.0, 2.0
"""Largest processor time of the large family, over the peer's for the small task; and the largest
memory [GiB] of a cover of the large family.
"""
WIDER = 0.02
"""Largest accepted excess of the peer's radii over the smallest ones, in the median, relative."""
NARROWER = 1e-6
"""Rounding error by which a radius of the peer may be below the smallest one, relative."""


@problem("bench/covers", slow=True, data=tuple(f"../cd_drive/{name}" for name in TABLES))
def covers(
    frequencies: Annotated[int, Field(ge=10)] = 400,
    plants: Annotated[int, Field(ge=2, le=10_000)] = 1000,
    grid: Annotated[int, Field(ge=10, le=10_000)] = 1000,
) -> CoverSpeed:
    """Speed of the whole focus stadium cover: ratio to the same seven steps through CVXPY.

    The small task covers the twelve drives. The peer solves it with Clarabel through CVXPY: for the
    narrowest stadium at each frequency it solves a parametrised program at each of many angles, and
    it solves one program for every fit. The large task covers a family of plants drawn from the
    tolerances of Table 5.2: by the seven steps, and jointly with stadiums and with circles.

    frequencies: number of frequencies of the small task. plants, grid: number of plants and of
    frequencies of the large task.
    """
    return CoverSpeed(frequencies, plants, grid)


@dataclass(frozen=True)
class CoverSpeed(Study):
    """Processor times of the seven steps and of their peer on the same responses, in one run.

    Processor time is compared, since other load on the machine lengthens tasks of different sizes
    unevenly.
    """

    frequencies: int
    plants: int
    grid: int

    headline: ClassVar[str] = "steps_over_conic"

    @property
    def quantifier(self) -> str:
        return "in this one run, on this machine"

    @part
    def cover(self) -> StadiumCover:
        """The focus cover of the twelve drives; the peer covers the same responses."""
        return _cover(_drive_responses(self.frequencies))

    @part
    def own(self, cover: StadiumCover, context: Context) -> tuple[CoverSteps, float]:
        """The cover by the seven steps, and its processor time [s]."""
        _timed(_cover(_drive_responses(10)), "steps", context)  # compile
        return _timed(cover, "steps", context)

    @part
    def peer(self, cover: StadiumCover, context: Context) -> tuple[Array, float]:
        """Radii (F,) of the peer's first set, and the processor time [s] of all its steps."""
        start = time.process_time()
        scan = ScannedStadiums(cover.points.shape[1], context)
        return _radii_by_conic(cover, scan, context), time.process_time() - start

    @part
    def large(self, context: Context) -> tuple[list[float], float]:
        """Times of the covers of the large family, and the memory of a separate process that
        computes them.
        """
        family = _family(self.plants, self.grid, context.rng)
        with Workers(count=1) as alone:  # memory that this process used before must not count
            return alone.submit(_large_family_times, family, context.options).result()

    task = dim(TASKS)
    frequency = dim(lambda cover: cover.responses.frequency_hz, unit="Hz")
    seconds = array(
        dims=task,
        unit="s",
        value=lambda own, peer, large: [own[1], peer[1], *large[0]],
        **WALL_TIME,
    )
    memory = array(dims=(), unit="GiB", value=lambda large: large[1], **WALL_TIME)
    exact = array(dims=frequency, unit="units/V", value=lambda own: own[0].first.radius)
    scanned = array(dims=frequency, unit="units/V", value=lambda peer: peer[0])

    @check(
        title="peer near", statement="excess of the median scanned width, relative", at_most=WIDER
    )
    def near(self, scanned: DataArray, exact: DataArray) -> DataArray:
        return (scanned / exact - 1).median()

    @check(
        title="peer not below", statement="the narrowest width over a scanned one", at_most=NARROWER
    )
    def not_below(self, scanned: DataArray, exact: DataArray) -> DataArray:
        return (1 - scanned / exact).max()

    slow = check(
        title="steps over conic",
        statement=f"time over the peer's, at most {1 / LEAST_RATIO:.3g}",
        value=lambda seconds: 1 / _time_over_steps(seconds, "conic"),
        at_most=1 / LEAST_RATIO,
    )
    longest = check(
        title="large over conic",
        statement="longest cover of the family, over the peer's of twelve drives",
        value=lambda seconds: (
            max(_time_over_steps(seconds, k) for k in TASKS if "large" in k)
            / _time_over_steps(seconds, "conic")
        ),
        at_most=LARGE_OVER_CONIC,
    )
    fits = check(
        title="memory",
        statement="peak of a process that covers the large family [GiB]",
        value=lambda memory: memory,
        at_most=GIBIBYTES,
    )

    steps_over_conic = metric(lambda seconds: _time_over_steps(seconds, "conic"))
    large_over_small = metric(lambda seconds: _time_over_steps(seconds, "large, steps"))
    memory_gib = metric(lambda memory: memory)

    @figure
    def ratios(self, seconds: DataArray) -> Figure:
        found = {
            label.format(self.plants): _time_over_steps(seconds, k) for k, label in TASKS.items()
        }
        return ratio_bars(found, "time over that of the seven steps, in one run")


def _drive_responses(frequencies: int) -> Responses:
    """Responses of the twelve drives, reduced to these frequencies."""
    return replace(measured_drives("focus", frequencies, 5.0, 5000.0), known=())


def _time_over_steps(seconds: DataArray, task: str) -> float:
    """Time of a task, divided by that of the seven steps for twelve drives."""
    return float(seconds.sel(task=task) / seconds.sel(task="steps"))


def _cover(responses: Responses) -> StadiumCover:
    return StadiumCover(
        responses,
        ORDER,
        zeros=ZEROS,
        complex_order=WEIGHT,
        real_order=WEIGHT,
        orientation=limited_orientation(),
    )


def _timed(cover: Any, method: str, context: Context) -> tuple[CoverSteps, float]:
    """A cover by one of its methods, and the processor time [s] including that of its
    certificate.
    """
    start = time.process_time()
    solution = solve(cover, method=method, options=context.options)
    if solution.certificate is None or not solution.certificate.valid:
        failures = solution.certificate.failures if solution.certificate else ()
        raise SolverError(f"{method}: {'; '.join(failures) or solution.message}")
    return solution.answer, time.process_time() - start


def _large_family_times(family: Responses, options: Options) -> tuple[list[float], float]:
    """Processor times [s] of all covers of a family, and the peak memory of this process [GiB]."""
    context = Context(options=options)
    _timed(_cover(_drive_responses(10)), "steps", context)  # compile
    circles = CircleCover(family, ORDER, zeros=ZEROS, complex_order=WEIGHT)
    asked = [(_cover(family), "steps"), (_cover(family), "joint"), (circles, "joint")]
    times = [_timed(cover, method, context)[1] for cover, method in asked]
    return times, _peak_memory()


def _radii_by_conic(cover: StadiumCover, scan: ScannedStadiums, context: Context) -> Array:
    """Solve the seven steps by convex programs, and return the radii (F,) of their first set."""
    omega, points = cover.responses.omega, cover.points
    options = Options(tolerance="middle")

    def fitted(program: Any) -> Any:
        solution = solve(program, method="clarabel", options=options)
        if solution.answer is None:
            raise SolverError(f"clarabel: {solution.message}")
        return solution.answer

    first, angles = scan.narrowest(points, None, "first set")
    stadium = narrowest_stadium(points, angle=angles)  # only its centre is used
    size = np.maximum(first + stadium.half_length, 1e-3 * np.abs(stadium.center))
    weight = np.abs(stadium.center) / size**2
    nominal = fitted(ResponseFit(omega, stadium.center, ORDER, weight=weight, zeros=ZEROS))
    away = cover.deviations_from(nominal, points)
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
    """Focus actuators with parameters drawn from the tolerances of Table 5.2, and the
    nominal gain.
    """
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
    return Responses(omega=2 * np.pi * frequency, values=values.T, unit="units/V")


def _peak_memory() -> float:
    """Peak resident memory of this process [GiB]."""
    if sys.platform == "win32":
        import psutil

        return float(psutil.Process().memory_info().peak_wset) / 2**30
    import resource

    unit = 1 if sys.platform == "darwin" else 1024  # in bytes on macOS, in kibibytes elsewhere
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 2**30
