"""Figures of `cd/{axis}/diode-plane`: the plane, the quality over time, the kinds of defects.

Figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import stats

from workbench import figures
from workbench.figures import label, legend_below
from workbench.types import Axes, Dataset, Figure, RealArray

from .runs import Detectors

COLOURS = (figures.ORANGE, figures.GREEN, figures.PURPLE, figures.BLUE)
"""Colour of each kind of defect."""
MARKERS = ("o", "s", "^", "D")
"""Marker of each kind of defect."""
CLEAN = 0.99
"""Probability content of the clean disc's ellipse."""
DOTS: dict[str, Any] = {
    "linestyle": "none", "marker": ".", "markersize": 2.0, "rasterized": True,
}  # fmt: skip
"""Style of clouds of points."""


def plane(answer: Dataset, detectors: Detectors) -> Figure:
    """The triangle, the linear area, the clean ellipse and a trace of each kind."""
    figure, panels = figures.axes(1, 2, size=(10.0, 5.6))
    clean = answer["clean"].values
    panels[0].plot(*answer["shaken"].values.T, color=figures.AMBER, label="shocks", **DOTS)
    panels[0].plot(*clean.T, color=figures.SKY, label="deviation", **DOTS)
    for kind, colour in zip(answer["kind"].values, COLOURS, strict=True):
        trace = answer["trace"].sel(kind=kind).values
        panels[1].plot(*trace.T, "-", color=colour, lw=1.0, marker=".", ms=3.0, label=str(kind))
    titles = "clean disc, one record", "surface defects, one record"
    for panel, title in zip(panels, titles, strict=True):
        _areas(panel, float(answer["linear"]), detectors)
        outline = ellipse(clean.mean(axis=0), np.cov(clean.T))
        panel.plot(*outline, "-.", color=figures.BLACK, label=f"clean, {CLEAN:.0%}")
        letter = "d" if detectors.axis == "focus" else "s"
        label(panel, x=f"${letter}_{{1n}}$ [1]", y=f"${letter}_{{2n}}$ [1]", title=title)
        panel.set(aspect="equal", xlim=(-0.05, 1.05), ylim=(-0.05, 1.05))
    named = {
        text: handle
        for panel in panels
        for handle, text in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    figure.legend(named.values(), named, loc="outside lower center", ncols=6, frameon=False)
    return figure


def _areas(panel: Axes, along: float, detectors: Detectors) -> None:
    """Draw the reachable area, the linear area, and the limits of the quality."""
    across = detectors.dist_min / np.sqrt(2.0)
    corners = [
        (0.5 + a * along / 2 + b * across, 0.5 - a * along / 2 + b * across)
        for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))
    ]
    panel.fill(*np.transpose(corners), color=figures.SKY, alpha=0.15, lw=0, label="linear area")
    panel.plot([0, 1, 0, 0], [0, 0, 1, 0], color=figures.BLACK, label="reachable")
    for name, style, dist in (("min", "--", detectors.dist_min), ("max", ":", detectors.dist_max)):
        ends = [0, 1.0 - dist * np.sqrt(2.0)]
        words = f"dist$_{{{name}}}$"
        panel.plot(ends, ends[::-1], style, color=figures.BLACK, lw=1.0, label=words)


def ellipse(centre: RealArray, covariance: RealArray) -> RealArray:
    """Outline (2, 200) of the region of probability CLEAN of a Gaussian."""
    angle = np.linspace(0.0, 2 * np.pi, 200)
    circle = np.sqrt(stats.chi2.ppf(CLEAN, 2)) * np.vstack([np.cos(angle), np.sin(angle)])
    outline: RealArray = centre[:, None] + np.linalg.cholesky(covariance) @ circle
    return outline


def over_time(answer: Dataset) -> Figure:
    """Quality over revolutions, and over one scratch with the binary detector."""
    figure, (above, below) = figures.axes(2, 1, size=(7.5, 6.0))
    time, zoom = answer["block_time"], 1e3 * answer["zoom_time"]
    above.plot(time, answer["block_sum"], color=figures.SKY, lw=0.8)
    above.plot(time, answer["block_quality"], color=figures.BLUE)
    below.plot(zoom, answer["zoom_diodes"].sum("diode"), color=figures.SKY, label="sum")
    signal: dict[str, Any] = {"color": figures.BLUE, "marker": ".", "label": "quality signal"}
    below.plot(zoom, answer["zoom_quality"], **signal)
    binary: dict[str, Any] = {"linestyle": "--", "label": "binary, 1: no defect"}
    below.step(zoom, 1.0 - answer["zoom_binary"], where="post", color=figures.ORANGE, **binary)
    words = "one record, a scratch once a revolution; lowest values of every millisecond"
    label(above, x="time [s]", y="sum, quality [1]", title=words)
    label(below, x="time in the second revolution's scratch [ms]", y="sum, quality [1]")
    for panel in (above, below):
        panel.set_ylim(-0.05, 1.2)
    legend_below(figure, below)
    return figure


def clusters(answer: Dataset) -> Figure:
    """Held-out events in two pairs of features with the clusters' 99 % ellipses."""
    figure, panels = figures.axes(1, 2, size=(10.0, 4.6))
    names = [n if "[" in n else f"{n} [1]" for n in map(str, answer["feature"].values)]
    for panel, (x, y) in zip(panels, ((0, 1), (2, 3)), strict=True):
        for k, kind in enumerate(answer["kind"].values):
            own = answer["features"].values[answer["event_kind"].values == k]
            style: dict[str, Any] = {"marker": MARKERS[k], "markersize": 3.5, "alpha": 0.7}
            style |= {"linestyle": "none", "color": COLOURS[k], "label": str(kind)}
            panel.plot(own[:, x], own[:, y], **style)
            factor = answer["cluster_factor"].values[k]
            covariance = (factor @ factor.T)[np.ix_([x, y], [x, y])]
            mean = answer["cluster_mean"].values[k][[x, y]]
            panel.plot(*ellipse(mean, covariance), color=COLOURS[k], lw=1.0)
        label(panel, x=names[x], y=names[y], title="held-out defects of one draw")
    legend_below(figure, panels[0])
    return figure
