"""Figures and tables of `cd/{axis}/diode-plane`: the plane, the quality over time, the kinds.

Figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import stats

from workbench import figures
from workbench.heavy_types import Dataset, Figure

from ...drive.tables import Axis

COLOURS = (figures.ORANGE, figures.GREEN, figures.PURPLE, figures.BLUE)
MARKERS = ("o", "s", "^", "D")
CLEAN = 0.99
"""Probability content of the clean disc's ellipse."""


def figures_of(answer: Dataset, axis: Axis, dist_min: float, dist_max: float) -> dict[str, Figure]:
    """The three figures, by file stem."""
    return {
        "figure-7-5-7-10": plane(answer, axis, dist_min, dist_max),
        "figure-7-11": over_time(answer),
        "kinds": clusters(answer),
    }


def plane(answer: Dataset, axis: Axis, dist_min: float, dist_max: float) -> Figure:
    """The triangle, the linear area, the clean ellipse and a trace of each kind."""
    figure, panels = figures.axes(1, 2, size=(10.0, 5.6))
    names = ("d$_{1n}$", "d$_{2n}$") if axis == "focus" else ("s$_{1n}$", "s$_{2n}$")
    along, across = float(answer["linear"]), dist_min / np.sqrt(2.0)
    for panel in panels:
        corners = [
            (0.5 + a * along / 2 + b * across, 0.5 - a * along / 2 + b * across)
            for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))
        ]
        panel.fill(*np.transpose(corners), color=figures.SKY, alpha=0.15, lw=0, label="linear area")
        panel.plot([0, 1, 0, 0], [0, 0, 1, 0], color=figures.BLACK, label="reachable")
        for dist, style in ((dist_min, "--"), (dist_max, ":")):
            reach = 1.0 - dist * np.sqrt(2.0)
            label = "dist$_{min}$" if style == "--" else "dist$_{max}$"
            panel.plot([0, reach], [reach, 0], style, color=figures.BLACK, lw=1.0, label=label)
        panel.set_aspect("equal")
        panel.set_xlabel(f"{names[0]} [1]")
        panel.set_ylabel(f"{names[1]} [1]")
        panel.set_xlim(-0.05, 1.05)
        panel.set_ylim(-0.05, 1.05)
    clean, shaken = answer["clean"].values, answer["shaken"].values
    dots: dict[str, Any] = {
        "linestyle": "none",
        "marker": ".",
        "markersize": 2.0,
        "rasterized": True,
    }
    panels[0].plot(*shaken.T, color=figures.AMBER, label="shocks", **dots)
    panels[0].plot(*clean.T, color=figures.SKY, label="deviation", **dots)
    for panel in panels:
        outline = ellipse(clean.mean(axis=0), np.cov(clean.T))
        panel.plot(*outline, "-.", color=figures.BLACK, label=f"clean, {CLEAN:.0%}")
    panels[0].set_title("clean disc")
    for kind, colour in zip(answer["kind"].values, COLOURS, strict=True):
        trace = answer["trace"].sel(kind=kind).values
        panels[1].plot(*trace.T, "-", color=colour, lw=1.0, marker=".", ms=3.0, label=str(kind))
    panels[1].set_title("surface defects")
    handles, labels = [], []
    for panel in panels:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            if label not in labels:
                handles.append(handle)
                labels.append(label)
    figure.legend(handles, labels, loc="outside lower center", ncols=6, frameon=False)
    return figure


def ellipse(centre: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Outline (2, 200) of the region of probability CLEAN of a Gaussian."""
    angle = np.linspace(0.0, 2 * np.pi, 200)
    circle = np.sqrt(stats.chi2.ppf(CLEAN, 2)) * np.vstack([np.cos(angle), np.sin(angle)])
    outline: np.ndarray = centre[:, None] + np.linalg.cholesky(covariance) @ circle
    return outline


def over_time(answer: Dataset) -> Figure:
    """Quality over revolutions, and over one scratch with the binary detector."""
    figure, (above, below) = figures.axes(2, 1, size=(7.5, 6.0))
    time = answer["block_time"].values
    above.plot(time, answer["block_sum"].values, color=figures.SKY, lw=0.8)
    above.plot(time, answer["block_quality"].values, color=figures.BLUE)
    above.set_title("a scratch once a revolution; lowest values of every millisecond")
    above.set_xlabel("time [s]")
    zoom = 1e3 * answer["zoom_time"].values
    below.plot(zoom, answer["zoom_diodes"].sum("diode").values, color=figures.SKY, label="sum")
    below.plot(
        zoom, answer["zoom_quality"].values, color=figures.BLUE, marker=".", label="quality signal"
    )
    below.step(
        zoom,
        1.0 - answer["zoom_binary"].values,
        where="post",
        color=figures.ORANGE,
        linestyle="--",
        label="binary, 1: no defect",
    )
    below.set_xlabel("time in the second revolution's scratch [ms]")
    for panel in (above, below):
        panel.set_ylabel("sum, quality [1]")
        panel.set_ylim(-0.05, 1.2)
    figures.legend_below(figure, below)
    return figure


def clusters(answer: Dataset) -> Figure:
    """Held-out events in two pairs of features with the clusters' 99 % ellipses."""
    figure, panels = figures.axes(1, 2, size=(10.0, 4.6))
    kind_of, points = answer["event_kind"].values, answer["features"].values
    names = [str(name) for name in answer["feature"].values]
    for panel, (x, y) in zip(panels, ((0, 1), (2, 3)), strict=True):
        for k, kind in enumerate(answer["kind"].values):
            factor = answer["cluster_factor"].values[k]
            covariance = (factor @ factor.T)[np.ix_([x, y], [x, y])]
            own = points[kind_of == k]
            style: dict[str, Any] = {
                "marker": MARKERS[k],
                "linestyle": "none",
                "markersize": 3.5,
                "alpha": 0.7,
            }
            panel.plot(own[:, x], own[:, y], color=COLOURS[k], label=str(kind), **style)
            mean = answer["cluster_mean"].values[k][[x, y]]
            panel.plot(*ellipse(mean, covariance), color=COLOURS[k], lw=1.0)
        panel.set_xlabel(names[x] + (" [1]" if "[" not in names[x] else ""))
        panel.set_ylabel(names[y] + " [1]")
    figures.legend_below(figure, panels[0])
    return figure


def tables_of(answer: Dataset) -> dict[str, str]:
    """Confusion of the kinds; delays and misses; false alarms."""
    kinds = [str(kind) for kind in answer["kind"].values]
    found = [str(name) for name in answer["found"].values]
    lines = [f"| kind | {' | '.join(found)} |", "| --- |" + " ---: |" * len(found)]
    for kind in kinds:
        counts = answer["confusion"].sel(kind=kind).values
        lines.append(f"| {kind} | {' | '.join(str(int(count)) for count in counts)} |")
    detectors = [str(name) for name in answer["detector"].values]
    rows = [
        "| kind | " + " | ".join(f"{name}: delay [us], missed" for name in detectors) + " |",
        "| --- |" + " ---: |" * len(detectors),
    ]
    for kind in kinds:
        cells = []
        for name in detectors:
            one = answer.sel(kind=kind, detector=name)
            cells.append(f"{1e6 * float(one['delay']):.0f}, {float(one['missed']):.1%}")
        rows.append(f"| {kind} | {' | '.join(cells)} |")
    conditions = [str(name) for name in answer["condition"].values]
    false = [
        "| false alarms a second | " + " | ".join(conditions) + " |",
        "| --- |" + " ---: |" * len(conditions),
    ]
    rate = answer["false_alarms"] / answer["fault_free"]
    for name in detectors:
        cells = [f"{float(rate.sel(detector=name, condition=c)):.2f}" for c in conditions]
        false.append(f"| {name} | {' | '.join(cells)} |")
    return {
        "confusion": "\n".join(lines) + "\n",
        "detection": "\n".join([*rows, "", *false]) + "\n",
    }
