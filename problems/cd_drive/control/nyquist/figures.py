"""Figure 6.8: sets of the open loop in the Nyquist plane, and their distance from -1."""

from __future__ import annotations

import numpy as np

from workbench import figures
from workbench.geometry import Stadium, outline
from workbench.types import Axes, Dataset, Figure

NEAR = ((-2.6, 0.6), (-2.4, 0.6))
"""Ranges of real and imaginary parts shown near -1."""
MOST_SETS = 60
"""Largest number of sets in a figure; frequencies in between are left out."""


def planes(answer: Dataset, high: tuple[float, float]) -> Figure:
    """Sets of one kind: stadiums left and circles right; all sets above, those near -1 below."""
    figure, panels = figures.axes(2, 2, size=(9.5, 8.6))
    for column, form in enumerate(("stadium", "circle")):
        one = answer.sel(shape=form)
        whole, near = panels[column], panels[2 + column]
        _draw(whole, one, figures.BLUE)
        _draw(near, one.sel(frequency=slice(*high)), figures.BLUE)
        up = "imaginary part [1]" if column == 0 else ""
        figures.label(whole, y=up, title=f"{form}s ({answer['kind'].values!s} sets)")
        band = f"{high[0]:g} to {high[1]:g} Hz"
        figures.label(near, x="real part of $L$ [1]", y=up, title=f"{form}s, {band}")
        whole.set_aspect("equal", adjustable="datalim")
        near.set(xlim=NEAR[0], ylim=NEAR[1], aspect="equal")
        whole.locator_params(axis="x", nbins=6)
    figures.legend_below(figure, panels[2])
    return figure


def _draw(panel: Axes, one: Dataset, colour: str) -> None:
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import to_rgb

    drawn = one.isel(frequency=slice(None, None, 1 + one.sizes["frequency"] // MOST_SETS))
    parts = (drawn[name].values for name in ("center", "radius", "half_length", "angle"))
    corners = [np.column_stack([line.real, line.imag]) for line in outline(Stadium(*parts))]
    edge, face = ((*to_rgb(colour), alpha) for alpha in (0.6, 0.04))
    sets = PolyCollection(corners, linewidths=0.5, edgecolors=[edge], facecolors=[face])
    panel.add_collection(sets)
    sets.set_label("sets")
    L = one["L"].values
    (dots,) = panel.plot(
        L.real.ravel(), L.imag.ravel(), ".", color="0.3", markersize=1, label="drives"
    )
    for many in (sets, dots):
        many.set_rasterized(True)  # so many outlines would make a vector figure large
    panel.plot(-1, 0, "x", color=figures.ORANGE, markersize=9, markeredgewidth=2, label="-1")
    panel.autoscale()


def clearances(answer: Dataset, kinds: list[str]) -> Figure:
    """Distance of -1 from the sets, over its distance from their centres; 0 if a set
    contains -1.
    """
    figure, panels = figures.axes(1, 2, size=(9.5, 4.8), sharex=True, sharey=True)
    for panel, form in zip(panels, answer["shape"].values, strict=True):
        for kind in kinds:
            one = answer.sel(shape=form, kind=kind)
            style = {"second": "-", "third": "--", "fitted": ":"}.get(kind.split()[-1], "-")
            colour = {"steps": figures.BLUE, "joint": figures.ORANGE, "first": figures.GREEN}
            clear = one["distance"] / abs(one["center"] + 1)
            shade = colour.get(kind.split()[0], figures.BLACK)
            panel.plot(one["frequency"], clear, style, color=shade, label=kind)
        panel.axhline(0.0, color=figures.BLACK, linewidth=0.8)
        panel.set_ylim(-1.5, 1.05)
        figures.label(panel, x="frequency [Hz]", title=f"{form}s", log="x")
    figures.label(panels[0], y="distance of -1 / distance of the centre [1]")
    figures.legend_below(figure, panels[0])
    return figure
