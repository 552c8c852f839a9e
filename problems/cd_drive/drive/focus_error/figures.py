"""Figures of the two methods that sense the focus.

Figure numbers are those of E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players
(2003).
"""

from __future__ import annotations

from workbench import figures
from workbench.types import Dataset, Figure

COLOURS = (figures.BLUE, figures.ORANGE, figures.GREEN)
SHOWN = {"lines": 12e-6, "diode": 2.0}
"""The design that is drawn: the astigmatic curve has its extremes as in section 4.4.1."""


def curves(answer: Dataset) -> Figure:
    """Both error curves of one design, by difference and normalised."""
    drawn, (raw, normalised) = figures.axes(2, 1, size=(7.2, 6.4), sharex=True)
    one = answer.sel(SHOWN)
    error = 1e6 * one["error"]
    for scheme, colour in zip(answer["scheme"].values, COLOURS, strict=True):
        curve = one.sel(scheme=scheme)
        raw.plot(error, curve["difference"], color=colour, label=str(scheme))
        normalised.plot(error, curve["difference"] / curve["total"], color=colour)
    raw.set_xlim(-40, 40)
    title = "Figure 2.8: focal lines 12 $\\mu$m apart, diodes twice as wide as the spot"
    figures.label(raw, y="difference / light", title=title)
    figures.label(normalised, x=r"focus error [$\mu$m]", y="difference / sum")
    figures.legend_below(drawn, raw)
    return drawn


def designs(answer: Dataset) -> Figure:
    """Capture ranges of all designs."""
    drawn, panels = figures.axes(1, 2, size=(9.0, 4.2), sharey=True)
    titles = {"apart": "between the extremes", "half": "told by half of the extremes"}
    marks = ("o", "s", "^")
    for panel, (name, title) in zip(panels, titles.items(), strict=True):
        for scheme, colour in zip(answer["scheme"].values, COLOURS, strict=True):
            for lines, mark in zip(answer["lines"].values, marks, strict=True):
                one = 1e6 * answer[name].sel(scheme=scheme, lines=lines)
                label = rf"{scheme}, {1e6 * lines:g} $\mu$m"
                panel.plot(answer["diode"], one, marker=mark, color=colour, label=label)
        figures.label(panel, x="width of the diodes / of the spot", title=title, log="y")
    panels[0].set_ylabel(r"capture range [$\mu$m]")
    figures.legend_below(drawn, panels[0], columns=3)
    return drawn
