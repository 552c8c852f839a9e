"""How fast the exact circles and stadiums are, against conic programs and shapely."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Options, Study, figures, problem, solve
from workbench.executor import WALL_TIME, Context
from workbench.geometry import (
    NarrowestStadium,
    SmallestCircle,
    narrowest_stadium,
    smallest_circle,
)
from workbench.heavy_types import Dataset, Figure

WANTED = {
    "circles_over_conic": 100.0,
    "stadiums_over_conic": 30.0,
    "circles_over_shapely": 1.0,
    "large_circle_over_shapely": 1 / 3,
    "large_stadium_over_shapely": 1 / 3,
}
"""Least ratio asked for: how many times faster than the peer the exact method must be."""
REPEATS = 5


@problem("bench/geometry")
def geometry(
    sets: Annotated[int, Field(ge=10)] = 1000,
    points: Annotated[int, Field(ge=3)] = 12,
    large: Annotated[int, Field(ge=1000)] = 1_000_000,
) -> GeometrySpeed:
    """Speed of exact circles and stadiums: ratios to CVXPY with Clarabel and to shapely.

    sets of points: solved by the exact method, one by one through CVXPY (one parametrised problem,
    re-solved; stadiums at the exact angle) and, circles, in a loop over shapely. One set of large
    points: the exact circle and stadium against shapely's bounding circle.
    """
    return GeometrySpeed(sets, points, large)


@dataclass(frozen=True)
class GeometrySpeed(Study):
    """Times of the exact methods and of their peers, taken in one run on the same points."""

    sets: int
    points: int
    large: int

    headline: ClassVar[str] = "circles_over_conic"

    def compute(self, context: Context) -> Dataset:
        import shapely
        import xarray as xr

        small = _normal(context.rng, (self.sets, self.points))
        large = _normal(context.rng, (self.large,))
        smallest_circle(small[:1])  # compile before the clock starts
        exact = narrowest_stadium(small[:1])
        seconds, radii = {}, {}

        def timed(name: str, work: Callable[[], np.ndarray], repeats: int = REPEATS) -> None:
            best = np.inf
            for _ in context.track(range(repeats), name):
                start = time.perf_counter()
                radii[name] = np.atleast_1d(work())
                best = min(best, time.perf_counter() - start)
            seconds[name] = best

        def conic(program: SmallestCircle | NarrowestStadium) -> np.ndarray:
            radius: np.ndarray = solve(program, "clarabel", Options("middle")).answer.radius
            return radius

        timed("exact circles", lambda: smallest_circle(small).radius)
        timed("conic circles", lambda: conic(SmallestCircle(small)), 1)
        timed("exact stadiums", lambda: narrowest_stadium(small).radius)
        exact = narrowest_stadium(small)
        timed("conic stadiums", lambda: conic(NarrowestStadium(small, None, exact.angle)), 1)
        clouds = [_multipoint(row) for row in small]
        timed(
            "shapely circles",
            lambda: np.array([shapely.minimum_bounding_radius(cloud) for cloud in clouds]),
        )
        cloud = _multipoint(large)
        timed("exact large circle", lambda: smallest_circle(large).radius)
        timed("exact large stadium", lambda: narrowest_stadium(large).radius)
        timed("shapely large circle", lambda: np.array(shapely.minimum_bounding_radius(cloud)))
        tasks = list(seconds)
        worst = {
            "circles, conic": _apart(radii["exact circles"], radii["conic circles"]),
            "circles, shapely": _apart(radii["exact circles"], radii["shapely circles"]),
            "stadiums, conic": _apart(radii["exact stadiums"], radii["conic stadiums"]),
            "large circle": _apart(radii["exact large circle"], radii["shapely large circle"]),
        }
        return xr.Dataset(
            {
                "seconds": (("task",), [seconds[t] for t in tasks], {"units": "s"} | WALL_TIME),
                "disagreement": (
                    ("pair",),
                    list(worst.values()),
                    {"units": "1", "long_name": "largest relative difference of radii"},
                ),
            },
            coords={"task": tasks, "pair": list(worst)},
        )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        ratios = self.metrics(answer)
        return [
            *(
                Check(
                    f"agreement of {pair}",
                    "largest relative difference of radii",
                    float(answer["disagreement"].sel(pair=pair)),
                    2e-6 if "conic" in str(pair) else 1e-9,
                )
                for pair in answer["pair"].values
            ),
            *(
                Check(
                    name.replace("_", " "),
                    f"time over the peer's, asked to be at most 1/{wanted:.3g}",
                    1 / ratios[name],
                    1 / wanted,
                )
                for name, wanted in WANTED.items()
            ),
        ]

    def metrics(self, answer: Dataset) -> dict[str, float]:
        def ratio(peer: str, own: str) -> float:
            seconds = answer["seconds"]
            return float(seconds.sel(task=peer) / seconds.sel(task=own))

        return {
            "circles_over_conic": ratio("conic circles", "exact circles"),
            "stadiums_over_conic": ratio("conic stadiums", "exact stadiums"),
            "circles_over_shapely": ratio("shapely circles", "exact circles"),
            "large_circle_over_shapely": ratio("shapely large circle", "exact large circle"),
            "large_stadium_over_shapely": ratio("shapely large circle", "exact large stadium"),
        }

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        ratios = self.metrics(answer)
        labels = [name.replace("_over_", " over ").replace("_", " ") for name in ratios]
        figure, (panel,) = figures.axes(size=(7.5, 3.4))
        place = np.arange(len(ratios))
        panel.barh(place, list(ratios.values()), color=figures.BLUE, height=0.55, label="measured")
        wanted = [WANTED[name] for name in ratios]
        panel.plot(wanted, place, "|", color=figures.ORANGE, markersize=22, label="asked for")
        for y, value in zip(place, ratios.values(), strict=True):
            panel.annotate(
                f"{value:,.0f}" if value >= 100 else f"{value:.3g}",
                (value, y),
                (4, 0),
                textcoords="offset points",
                va="center",
            )
        panel.set_yticks(place, labels)
        panel.invert_yaxis()
        panel.set_xscale("log")
        panel.set_xlabel("times faster than the peer, in one run")
        panel.margins(x=0.12)
        figures.legend_below(figure, panel)
        return {"ratios": figure}


def _normal(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def _multipoint(points: np.ndarray) -> object:
    import shapely

    return shapely.multipoints(np.column_stack([points.real, points.imag]))


def _apart(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.max(np.abs(one / other - 1)))
