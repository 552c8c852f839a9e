"""Accuracy against time: the certified gap of every cell over its wall time."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.bench.comparison.layout import METHOD
from workbench.bench.comparison.layout import seconds as wall_seconds
from workbench.bench.comparison.numbers import certified, largest_gap, quartiles
from workbench.bench.comparison.styles import WIDTH, Look, keys, legend, shortened
from workbench.bench.comparison.verdicts import CONTRADICTION, WRONG
from workbench.heavy_types import Axes, Dataset, Figure

LINEAR = 1e-12
"""Gap below which the scale is linear: rounding errors, far below the finest accuracy level."""
EDGE = 10.0
"""Gap at which larger ones, missing bounds and wrong answers are drawn: the edge of the axis."""
MOST_PANELS = 6
"""Most problems that get a panel each; more share one."""
SIZES = (3.5, 5.5, 8.0, 10.0)
"""Sizes of markers [points] from the coarsest accuracy level to the finest."""


def accuracy_against_time(data: Dataset, looks: dict[str, Look]) -> Figure:
    """Certified gap over wall time on a scale with both signs; an exact answer lies in its middle.

    A gap below zero is an answer beyond its bound, as wrong as one above it. Markers are filled
    where the verdict is certified, hollow elsewhere, and crossed where the claim is wrong or
    contradicts another certificate. Horizontal bars are quartiles over repetitions.
    """
    names = [str(name) for name in data["problem"].values]
    alone = len(names) <= MOST_PANELS
    columns = min(2, len(names)) if alone else 1
    lines = -(-len(names) // columns) if alone else 1
    figure, panels = figures.axes(
        lines, columns, size=(WIDTH, 0.5 + 3.0 * lines if alone else 4.6), sharex=True, sharey=True
    )
    gaps = np.asarray(data["gap"].values, dtype=float)
    for i, name in enumerate(names):
        panel = panels[i if alone else 0]
        for j, method in enumerate(data[METHOD].values):
            _method(panel, data, (i, j), looks[str(method)], joined=alone)
        panel.set_title(shortened(name) if alone else f"{len(names)} problems", fontsize=10)
    known = np.abs(gaps[np.isfinite(gaps)])
    top = EDGE * 3 if np.nanmax(np.abs(gaps)) > 1e-2 else max(1e-6, 30 * known.max(initial=0.0))
    for panel in panels:
        _gap_axis(panel, top)
    for place, panel in enumerate(panels):
        below = place + columns < len(names) and alone
        panel.set_xlabel("" if below else "statement and solve [s]")
        panel.set_ylabel("" if place % columns else "certified gap [relative]")
        panel.set_visible(place < len(names) or not alone)
    shown = {str(name): looks[str(name)] for name in data[METHOD].values}
    legend(figure, [*keys(shown, line=alone), *_explained(data)])
    return figure


def _method(
    panel: Axes, data: Dataset, place: tuple[int, int], look: Look, *, joined: bool
) -> None:
    """The cells of one problem by one method: a marker for each accuracy level."""
    low, time, high = quartiles(np.asarray(wall_seconds(data).values[place], dtype=float))
    gaps = np.asarray(data["gap"].values[place], dtype=float)
    gap = np.array([largest_gap(row) for row in gaps])
    verdicts = data["verdict"].values[place]
    gap[np.isnan(gap) & (verdicts == WRONG).any(axis=-1)] = EDGE  # an invalid answer has no gap
    known = np.isfinite(time) & ~np.isnan(gap)
    drawn = np.clip(gap, -EDGE, EDGE)
    if joined:
        panel.plot(
            time[known], drawn[known], linestyle=look.line, linewidth=0.8, alpha=0.7, **look.drawn
        )
    every = certified(data)[place].all(axis=-1)
    for k in map(int, np.flatnonzero(known)):
        if high[k] > low[k]:
            panel.plot([low[k], high[k]], [drawn[k]] * 2, linewidth=1.0, **look.drawn)
        size = SIZES[min(k, len(SIZES) - 1)]
        face = look.colour if every[k] else "none"
        panel.plot(
            time[k], drawn[k], look.marker, markersize=size, markerfacecolor=face, **look.drawn
        )
        if np.isin(verdicts[k], (WRONG, CONTRADICTION)).any():
            panel.plot(
                time[k], drawn[k], "x", markersize=size + 5, markeredgewidth=1.5,
                color=figures.BLACK, gid=look.drawn["gid"],
            )  # fmt: skip


def _gap_axis(panel: Axes, top: float) -> None:
    """A symmetric axis of gaps, logarithmic on either side of zero, and times on a log scale."""
    panel.set_yscale("symlog", linthresh=LINEAR, linscale=0.7)
    exponents = [e for e in (-9, -6, -3, 0) if 10.0**e < top]
    ticks = [0.0, *(sign * 10.0**e for sign in (-1, 1) for e in exponents)]
    panel.set_yticks(sorted(ticks))
    panel.set_yticks([], minor=True)
    panel.yaxis.set_major_formatter(_gap_label)
    panel.set_ylim(-top, top)
    panel.axhline(0.0, color=figures.BLACK, linewidth=0.8, zorder=0)
    if any(line.get_gid() for line in panel.get_lines()):  # the line at zero has no time
        figures.label(panel, log="x")


def _gap_label(value: float, place: float | None = None) -> str:
    if value == 0:
        return "0"
    exponent = round(np.log10(abs(value)))
    sign = "-" if value < 0 else ""
    return f"{sign}1" if exponent == 0 else rf"${sign}10^{{{exponent}}}$"


def _explained(data: Dataset) -> list[Any]:
    """Legend entries of accuracy levels and of what filling and crosses mean."""
    from matplotlib.lines import Line2D

    def key(words: str, **drawn: Any) -> Any:
        look = {"marker": "o", "linestyle": "none", "color": "0.35"} | drawn
        return Line2D([], [], label=words, **look)

    levels = [str(level) for level in data["accuracy"].values]
    found = [key(level, markersize=SIZES[min(k, len(SIZES) - 1)]) for k, level in enumerate(levels)]
    found.append(key("not certified", markersize=5.5, markerfacecolor="none"))
    crossed = np.isin(data["verdict"].values, (WRONG, CONTRADICTION)).any()
    if crossed:
        black = {"color": figures.BLACK, "markeredgewidth": 1.5}
        found.append(key("wrong or contradiction", marker="x", markersize=9, **black))
    return found
