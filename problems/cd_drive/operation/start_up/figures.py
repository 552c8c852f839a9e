"""Figures of one start-up, and of the outcomes of many."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.study import share_interval
from workbench.types import Dataset, Figure

from .runs import LAWS, OUTCOMES

SHADES = (figures.GREEN, figures.ORANGE, figures.PURPLE, figures.BLACK, "0.8")
COLOURS = dict(zip(OUTCOMES, SHADES, strict=True))


def started(answer: Dataset) -> Figure:
    """The whole start-up, and the milliseconds around the closing of the loop."""
    drawn, panels = figures.axes(2, 2, size=(9.0, 5.2), sharex="col")
    lens, zoom = panels[0], panels[1]
    lens.plot(answer["shown_time"], 1e3 * answer["whole_lens"], color=figures.BLUE)
    lens.axhline(0.0, color="0.4", linewidth=0.8, linestyle=":")
    figures.label(lens, y="lens, from the layer [mm]", title="CD1, 5 mm/s")
    panels[2].plot(answer["shown_time"], answer["whole_sum"], color=figures.ORANGE)
    figures.label(panels[2], x="time [s]", y="sum over the layer's [1]")
    time = 1e3 * answer["time"]
    zoom.plot(time, 1e6 * answer["zoom_error"], color=figures.BLUE, label="true error")
    zoom.axvline(0.0, color="0.4", linewidth=0.8)
    figures.label(zoom, y=r"true error [$\mu$m]", title="about the closing of the loop")
    panels[3].plot(time, answer["zoom_read"], color=figures.SKY, label="normalised error [1]")
    panels[3].plot(time, answer["zoom_u"], color=figures.ORANGE, label="control voltage [V]")
    panels[3].axvline(0.0, color="0.4", linewidth=0.8)
    panels[3].legend()
    figures.label(panels[3], x="time from the closing [ms]")
    return drawn


def by_speed(answer: Dataset) -> Figure:
    """Outcomes by the ramp's speed: share captured on each disc, and all kinds of outcome by
    threshold.
    """
    drawn, panels = figures.axes(1, 5, size=(13.0, 4.0), sharey=True, sharex=True)
    names = [f"{1e3 * one:g}" for one in answer["speed"].values]
    place = np.arange(len(names))
    captured = answer["outcome"].sel(law=LAWS[0]) == OUTCOMES.index("captured")
    for n, share in enumerate(answer["share"].values):
        told = share_interval(captured.sel(share=share), "speed").transpose("summary", "speed")
        mean, low, high = 100 * told.values
        look: Any = {"color": figures.CYCLE[n], "capsize": 2, "marker": "o", "markersize": 3}
        label = f"{share:g} of the Red Book"
        reach = [mean - low, high - mean]
        panels[0].errorbar(place + 0.08 * (n - 1.5), mean, reach, label=label, **look)
    panels[0].set_title("captured, 99 %")
    figures.label(panels[0], y="share of starts [%]")
    for panel, law in zip(panels[1:], LAWS, strict=True):
        one = answer["outcome"].sel(law=law)
        before = np.zeros(len(names))
        for n, kind in enumerate(OUTCOMES):
            share = 100 * (one == n).mean(["share", "drive", "draw"]).values
            panel.bar(place, share, 0.8, before, color=COLOURS[kind], label=kind)
            before = before + share
        panel.set_title(law)
    for panel in panels:
        panel.set_xticks(place, names)
        figures.label(panel, x="ramp [mm/s]")
    panels[0].legend(loc="lower left", fontsize="x-small")
    figures.legend_below(drawn, panels[1], columns=len(OUTCOMES))
    return drawn


def by_relative_speed(answer: Dataset) -> Figure:
    """Largest error after closing over the relative speed, with both bounds."""
    drawn, (panel,) = figures.axes(1, 1, size=(7.0, 4.4))
    one = answer.sel(law=LAWS[0])
    speed, error = 1e3 * abs(one["relative"].values.ravel()), 1e6 * one["overshoot"].values.ravel()
    kinds = one["outcome"].values.ravel()
    for n, kind in enumerate(OUTCOMES):
        if (kinds == n).any():
            at = kinds == n
            panel.plot(speed[at], error[at], ".", markersize=3, color=COLOURS[kind], label=kind)
    for name, text in (("held", "linear up to here"), ("escape", "no voltage holds it")):
        ends = 1e3 * answer[name].min(), 1e3 * answer[name].max()
        panel.axvspan(*map(float, ends), color="0.85", zorder=0)
        look: Any = {"rotation": 90, "va": "bottom", "ha": "right", "fontsize": "small"}
        panel.text(float(ends[0]), 0.03, text, transform=panel.get_xaxis_transform(), **look)
    panel.axhline(2.0, color="0.4", linewidth=0.8, linestyle=":")
    panel.axhline(6.0, color="0.4", linewidth=0.8, linestyle="--")
    panel.set_xscale("log")
    panel.set_yscale("log")
    figures.label(
        panel, x="relative speed at the closing [mm/s]", y=r"largest error after it [$\mu$m]"
    )
    panel.legend(loc="upper left")
    return drawn
