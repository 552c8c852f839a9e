"""A sweep: one problem over a grid of its parameters, as labelled arrays, tables and a figure.

The dimensions of its dataset are the parameters, its variables the results of the runs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from workbench._core.heavy_types import DataArray, Dataset, Figure
from workbench._core.tables import markdown_table
from workbench.certificate import Check
from workbench.errors import ResultError
from workbench.executor import WALL_TIME, Context
from workbench.solvers import Outcome
from workbench.study import Study

SWEEP = "sweep"
"""The name under which results of sweeps are stored."""
OWN = ("outcome", "message", "key", "holds", "seconds")
"""Variables that are not metrics of the runs."""

MOST_LINES = 8
"""Most lines with different colours; more are drawn as a heat map, or share colours."""


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


def _proven(data: Dataset) -> np.ndarray:
    """Points with a proven outcome: an answer, or the proof that there is none."""
    words = [str(one) for one in Outcome if one.proven]
    return np.asarray(np.isin(data["outcome"].values, words) & (data["holds"].values == 1))


@dataclass(frozen=True, eq=False)
class ParameterSweep(Study):
    """One problem over a grid of parameters; the dataset is that of `sweep_dataset`."""

    points: Callable[[Context], Dataset]

    headline = "certified_share"

    @property
    def quantifier(self) -> str:
        return "for these points"

    @classmethod
    def stored(cls) -> ParameterSweep:
        """A sweep whose points are stored: it can show them, but not run any."""

        def unknown(context: Context) -> Dataset:
            raise ResultError("a stored sweep cannot run again; call workbench.sweep")

        return cls(unknown)

    def compute(self, context: Context) -> Dataset:
        return self.points(context)

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        missed = int((~_proven(answer)).sum())
        return [Check("points", "points whose certificate does not hold", missed, 0)]

    def metrics(self, answer: Dataset) -> dict[str, float]:
        found = _proven(answer)
        return {"certified_share": float(found.mean()), "points": float(found.size)}

    def tables(self, answer: Dataset) -> dict[str, str]:
        shown = [name for name in _metrics(answer) if answer[name].notnull().any()][:6]
        heads = [*map(str, answer["outcome"].dims), "outcome", *shown]
        rows = []
        for place in np.ndindex(*answer["outcome"].shape):
            at = dict(zip(answer["outcome"].dims, place, strict=True))
            one = answer.isel(at)
            labels = [_short(one[str(name)].item()) for name in answer["outcome"].dims]
            reason = str(one["outcome"].item())
            if not _proven(one) and str(one["message"].item()):
                reason += f": {str(one['message'].item())[:120]}"
            rows.append([*labels, reason, *(_short(one[name].item()) for name in shown)])
        return {"points": markdown_table(heads, rows)}

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        name = str(answer.attrs.get("headline", ""))
        if name not in answer or not answer[name].notnull().any():
            return {}
        return {
            "metric": _line_plot(answer[name].where(_proven(answer)), str(answer.attrs["problem"]))
        }


def _metrics(data: Dataset) -> list[str]:
    return [str(name) for name in data.data_vars if name not in OWN]


def _short(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _line_plot(values: DataArray, problem: str) -> Figure:
    """A metric over the first parameter, with one line for each value of the others."""
    from workbench import figures

    first, *others = values.dims
    figure, (panel,) = figures.axes(1, 1, size=(7.4, 4.4))
    x = values[first].values
    numbers = np.issubdtype(x.dtype, np.number)
    at = x if numbers else np.arange(x.size)
    lines = (
        values.stack(line=others).transpose("line", first) if others else values.expand_dims("line")
    )
    for k in range(lines.sizes["line"]):
        one = lines.isel(line=k)
        label = ", ".join(f"{name} = {_short(one[name].item())}" for name in others)
        style = "-" if k < MOST_LINES else "--"
        panel.plot(
            at, one.values, f"o{style}", color=figures.CYCLE[k % len(figures.CYCLE)], label=label
        )
    if not numbers:
        panel.set_xticks(at, [str(value) for value in x])
    log = "x" if numbers and (x > 0).all() and x.max() > 50 * x.min() else ""
    figures.label(panel, x=str(first), y=f"{values.name} of {problem}", log=log)
    if others:
        figures.legend_below(figure, panel)
    return figure
