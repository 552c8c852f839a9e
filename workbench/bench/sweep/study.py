"""A sweep as a Study: the results of its points, and how many of them hold."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.heavy_types import DataArray, Dataset, Figure
from workbench._core.tables import markdown_table
from workbench.bench.sweep.dataset import OWN, proven
from workbench.certificate import Check
from workbench.errors import ResultError
from workbench.executor import Context
from workbench.study import Study

MOST_LINES = 8
"""Most lines with different colours; more are drawn as a heat map, or share colours."""


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
        missed = int((~proven(answer)).sum())
        return [Check("points", "points whose certificate does not hold", missed, 0)]

    def metrics(self, answer: Dataset) -> dict[str, float]:
        found = proven(answer)
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
            if not proven(one) and str(one["message"].item()):
                reason += f": {str(one['message'].item())[:120]}"
            rows.append([*labels, reason, *(_short(one[name].item()) for name in shown)])
        return {"points": markdown_table(heads, rows)}

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        name = str(answer.attrs.get("headline", ""))
        if name not in answer or not answer[name].notnull().any():
            return {}
        return {
            "metric": _line_plot(answer[name].where(proven(answer)), str(answer.attrs["problem"]))
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
