"""The dataset of a sweep: its dimensions are the parameters, its variables the runs' results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from workbench._core.heavy_types import Dataset
from workbench.executor import WALL_TIME
from workbench.solvers import Outcome

SWEEP = "sweep"
"""The name under which results of sweeps are stored."""
OWN = ("outcome", "message", "key", "holds", "seconds")
"""Variables that are not metrics of the runs."""


@dataclass(frozen=True)
class SweptPoint:
    """The result of one point; a point that could not run has only an outcome and a message."""

    outcome: str
    message: str = ""
    key: str = ""
    holds: bool = False
    seconds: float = np.nan
    metrics: Mapping[str, float] = field(default_factory=dict)
    headline: str = ""


def sweep_dataset(
    axes: Mapping[str, Sequence[Any]], points: Mapping[tuple[int, ...], SweptPoint], problem: str
) -> Dataset:
    """The points of a sweep as arrays over its axes.

    Every metric of any run is a variable, NaN for runs without it. A metric with a name in `OWN`
    gets the prefix ``metric_``.
    """
    import xarray as xr

    dims = tuple(axes)
    shape = tuple(map(len, axes.values()))

    def filled(value: Any, dtype: Any, name: str) -> np.ndarray:
        values = np.full(shape, value, dtype=dtype)
        for place, point in points.items():
            values[place] = getattr(point, name)
        return values

    found: dict[str, Any] = {
        name: (dims, filled("", object, name).astype(str)) for name in ("outcome", "message", "key")
    }
    found["holds"] = (dims, filled(0, "int8", "holds"))
    found["seconds"] = (dims, filled(np.nan, float, "seconds"), {"units": "s"} | WALL_TIME)
    for name in dict.fromkeys(name for point in points.values() for name in point.metrics):
        values = np.full(shape, np.nan)
        for place, point in points.items():
            values[place] = point.metrics.get(name, np.nan)
        found[f"metric_{name}" if name in OWN or name in dims else name] = (dims, values)
    headlines = {point.headline for point in points.values() if point.headline}
    coords = {name: (name, _axis(values)) for name, values in axes.items()}
    attrs = {"problem": problem, "headline": headlines.pop() if len(headlines) == 1 else ""}
    return xr.Dataset(found, coords=coords, attrs=attrs)


def _axis(values: Sequence[Any]) -> np.ndarray:
    """Values of a parameter as a coordinate: numbers, or texts."""
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return np.array(values)
    return np.array([str(value) for value in values])


def proven(data: Dataset) -> np.ndarray:
    """Points with a proven outcome: an answer, or the proof that there is none."""
    words = [str(one) for one in Outcome if one.proven]
    return np.asarray(np.isin(data["outcome"].values, words) & (data["holds"].values == 1))
