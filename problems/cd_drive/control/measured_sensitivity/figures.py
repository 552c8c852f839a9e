"""Figures of measured sensitivities."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.types import Dataset, Figure

from ...drive.tables import Axis
from ..loops import SCALES

WORDS = {"full": "gain of eq. 6.12", "third": "a third of the gain"}


def figure_6_6(answer: Dataset, axis: Axis, accuracy: float) -> Figure:
    """|S| of twelve drives: simulated above, measured below; one column for each gain."""
    drawn, panels = figures.axes(2, 2, size=(9.5, 6.8), sharex=True, sharey=True)
    frequency, permitted = answer["frequency"].values, answer["permitted"].values
    for column, scale in enumerate(SCALES):
        upper, lower = panels[column], panels[2 + column]
        one = answer.sel(scale=scale, disc="ordinary")
        size, share = one["size"].values, (one["radius"] / one["size"]).values
        good = share <= accuracy
        looks: Any = {"color": figures.BLUE, "linewidth": 0.7}
        for n, curve in enumerate(one["simulated"].sel(model="told").values):
            upper.plot(frequency, curve, label="sampled, as told" if n == 0 else None, **looks)
            name = "simulated" if n == 0 else None
            lower.plot(frequency, curve, color="0.75", linewidth=0.6, label=name)
        for n, curve in enumerate(one["simulated"].sel(model="continuous").values):
            name = "in continuous time" if n == 0 else None
            upper.plot(frequency, curve, ":", color=figures.ORANGE, linewidth=0.7, label=name)
        for which, color, name in (
            (~good, figures.AMBER, f"measured, 99 % region above {100 * accuracy:.0f} %"),
            (good, figures.BLUE, f"measured, 99 % region within {100 * accuracy:.0f} %"),
        ):
            at, value = np.broadcast_to(frequency, size.shape)[which], size[which]
            lower.plot(at, value, ".", color=color, markersize=2.5, label=name)
        for panel in (upper, lower):
            panel.plot(frequency, permitted, "--", color=figures.BLACK, label="1/|W_p|")
        figures.label(upper, title=f"{axis}, {WORDS[scale]}", log="xy")
        figures.label(lower, x="frequency [Hz]", log="xy")
    figures.label(panels[0], y="|S| simulated [1]")
    figures.label(panels[2], y="|S| measured [1]")
    panels[0].set_ylim(2e-4, 5.0)
    handles = {
        name: handle
        for panel in (panels[0], panels[2])
        for handle, name in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    drawn.legend(
        handles.values(), handles.keys(), loc="outside lower center", ncols=3, frameon=False
    )
    drawn.suptitle("Sensitivities of the twelve drives (figure 6.6), first draw", fontsize=11)
    return drawn


def good_from(answer: Dataset, axis: Axis) -> Figure:
    """Frequency from which the sensitivity is measured well, for every record of each drive."""
    drawn, panels = figures.axes(1, 2, size=(9.0, 3.8), sharey=True)
    names, place = answer["drive"].values, np.arange(answer.sizes["drive"])
    colors = dict(zip(answer["disc"].values, (figures.BLUE, figures.ORANGE), strict=True))
    markers = dict(zip(answer["accuracy"].values, ("o", "^"), strict=True))
    for panel, scale in zip(panels, SCALES, strict=True):
        for step, (disc, color) in enumerate(colors.items()):
            for accuracy, marker in markers.items():
                at = {"scale": scale, "disc": disc, "accuracy": accuracy}
                value = answer["good_from"].sel(at).transpose("drive", ...).values
                told = f"{str(disc).replace('_', ' ')} disc, within {100 * accuracy:.0f} %"
                look: Any = {"markersize": 3.0, "linestyle": "none", "alpha": 0.6}
                across = np.repeat(place + 0.3 * step - 0.15, value.shape[1])
                panel.plot(across, value.ravel(), marker, color=color, label=told, **look)
        panel.set_xticks(place, [str(name)[2:] for name in names])
        figures.label(panel, x="drive CD...", title=f"{axis}, {WORDS[scale]}", log="y")
    figures.label(panels[0], y="measured well from [Hz] on")
    figures.legend_below(drawn, panels[0], columns=2)
    return drawn
