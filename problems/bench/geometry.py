"""Speed of the exact circles and stadiums, against conic programs and shapely."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Options, problem, solve
from workbench.executor import WALL_TIME, Context
from workbench.geometry import (
    NarrowestStadium,
    SmallestCircle,
    narrowest_stadium,
    smallest_circle,
)
from workbench.study import Study, array, check, dim, figure, metric, part
from workbench.types import Array, DataArray, Figure, RealArray

from .bars import ratio_bars

RATIOS = {
    "circles_over_conic": ("conic circles", "exact circles", 100.0),
    "stadiums_over_conic": ("conic stadiums", "exact stadiums", 30.0),
    "circles_over_shapely": ("shapely circles", "exact circles", 1.0),
    "large_circle_over_shapely": ("shapely large circle", "exact large circle", 1 / 3),
    "large_stadium_over_shapely": ("shapely large circle", "exact large stadium", 1 / 3),
}
"""For each ratio: the peer, the exact method, and the least factor by which it must be faster."""
PAIRS = {
    "circles, conic": ("exact circles", "conic circles", 2e-6),
    "circles, shapely": ("exact circles", "shapely circles", 1e-9),
    "stadiums, conic": ("exact stadiums", "conic stadiums", 2e-6),
    "large circle": ("exact large circle", "shapely large circle", 1e-9),
}
"""Pairs of tasks whose radii must agree, and the largest accepted relative difference."""
REPEATS = 5
"""Number of runs of each fast task; the shortest counts."""


@problem("bench/geometry")
def geometry(
    sets: Annotated[int, Field(ge=10)] = 1000,
    points: Annotated[int, Field(ge=3)] = 12,
    large: Annotated[int, Field(ge=1000)] = 1_000_000,
) -> GeometrySpeed:
    """Speed of exact circles and stadiums: ratios to CVXPY with Clarabel and to shapely.

    The exact method and CVXPY solve the same sets of points. CVXPY solves one parametrised problem
    for each set in turn, for stadiums at the exact angle; shapely finds the circles in a loop. For
    one large set, the exact circle and stadium are timed against shapely's bounding circle.

    sets, points: number of small sets, and of points in each. large: points in the large set.
    """
    return GeometrySpeed(sets, points, large)


@dataclass(frozen=True)
class GeometrySpeed(Study):
    """Times of the exact methods and of their peers, taken in one run on the same points."""

    sets: int
    points: int
    large: int

    headline: ClassVar[str] = "circles_over_conic"

    @property
    def quantifier(self) -> str:
        return f"for these {self.sets} sets"

    @part
    def timed(self, context: Context) -> dict[str, tuple[float, Array]]:
        """Shortest time [s] and radii of every task."""
        import shapely

        small = _normal(context.rng, (self.sets, self.points))
        large = _normal(context.rng, (self.large,))
        smallest_circle(small[:1])  # compile before the clock starts
        narrowest_stadium(small[:1])
        angle = narrowest_stadium(small).angle
        clouds, cloud = [_multipoint(row) for row in small], _multipoint(large)
        bounding = shapely.minimum_bounding_radius
        work: dict[str, Callable[[], Any]] = {
            "exact circles": lambda: smallest_circle(small).radius,
            "conic circles": lambda: _conic_radius(SmallestCircle(small)),
            "exact stadiums": lambda: narrowest_stadium(small).radius,
            "conic stadiums": lambda: _conic_radius(
                NarrowestStadium(small, center=None, angle=angle)
            ),
            "shapely circles": lambda: np.array([bounding(one) for one in clouds]),
            "exact large circle": lambda: smallest_circle(large).radius,
            "exact large stadium": lambda: narrowest_stadium(large).radius,
            "shapely large circle": lambda: bounding(cloud),
        }
        return {
            name: _timed(one, context.track(range(1 if "conic" in name else REPEATS), name))
            for name, one in work.items()
        }

    task = dim(lambda timed: list(timed))
    pair = dim(PAIRS)
    seconds = array(
        dims=task, unit="s", value=lambda timed: [time for time, _ in timed.values()], **WALL_TIME
    )

    @array(dims=pair, unit="1", meaning="largest relative difference of radii")
    def disagreement(self, timed: dict[str, tuple[float, Array]]) -> list[float]:
        radii = {name: radius for name, (_, radius) in timed.items()}
        return [np.max(np.abs(radii[a] / radii[b] - 1)) for a, b, _ in PAIRS.values()]

    @check()
    def agreement(self, disagreement: DataArray) -> list[Check]:
        statement = "largest relative difference of radii"
        return [
            Check(f"agreement of {pair}", statement, float(disagreement.sel(pair=pair)), limit)
            for pair, (_, _, limit) in PAIRS.items()
        ]

    @check()
    def fast_enough(self, seconds: DataArray) -> list[Check]:
        statement = "time over the peer's, asked to be at most 1/{:.3g}"
        found = _ratios(seconds)
        return [
            Check(name.replace("_", " "), statement.format(ratio), 1 / found[name], 1 / ratio)
            for name, (_, _, ratio) in RATIOS.items()
        ]

    faster = metric(lambda seconds: _ratios(seconds))

    @figure
    def ratios(self, seconds: DataArray) -> Figure:
        labels = [name.replace("_over_", " over ").replace("_", " ") for name in RATIOS]
        found = dict(zip(labels, _ratios(seconds).values(), strict=True))
        wanted = [ratio for _, _, ratio in RATIOS.values()]
        return ratio_bars(found, "times faster than the peer, in one run", wanted)


def _ratios(seconds: DataArray) -> dict[str, float]:
    """Speed of the exact method, relative to the peer's."""
    return {
        name: float(seconds.sel(task=peer) / seconds.sel(task=own))
        for name, (peer, own, _) in RATIOS.items()
    }


def _timed(work: Callable[[], Any], repeats: Iterable[int]) -> tuple[float, Array]:
    """Shortest time [s] of some runs, and the radii of the last one."""
    best = np.inf
    for _ in repeats:
        start = time.perf_counter()
        radii = np.atleast_1d(work())
        best = min(best, time.perf_counter() - start)
    return best, radii


def _conic_radius(program: SmallestCircle | NarrowestStadium) -> RealArray:
    radius: RealArray = solve(
        program, method="clarabel", options=Options(tolerance="middle")
    ).answer.radius
    return radius


def _normal(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Complex points whose real and imaginary parts are normally distributed."""
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def _multipoint(points: Array) -> Any:
    import shapely

    return shapely.multipoints(np.column_stack([points.real, points.imag]))
