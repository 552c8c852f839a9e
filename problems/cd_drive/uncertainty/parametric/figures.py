"""Figures of the parametric uncertainty: relative deviations, and the band around the nominal."""

from __future__ import annotations

from workbench import figures
from workbench.heavy_types import Dataset, Figure

LOOKS = {
    "nine": ("nine parameters", figures.BLUE, "-"),
    "without gain": ("without the total gain", figures.GREEN, "-"),
    "reduced": ("R, k1, k2 (Table 5.3)", figures.ORANGE, "--"),
}


def deviation_figure(answer: Dataset) -> Figure:
    """Largest relative deviation of each set, and those of the drives with either gain."""
    figure, panels = figures.axes(2, 1, size=(7.0, 7.0), sharex=True, sharey=True)
    hertz = answer["frequency"].values
    away = abs(answer["drives"] / answer["nominal"] - 1)
    shown = {"own": ("nine",), "agc": ("without gain", "reduced")}
    titles = {"own": "drives with their own gains", "agc": "drives as the gain control leaves them"}
    for panel, (gain, names) in zip(panels, shown.items(), strict=True):
        for k, one in enumerate(away.sel(gain=gain).values):
            panel.loglog(hertz, one, color="0.7", lw=0.6, label="" if k else "twelve drives")
        for name in names:
            label, colour, dash = LOOKS[name]
            panel.loglog(hertz, answer["deviation"].sel(set=name), dash, color=colour, label=label)
        if gain == "own":
            panel.loglog(
                hertz,
                answer["sought"],
                ":",
                color=figures.BLACK,
                label="interior, as far as sought",
            )
        panel.set_title(titles[gain])
        panel.set_ylabel("|G_p / G - 1| [1]")
        panel.set_ylim(1e-2, 8 * float(answer["deviation"].max()))  # room for the legend
        panel.legend(loc="upper right", frameon=False)
    panels[-1].set_xlabel("frequency [Hz]")
    return figure


def bode_figure(answer: Dataset) -> Figure:
    """Magnitude of the nominal within the band that each set fills."""
    figure, (panel,) = figures.axes()
    hertz = answer["frequency"].values
    for name, alpha in (("nine", 0.25), ("reduced", 0.45)):
        label, colour, _ = LOOKS[name]
        one = answer.sel(set=name)
        panel.fill_between(
            hertz, one["least"], one["most"], color=colour, alpha=alpha, lw=0, label=label
        )
    panel.loglog(hertz, abs(answer["nominal"]), color=figures.BLACK, label="nominal (Table 5.2)")
    panel.set_xlabel("frequency [Hz]")
    panel.set_ylabel("|f_en / u| [units/V]")
    figures.legend_below(figure, panel, columns=3)
    return figure
