"""Figure of accuracy against time: certified gap over wall time for every cell."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench._core.heavy_types import Axes, Dataset, Figure
from workbench.bench.comparison.layout import METHOD, tried
from workbench.bench.comparison.layout import seconds as wall_seconds
from workbench.bench.comparison.numbers import certified, largest_gap, quartiles
from workbench.bench.comparison.styles import WIDTH, Look, keys, legend, shortened
from workbench.bench.comparison.verdicts import CONTRADICTION, WRONG

LINEAR = 1e-12
"""Gaps below this are drawn on a linear scale: rounding errors, far below the finest accuracy
level.
"""
NONE_ABOVE = 2
"""Cells without a gap are drawn in a row of their own, so many decades above the largest gap."""
MOST_PANELS = 6
"""Most problems that get one panel each; with more, all share one panel."""
SIZES = (3.5, 5.5, 8.0, 10.0)
"""Sizes of markers [points] from the coarsest accuracy level to the finest."""


def accuracy_against_time(data: Dataset, looks: dict[str, Look]) -> Figure:
    """Certified gap over wall time; the axis shows negative gaps only if there are some.

    A negative gap means that an answer is better than its bound allows, which is as wrong as a
    large positive one. Cells without a gap (no answer, no valid answer, or no bound) stand in a row
    of their own above. Markers are filled if the verdict is certified, hollow if not, and crossed
    if the claim is wrong or contradicts another certificate. Horizontal bars are quartiles over
    repetitions.
    """
    names = [str(name) for name in data["problem"].values]
    alone = len(names) <= MOST_PANELS
    columns = 1 if not alone else 3 if len(names) in (3, 5, 6) else min(2, len(names))
    lines = -(-len(names) // columns) if alone else 1
    figure, panels = figures.axes(
        lines, columns, size=(WIDTH, 0.5 + 3.0 * lines if alone else 4.6), sharex=True, sharey=True
    )
    row = _row_of_none(data)
    for i, name in enumerate(names):
        panel = panels[i if alone else 0]
        for j, method in enumerate(data[METHOD].values):
            _method(panel, data, (i, j), looks[str(method)], row, joined=alone)
        panel.set_title(
            shortened(name, 90 // columns) if alone else f"{len(names)} problems", fontsize=10
        )
    _gap_axes(panels, row)
    for place, panel in enumerate(panels):
        below = place + columns < len(names) and alone
        panel.set_xlabel("" if below else "statement and solve [s]")
        panel.tick_params(labelbottom=not below)
        panel.set_ylabel("" if place % columns else "certified gap [relative]")
        panel.set_visible(place < len(names) or not alone)
    shown = {str(name): looks[str(name)] for name in data[METHOD].values}
    legend(figure, [*keys(shown, line=alone), *_explained(data)])
    return figure


def _row_of_none(data: Dataset) -> float:
    """Height at which cells without a gap are drawn: a power of ten above all gaps and 1e-6."""
    gaps = np.abs(np.asarray(data["gap"].values, dtype=float))
    largest = max(1e-6, float(gaps[np.isfinite(gaps)].max(initial=0.0)))
    return float(10.0 ** (np.ceil(np.log10(largest)) + NONE_ABOVE))


def _method(
    panel: Axes, data: Dataset, place: tuple[int, int], look: Look, row: float, *, joined: bool
) -> None:
    """Draw the cells of one problem by one method: one marker for each accuracy level.

    Cells without a gap are drawn at the height ``row``.
    """
    low, time, high = quartiles(np.asarray(wall_seconds(data).values[place], dtype=float))
    gaps = np.asarray(data["gap"].values[place], dtype=float)
    gap = np.array([largest_gap(row) for row in gaps])
    verdicts = data["verdict"].values[place]
    drawn = np.where(np.isfinite(gap), gap, row)
    known = np.isfinite(gap) & np.isfinite(time)
    if joined:
        panel.plot(
            time[known], drawn[known], linestyle=look.line, linewidth=0.8, alpha=0.7, **look.drawn
        )
    every = certified(data)[place].all(axis=-1)
    for k in map(int, np.flatnonzero(tried(data)[place].any(axis=-1) & np.isfinite(time))):
        if high[k] > low[k]:
            panel.plot([low[k], high[k]], [drawn[k]] * 2, linewidth=1.0, **look.drawn)
        size = SIZES[min(k, len(SIZES) - 1)]
        face = look.colour if every[k] else "none"
        panel.plot(
            time[k], drawn[k], look.marker, markersize=size, markerfacecolor=face, **look.drawn
        )
        if np.isin(verdicts[k], (WRONG, CONTRADICTION)).any():
            panel.plot(
                time[k], drawn[k], "x", markersize=size + 5, markeredgewidth=1.5, **look.drawn
            )


def _gap_axes(panels: list[Axes], row: float) -> None:
    """Set a scale for gaps that is logarithmic on both sides of zero, and a log scale for times."""
    lines = [line for panel in panels for line in panel.get_lines()]
    drawn = np.concatenate([np.zeros(1), *(np.asarray(line.get_ydata()) for line in lines)])
    lowest, highest = drawn.min(), row / 10.0**NONE_ABOVE
    ticks = [0.0, *(sign * 10.0**e for sign in (-1, 1) for e in range(-9, 9, 3))]
    named = {tick: _gap_label(tick) for tick in ticks if lowest <= tick <= highest}
    if (drawn == row).any():
        named[row] = "none"
    for panel in panels:
        if panel.get_lines():
            figures.label(panel, log="x")
        panel.set_yscale("symlog", linthresh=LINEAR, linscale=0.7)
        panel.set_yticks([*named], [*named.values()])
        panel.set_yticks([], minor=True)
        panel.set_ylim(min(10 * lowest, -LINEAR), 5 * (row if row in named else highest))
        panel.axhline(0.0, color=figures.BLACK, linewidth=0.8, zorder=0)


def _gap_label(value: float) -> str:
    if value == 0:
        return "0"
    return rf"${'-' if value < 0 else ''}10^{{{round(np.log10(abs(value)))}}}$"


def _explained(data: Dataset) -> list[Any]:
    """Legend entries for accuracy levels, filled markers and crosses."""
    from matplotlib.lines import Line2D

    def key(words: str, **drawn: Any) -> Any:
        look = {"marker": "o", "linestyle": "none", "color": "0.35"} | drawn
        return Line2D([], [], label=words, **look)

    levels = [str(level) for level in data["accuracy"].values]
    found = [key(level, markersize=SIZES[min(k, len(SIZES) - 1)]) for k, level in enumerate(levels)]
    found.append(key("not certified", markersize=5.5, markerfacecolor="none"))
    crossed = np.isin(data["verdict"].values, (WRONG, CONTRADICTION)).any()
    if crossed:
        found.append(key("wrong or contradiction", marker="x", markersize=9, markeredgewidth=1.5))
    return found
