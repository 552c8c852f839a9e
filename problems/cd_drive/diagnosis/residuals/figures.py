"""Figures of `cd/{axis}/residuals`."""

from __future__ import annotations

from typing import Any

from workbench import figures
from workbench.figures import label, legend_below
from workbench.heavy_types import Dataset, Figure

NAMES = {
    "sum": "sum signal",
    "quality": "quality signal",
    "error": "error, high-passed",
    "cusum": "CUSUM of the sum",
    "glr": "GLR of the sum",
}
"""Statistics as tables and figures name them."""
STYLES = {"sum": "-", "quality": "--", "error": "-.", "cusum": "-", "glr": ":"}
MARKERS = {"sum": "o", "quality": "s", "error": "^", "cusum": "D", "glr": "v"}
SHOWN_DEPTH = 0.1
"""Depth of the defects whose curves are shown over length and noise."""


def curves(answer: Dataset) -> Figure:
    """A panel for each length (column) and noise (row), defects of one depth."""
    lengths, noises = answer["length"].values, answer["noise"].values
    figure, panels = figures.axes(
        len(noises), len(lengths), size=(9.0, 8.4), sharex=True, sharey=True
    )
    for row, noise in enumerate(noises):
        for column, length in enumerate(lengths):
            panel = panels[row * len(lengths) + column]
            one = answer["detection"].sel(depth=SHOWN_DEPTH, length=length, noise=noise)
            for name, text in NAMES.items():
                curve = one.sel(statistic=name).values[1:]
                panel.plot(answer["rate"].values[1:], curve, STYLES[name], label=text)
            label(
                panel,
                "false alarms per window [1]" if row == len(noises) - 1 else "",
                "detection rate [1]" if column == 0 else "",
                f"{1e3 * length:g} mm, noise {1e6 * noise:g} $\\mu$m",
                "x",
            )
    panels[0].set_ylim(-0.02, 1.02)
    figure.suptitle(f"defects that take {SHOWN_DEPTH:.0%} of the light")
    legend_below(figure, panels[0], columns=5)
    return figure


def areas(answer: Dataset) -> Figure:
    """Area under the curve with two standard errors, and delay, over depth at the usual noise."""
    lengths = answer["length"].values
    usual = answer.isel(noise=len(answer["noise"]) // 2)
    figure, panels = figures.axes(2, len(lengths), size=(9.5, 6.4), sharex=True, sharey="row")
    depth = 100 * answer["depth"].values
    for column, length in enumerate(lengths):
        above, below = panels[column], panels[len(lengths) + column]
        for number, (name, text) in enumerate(NAMES.items()):
            one = usual.sel(length=length, statistic=name)
            beside = depth * 1.03 ** (number - 2)  # so that the bars can be told apart
            look: Any = {"marker": MARKERS[name], "markersize": 4.0}
            spread = 2 * one["deviation"].values
            above.errorbar(
                beside, one["area"], spread, fmt=STYLES[name], capsize=2.0, label=text, **look
            )
            delay = one["delay"].where(one["missed"] <= 0.5)
            below.plot(beside, 1e3 * delay, STYLES[name], **look)
        label(above, title=f"{1e3 * length:g} mm")
        label(below, "light taken [%]", log="xy")
        below.set_xticks(depth, [f"{one:g}" for one in depth])
        below.minorticks_off()
    label(panels[0], y="area under the ROC curve [1]")
    label(panels[len(lengths)], y="mean delay, where half are found [ms]")
    legend_below(figure, panels[0], columns=5)
    return figure
