"""Figures of ratios on a logarithmic axis, which show how much faster a method is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from workbench import figures
from workbench.types import DataArray, Figure


def ratio_bars(ratios: Mapping[str, float], x: str, wanted: Sequence[float] = ()) -> Figure:
    """A horizontal bar for each labelled ratio, and a mark at the ratio asked for."""
    figure, (panel,) = figures.axes(1, 1, size=(7.5, 3.4))
    place = np.arange(len(ratios))
    panel.barh(place, list(ratios.values()), color=figures.BLUE, height=0.55, label="measured")
    for y, value in zip(place, ratios.values(), strict=True):
        text = f"{value:,.0f}" if value >= 100 else f"{value:.3g}"
        panel.annotate(text, (value, y), (4, 0), textcoords="offset points", va="center")
    panel.set_yticks(place, list(ratios))
    panel.invert_yaxis()
    panel.margins(x=0.12)
    figures.label(panel, x=x, log="x")
    if wanted:
        panel.plot(wanted, place, "|", color=figures.ORANGE, markersize=22, label="asked for")
        figures.legend_below(figure, panel)
    return figure


def ratios_by_size(over: DataArray, wanted: Mapping[int, float]) -> Figure:
    """Times divided by those of eigenvalues (kind, size), and the largest ratio asked for at each
    size.
    """
    figure, (panel,) = figures.axes(1, 1)
    for kind in over["kind"].values:
        panel.plot(over["size"], over.sel(kind=kind), "o-", label=kind)
    panel.plot(list(wanted), list(wanted.values()), "k:", label="asked for at most")
    figures.label(panel, x="size of the matrix", y="time over that of eigenvalues", log="xy")
    panel.set_xticks(list(wanted), map(str, wanted), minor=False)
    panel.set_xticks([], minor=True)  # the y axis has labels enough
    figures.legend_below(figure, panel, columns=2)
    return figure
