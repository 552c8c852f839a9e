"""Figures of `cd/{axis}/residuals`."""

from __future__ import annotations

from typing import Any

from workbench import figures
from workbench.figures import label, legend_below
from workbench.study import draws_summary
from workbench.types import Dataset, Figure

from .trials import at_usual_noise

NAMES = {
    "sum": "sum signal",
    "quality": "quality signal",
    "error": "error, high-passed",
    "cusum": "CUSUM of the sum",
    "glr": "GLR of the sum",
}
"""Names of the statistics in tables and figures."""
STYLES = {"sum": "-", "quality": "--", "error": "-.", "cusum": "-", "glr": ":"}
MARKERS = {"sum": "o", "quality": "s", "error": "^", "cusum": "D", "glr": "v"}
SHOWN_DEPTH = 0.1
"""Depth of the defects whose curves are shown over length and noise."""


def curves(answer: Dataset) -> Figure:
    """One panel for each length (column) and noise (row), with defects of one depth."""
    lengths, noises = answer["length"].values, answer["noise"].values
    figure, panels = figures.axes(
        len(noises), len(lengths), size=(9.0, 8.4), sharex=True, sharey=True
    )
    rate = answer["rate"].values[1:]
    for row, noise in enumerate(noises):
        for column, length in enumerate(lengths):
            panel = panels[row * len(lengths) + column]
            one = answer["detection"].sel(depth=SHOWN_DEPTH, length=length, noise=noise)
            for number, (name, text) in enumerate(NAMES.items()):
                mean, low, high = one.sel(statistic=name).transpose("summary", "rate").values[:, 1:]
                colour = figures.CYCLE[number]
                panel.fill_between(rate, low, high, color=colour, alpha=0.15, linewidth=0)
                panel.plot(rate, mean, STYLES[name], color=colour, label=text)
            label(
                panel,
                x="false alarms per window [1]" if row == len(noises) - 1 else "",
                y="detection rate [1]" if column == 0 else "",
                title=f"{1e3 * length:g} mm, noise {1e6 * noise:g} $\\mu$m",
                log="x",
            )
    panels[0].set_ylim(-0.02, 1.02)
    figure.suptitle(
        f"defects that take {SHOWN_DEPTH:.0%} of the light: mean and 90 % of "
        f"{answer.sizes['draw']} draws"
    )
    legend_below(figure, panels[0], columns=5)
    return figure


def areas(answer: Dataset) -> Figure:
    """Area under the curve, and delay, over depth at the usual noise."""
    lengths = answer["length"].values
    area, delay, missed = (at_usual_noise(answer[n]) for n in ("area", "delay", "missed"))
    found = delay.where(missed.mean("draw") <= 0.5)
    figure, panels = figures.axes(2, len(lengths), size=(9.5, 6.4), sharex=True, sharey="row")
    depth = 100 * answer["depth"].values
    for row, values in enumerate((draws_summary(area), draws_summary(1e3 * found))):
        for column, length in enumerate(lengths):
            panel = panels[row * len(lengths) + column]
            for number, (name, text) in enumerate(NAMES.items()):
                one = values.sel(length=length, statistic=name)
                mean, low, high = one.transpose("summary", "depth").values
                beside = depth * 1.03 ** (number - 2)  # so that the bars can be distinguished
                look: Any = {"marker": MARKERS[name], "markersize": 4.0, "label": text}
                (line,) = panel.plot(beside, mean, STYLES[name], **look)
                panel.vlines(beside, low, high, color=line.get_color(), linewidth=1.0)
    for column, length in enumerate(lengths):
        label(panels[column], title=f"{1e3 * length:g} mm")
        label(panels[len(lengths) + column], x="light taken [%]", log="xy")
        panels[column].set_xticks(depth, [f"{one:g}" for one in depth])
        panels[column].minorticks_off()
    label(panels[0], y="area under the ROC curve [1]")
    label(panels[len(lengths)], y="mean delay, where half are found [ms]")
    figure.suptitle(f"mean and 90 % of {answer.sizes['draw']} draws")
    legend_below(figure, panels[0], columns=5)
    return figure
