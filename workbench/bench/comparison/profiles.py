"""Figures of the times of one Program's certified cells, one panel per accuracy level:
performance profile, cactus plot, and time over the size of the problems.

Source: E. D. Dolan, J. J. More, Benchmarking optimization software with performance profiles,
Mathematical Programming 91 (2002) 201-213.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Axes, Dataset, Figure
from workbench.bench.comparison.layout import METHOD
from workbench.bench.comparison.numbers import certified_times
from workbench.bench.comparison.styles import WIDTH, Look, keys, legend, share_axis

BEYOND = 1.3
"""Factor by which the time axis extends beyond the last step of a curve."""


def performance_ratios(data: Dataset) -> RealArray:
    """Median time over that of the fastest certified method (problem, method, accuracy).

    Infinite if a method has no certificate for the problem at that level.
    """
    times = certified_times(data)[1]
    with np.errstate(invalid="ignore", divide="ignore"):
        best = np.where(np.isfinite(times), times, np.inf).min(axis=1, keepdims=True)
        ratio = times / best
    return np.where(np.isfinite(ratio), ratio, np.inf)


def profile(ratios: RealArray) -> tuple[RealArray, RealArray]:
    """The steps of rho(tau): the share (N,) of problems whose ratio is at most tau (N,).

    ratios: those of one method (P,), at least 1; infinite for an unsolved problem.
    """
    tau = np.unique(ratios[np.isfinite(ratios)])
    share = (ratios[:, None] <= tau).mean(axis=0)
    return tau, np.asarray(share)


def performance_profile(data: Dataset, looks: dict[str, Look]) -> Figure:
    """Share of problems that each method solves within a factor of the fastest method's time.

    A curve's left end is the share of problems on which the method is the fastest; its right end is
    the share that it solves at all. Problems that it cannot take count as unsolved.
    """
    ratios = performance_ratios(data)
    count = data.sizes["problem"]

    def draw(panel: Axes, level: int) -> float:
        last = [1.0]
        for j, name in enumerate(data[METHOD].values):
            tau, share = profile(ratios[:, j, level])
            if tau.size:
                last.append(float(tau[-1]))
                _steps(panel, looks[str(name)], tau, share)
        return max(last)

    words = f"share of the {count} problems" if count > 1 else "share of the one problem"
    figure, panels = _panels(data, looks, draw, "time / fastest time [1]", words)
    for panel in panels:
        share_axis(panel)
    return figure


def cactus(data: Dataset, looks: dict[str, Look]) -> Figure:
    """Time per problem against the number of problems that each method solves within it."""
    times = certified_times(data)[1]

    def draw(panel: Axes, level: int) -> float:
        last = [0.0]
        for j, name in enumerate(data[METHOD].values):
            spent = times[:, j, level]
            spent = np.sort(spent[np.isfinite(spent)])
            if spent.size:
                last.append(float(spent[-1]))
                _steps(panel, looks[str(name)], spent, np.arange(1, spent.size + 1.0))
        return max(last)

    from matplotlib.ticker import MaxNLocator

    words = f"certified problems, of {data.sizes['problem']}"
    figure, panels = _panels(data, looks, draw, "time per problem [s]", words)
    for panel in panels:
        panel.set_ylim(0, data.sizes["problem"] * 1.03 + 0.1)
        panel.yaxis.set_major_locator(MaxNLocator(integer=True))
    return figure


def _steps(panel: Axes, look: Look, x: RealArray, y: RealArray) -> None:
    """Draw a step curve; if it has many steps, about eight of them get a marker."""
    marked = list(range(0, x.size, max(1, x.size // 8)))
    panel.step(
        x, y, where="post", linestyle=look.line, marker=look.marker, markevery=marked,
        markersize=4.5, **look.drawn,
    )  # fmt: skip


def _panels(
    data: Dataset,
    looks: dict[str, Look],
    draw: Callable[[Axes, int], float],
    x: str,
    y: str,
) -> tuple[Figure, list[Axes]]:
    """One panel for each level; ``draw`` fills it and returns the largest x of its steps."""
    levels = data["accuracy"].values
    figure, panels = figures.axes(
        1, len(levels), size=(max(WIDTH, 2.7 * len(levels)), 3.2), sharex=True, sharey=True
    )
    ends = [draw(panel, k) for k, panel in enumerate(panels)]
    # Extend every curve to the right end of the axis at the height of its last step.
    right = max(ends) * BEYOND
    for panel, level in zip(panels, levels, strict=True):
        for line in panel.get_lines():
            last_x, last_y = line.get_data()
            line.set_data(np.append(last_x, right), np.append(last_y, np.asarray(last_y)[-1]))
        figures.label(panel, x=x, y="", title=str(level), log="x" if right > 0 else "")
        if right > 0:
            panel.set_xlim(right=right)
    panels[0].set_ylabel(y)
    shown = {str(name): looks[str(name)] for name in data[METHOD].values}
    legend(figure, keys(shown), figure.get_figwidth())
    return figure, panels


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
