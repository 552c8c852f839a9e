"""Figures of the gain control."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.types import Dataset, Figure

from ...drive.tables import Axis

SHOWN = ("ordinary", "red_book", "scratch")
"""Discs whose starts are drawn."""


def levels(answer: Dataset, axis: Axis) -> Figure:
    """|L| at the wobble's frequency for every drive while the gain is adjusted, first draw."""
    drawn, panels = figures.axes(1, len(SHOWN), size=(10.0, 3.6), sharey=True)
    for panel, arm in zip(panels, SHOWN, strict=True):
        for one in answer["level"].sel(arm=arm).values:
            panel.plot(answer["time"].values, one, color=figures.BLUE, linewidth=0.8)
        panel.axhline(0.0, color=figures.BLACK, linewidth=0.8, linestyle="--")
        title = f"{axis}, {arm.replace('_', ' ')} disc" if arm != "scratch" else f"{axis}, scratch"
        figures.label(panel, x="time with the wobble [s]", title=title)
    figures.label(panels[0], y="|L| at the wobble [dB]")
    return drawn


def spreads(answer: Dataset, axis: Axis) -> Figure:
    """|L| at the wobble's frequency for every drive, before and after, on every disc."""
    drawn, (panel,) = figures.axes(1, 1, size=(7.0, 4.0))
    place, arms = np.arange(answer.sizes["drive"]), answer["arm"].values.tolist()
    panel.plot(place - 0.4, answer["before"], "x", color=figures.BLACK, label="before")
    for n, arm in enumerate(arms):
        value = answer["after"].sel(arm=arm).transpose("drive", "draw").values
        look: Any = {"markersize": 3.0, "alpha": 0.6, "color": figures.CYCLE[n]}
        across = np.repeat(place - 0.2 + 0.14 * n, value.shape[1])
        panel.plot(across, value.ravel(), ".", label=f"after, {arm.replace('_', ' ')}", **look)
    panel.axhline(0.0, color=figures.BLACK, linewidth=0.8, linestyle="--")
    panel.set_xticks(place, [str(name)[2:] for name in answer["drive"].values])
    figures.label(panel, x="drive CD...", y="|L| at the wobble [dB]", title=f"{axis}, all draws")
    figures.legend_below(drawn, panel, columns=3)
    return drawn
