"""Figure 6.7 as simulated, and the errors of each loop by disc and scratch."""

from __future__ import annotations

from typing import Any

from workbench import figures
from workbench.study import draws_summary
from workbench.types import Dataset, Figure

from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis
from .runs import CONTROLLERS

SHOWN = 0.25, 1e-3
"""Deviation over the Red Book's, and length of the scratch [m], in the figures."""


def one_record(answer: Dataset, axis: Axis) -> Figure:
    """Figure 6.7: measured and true error, and the control signal, at full and a third gain."""
    drawn, panels = figures.axes(2, 2, size=(9.0, 5.0), sharex=True, sharey="row")
    time = 1e3 * answer["time"].values
    for law, above, below in zip(CONTROLLERS, panels[:2], panels[2:], strict=False):
        one = answer.sel(controller=law)
        above.plot(time, 1e6 * one["measured"], color=figures.SKY, label="measured error")
        above.plot(time, 1e6 * one["true"], color=figures.BLUE, label="true error")
        below.plot(time, one["u"], color=figures.ORANGE)
        above.set_title(f"{axis}, {law}, one record of one draw")
        figures.label(below, x="time from the scratch [ms]")
    figures.label(panels[0], y=r"error [$\mu$m]")
    figures.label(panels[2], y="u [V]")
    figures.legend_below(drawn, panels[0])
    return drawn


def reactions(answer: Dataset, axis: Axis) -> Figure:
    """Error from the disc alone, and the part that a scratch adds, over the disc's deviation."""
    drawn, panels = figures.axes(1, 3, size=(10.0, 4.0), sharex=True, sharey=True)
    share = answer["share"].values
    names = {"disc": "disc alone", "scratch": "by the scratch", "both": "both"}
    for panel, (name, title) in zip(panels, names.items(), strict=True):
        for n, law in enumerate(CONTROLLERS):
            one = answer[name].sel(controller=law, length=SHOWN[1])
            mean, low, high = (1e6 * draws_summary(one).transpose("summary", ...)).values
            look: Any = {"color": figures.CYCLE[n], "capsize": 2, "marker": "o", "markersize": 3}
            panel.errorbar(share, mean, [mean - low, high - mean], label=law, **look)
        panel.axhline(1e6 * ACCEPTABLE_ERROR[axis], color="0.4", linewidth=0.8, linestyle=":")
        panel.set_yscale("log")
        figures.label(panel, x="deviation / Red Book [1]", title=title)
    figures.label(panels[0], y=rf"largest {axis} error [$\mu$m]")
    figures.legend_below(drawn, panels[0])
    return drawn
