"""Figures of single recoveries, and of the times of many."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.types import Dataset, Figure

from ...drive.tables import Axis
from .report import whole_time


def one_recovery(answer: Dataset, axis: Axis) -> Figure:
    """Error, sum and voltage after two causes, on CD1."""
    causes = answer["shown_cause"].values.tolist()
    drawn, panels = figures.axes(3, len(causes), size=(9.0, 6.0), sharex="col", sharey="row")
    time = 1e3 * answer["moment"]
    rows = (
        ("shown_error", 1e6, rf"true {axis} error [$\mu$m]", figures.BLUE),
        ("shown_sum", 1.0, "sum over its largest", figures.GREEN),
        ("shown_u", 1.0, "u [V]", figures.ORANGE),
    )
    for n, (name, factor, text, colour) in enumerate(rows):
        for m, cause in enumerate(causes):
            panel = panels[n * len(causes) + m]
            panel.plot(time, factor * answer[name].sel(shown_cause=cause), color=colour)
            panel.axvline(0.0, color="0.4", linewidth=0.8)
            if n == 0:
                panel.set_title(f"{cause}, CD1")
                panel.set_yscale("symlog", linthresh=1.0)
            if n == 2:
                figures.label(panel, x="time from the cause [ms]")
        figures.label(panels[n * len(causes)], y=text)
    return drawn


def times_by_cause(answer: Dataset, axis: Axis) -> Figure:
    """Times until the data are back, all drives and draws, by cause and patience."""
    drawn, (panel,) = figures.axes(1, 1, size=(8.0, 4.4))
    causes, time = answer["cause"].values.tolist(), 1e3 * whole_time(answer)
    count = answer.sizes["patience"]
    for n, patience in enumerate(answer["patience"].values):
        for m, cause in enumerate(causes):
            one = np.sort(time.sel(patience=patience, cause=cause).values.ravel())
            at = (
                m + 0.8 * (n - (count - 1) / 2) / max(count, 2) + np.linspace(-0.06, 0.06, one.size)
            )
            label: Any = f"{1e3 * patience:g} ms in the dark" if count > 1 and not m else None
            panel.plot(at, one, ".", markersize=4, color=figures.CYCLE[n], label=label)
    panel.set_yscale("log")
    panel.set_xticks(range(len(causes)), causes)
    figures.label(panel, x="", y="time until the data are back [ms]", title=f"{axis}, 12 drives")
    if count > 1:
        figures.legend_below(drawn, panel, columns=count)
    return drawn
