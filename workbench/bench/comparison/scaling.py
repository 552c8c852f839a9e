"""Figure of each method's time over the size of one Program's problems."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Dataset, Figure
from workbench.bench.comparison.layout import METHOD
from workbench.bench.comparison.numbers import certified_times
from workbench.bench.comparison.styles import WIDTH, Look, keys, legend


def problem_sizes(data: Dataset) -> RealArray:
    """Size of every problem (P,); NaN if its Program defines none."""
    return np.asarray(data["size"].values, dtype=float)


def has_sizes(data: Dataset) -> bool:
    """Whether the problems have at least two different sizes, which a figure needs."""
    known = problem_sizes(data)
    return np.unique(known[np.isfinite(known)]).size > 1


def scaling_figure(data: Dataset, looks: dict[str, Look]) -> Figure:
    """Median time with quartiles over problem size, for certified cells, one panel per level.

    The line connects the median times of the problem sizes, so it shows the trend.
    """
    times, size = certified_times(data), problem_sizes(data)
    levels = data["accuracy"].values
    figure, panels = figures.axes(
        1, len(levels), size=(max(WIDTH, 2.7 * len(levels)), 3.2), sharex=True, sharey=True
    )
    for k, (panel, level) in enumerate(zip(panels, levels, strict=True)):
        for j, name in enumerate(data[METHOD].values):
            look = looks[str(name)]
            low, time, high = times[:, :, j, k]
            known = np.isfinite(time) & np.isfinite(size)
            panel.plot(
                size[known], time[known], look.marker, markersize=4, linestyle="none", **look.drawn
            )
            panel.vlines(size[known], low[known], high[known], linewidth=1.0, **_lines(look))
            each = np.unique(size[known])
            trend = [np.median(time[known & (size == one)]) for one in each]
            panel.plot(each, trend, linestyle=look.line, linewidth=1.0, **look.drawn)
        figures.label(panel, x="problem size [1]", y="", title=str(level), log="xy")
    panels[0].set_ylabel("statement and solve [s]")
    shown = {str(name): looks[str(name)] for name in data[METHOD].values}
    legend(figure, keys(shown), figure.get_figwidth())
    return figure


def _lines(look: Look) -> dict[str, Any]:
    """Keywords for a method's vertical lines."""
    return {"colors": look.colour, "gid": str(look.drawn["gid"])}
