"""Figures of the parametric uncertainty: relative deviations, and the band around the nominal."""

from __future__ import annotations

from typing import Any

from workbench import figures
from workbench.types import Dataset, Figure

LOOKS = {
    "nine": ("nine parameters", figures.BLUE, "-"),
    "without gain": ("without the total gain", figures.GREEN, "-"),
    "reduced": ("R, k1, k2 (Table 5.3)", figures.ORANGE, "--"),
}


def deviation_figure(answer: Dataset) -> Figure:
    """Largest relative deviation of each set, and those of the drives with either gain."""
    drawn, panels = figures.axes(2, 1, size=(7.0, 7.0), sharex=True, sharey=True)
    hertz = answer["frequency"].values
    away = abs(answer["drives"] / answer["nominal"] - 1)
    shown = {"own": ("nine",), "agc": ("without gain", "reduced")}
    titles = {"own": "drives with their own gains", "agc": "drives as the gain control leaves them"}
    for panel, (gain, names) in zip(panels, shown.items(), strict=True):
        for k, one in enumerate(away.sel(gain=gain).values):
            panel.plot(hertz, one, color="0.7", lw=0.6, label="" if k else "twelve drives")
        for name in names:
            label, colour, dash = LOOKS[name]
            panel.plot(hertz, answer["deviation"].sel(set=name), dash, color=colour, label=label)
        if gain == "own":
            look: Any = {"color": figures.BLACK, "label": "interior, as far as sought"}
            panel.plot(hertz, answer["sought"], ":", **look)
        figures.label(panel, y="$|G_p / G - 1|$ [1]", title=titles[gain], log="xy")
        panel.set_ylim(1e-2, 8 * float(answer["deviation"].max()))  # room for the legend
        panel.legend(loc="upper right", frameon=False)
    figures.label(panels[-1], x="frequency [Hz]")
    return drawn


def bode_figure(answer: Dataset) -> Figure:
    """Magnitude of the nominal plant, with the band of each set."""
    drawn, (panel,) = figures.axes(1, 1)
    hertz = answer["frequency"].values
    for name, alpha in (("nine", 0.25), ("reduced", 0.45)):
        label, colour, _ = LOOKS[name]
        one = answer.sel(set=name)
        look: Any = {"color": colour, "alpha": alpha, "lw": 0, "label": label}
        panel.fill_between(hertz, one["least"], one["most"], **look)
    panel.plot(hertz, abs(answer["nominal"]), color=figures.BLACK, label="nominal (Table 5.2)")
    figures.label(panel, x="frequency [Hz]", y="$|f_{en} / u|$ [units/V]", log="xy")
    figures.legend_below(drawn, panel, columns=3)
    return drawn
