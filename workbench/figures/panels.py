"""Axes, labels, colours and legends of the one style that every room draws in."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from workbench._core.heavy_types import Axes, Figure
from workbench.figures.limits import finite_axes, mend_limits
from workbench.figures.styles import current_style
from workbench.figures.ticks import house_ticks

BLACK, BLUE, ORANGE, GREEN = "#222222", "#0072b2", "#d55e00", "#009e73"
PURPLE, SKY, AMBER = "#cc79a7", "#56b4e9", "#e69f00"
CYCLE = (BLUE, ORANGE, GREEN, PURPLE, SKY, AMBER, BLACK)
"""Okabe and Ito's colours, which colour-blind readers tell apart, in the order of curves."""


def axes(
    rows: int, columns: int, *, size: tuple[float, float] = (7.0, 4.2), **keywords: Any
) -> tuple[Figure, list[Axes]]:
    """A figure of the current style and its axes, row by row.

    ``size`` [inch] is the size on a screen; a style that sets its own width keeps the proportions.
    """
    import matplotlib as mpl
    from cycler import cycler

    style = current_style()
    with mpl.rc_context({**style.settings, "axes.prop_cycle": cycler(color=CYCLE)}):
        figure: Figure = _shown_figure()(figsize=style.size(size, rows))
        # Polar axes, which a keyword asks for, are Matplotlib's own.
        own = {"subplot_kw": {"axes_class": finite_axes()}} | keywords
        grid = figure.subplots(rows, columns, squeeze=False, **own)
    return figure, list(grid.flat)


@cache
def _shown_figure() -> Any:
    """The class of figures that a notebook shows.

    They have the workbench's ticks wherever they are drawn.
    """
    from matplotlib.figure import Figure

    class ShownFigure(Figure):
        def savefig(self, *args: Any, **keywords: Any) -> None:
            for panel in self.axes:
                mend_limits(panel)
                house_ticks(panel)
            super().savefig(*args, **keywords)

        def _repr_png_(self) -> bytes:
            file = io.BytesIO()
            self.savefig(file, format="png")
            return file.getvalue()

    return ShownFigure


MOST_NAMES = 8
"""Most curves of a figure that have their own colours and names."""


def bode_plot(
    frequency_hz: np.ndarray, curves: Mapping[str, np.ndarray], unit: str, *, many: str = ""
) -> Figure:
    """Bode plot of responses (F,) by name over ``frequency_hz`` (F,) [Hz]; NaN is left out.

    With more than `MOST_NAMES` responses, all are grey under the one name ``many``.
    """
    figure, (top, bottom) = axes(2, 1, size=(7.0, 6.0), sharex=True)
    look: dict[str, Any] = {}
    if len(curves) > MOST_NAMES:
        look = {"color": "0.6", "linewidth": 0.7}
    for k, (name, response) in enumerate(curves.items()):
        shown = np.isfinite(response)
        words = name if not look else many if k == 0 else None
        top.plot(frequency_hz[shown], np.abs(response[shown]), label=words, **look)
        bottom.plot(frequency_hz[shown], phase(response[shown]), **look)
    label(top, y=f"magnitude [{unit}]", log="y")
    wide = frequency_hz[-1] > 20 * frequency_hz[0]
    label(bottom, x="frequency [Hz]", y="phase [deg]", log="x" if wide else "")
    legend_below(figure, top)
    return figure


def numbers_in(name: str) -> list[str]:
    """Figure numbers in a figure's name: "figure-7-5-7-10" names figures 7.5 and 7.10."""
    if not re.fullmatch(r"figure(-[0-9A-Z]+-[0-9]+)+", name):
        return []
    return [f"{chapter}.{place}" for chapter, place in re.findall(r"-([0-9A-Z]+)-([0-9]+)", name)]


def with_figure_numbers(figure: Figure, *numbers: str) -> Figure:
    """Write above a figure which figures of a publication it reproduces, such as "Figure 5.12".

    The same figure is returned. It stays unchanged if it shows the numbers already, or if none are
    given.
    """
    before = figure.get_suptitle()
    said = " ".join([before, *(panel.get_title() for panel in figure.axes)])
    words = ("Figure " if len(numbers) == 1 else "Figures ") + ", ".join(numbers)
    if all(re.search(rf"\b{re.escape(one)}\b", said) for one in numbers):
        return figure
    figure.suptitle(f"{words}\n{before}" if before else words, fontsize=11)
    return figure


def phase(response: np.ndarray) -> np.ndarray:
    """Unwrapped phase [deg] of a response along its last axis."""
    turned: np.ndarray = np.degrees(np.unwrap(np.angle(response)))
    return turned


def label(panel: Axes, *, x: str = "", y: str = "", title: str = "", log: str = "") -> None:
    """Label axes, give them a title, and make those of ``log`` ("x", "y" or "xy") logarithmic.

    Ticks of a logarithmic axis are plain numbers if all lie between 0.001 and 10,000; otherwise all
    are powers of ten.
    """
    for axis in log:
        getattr(panel, f"set_{axis}scale")("log")
    for words, put in ((x, panel.set_xlabel), (y, panel.set_ylabel), (title, panel.set_title)):
        if words:
            put(words)
    house_ticks(panel)


def axis_label(values: Any, name: str) -> str:
    """Label of an axis: the meaning of the array (or its name) and its unit."""
    unit = values.attrs.get("units", "1")
    meaning = values.attrs.get("long_name", name.replace("_", " "))
    return meaning if unit == "1" else f"{meaning} [{unit}]"


def legend_below(figure: Figure, source: Axes, *, columns: int = 4) -> None:
    """A legend below the axes, where it covers no data, with as many columns as fit."""
    handles, labels = source.get_legend_handles_labels()
    for count in range(columns, 0, -1):
        legend = figure.legend(
            handles, labels, loc="outside lower center", ncols=count, frameon=False
        )
        if count == 1 or legend.get_window_extent().width <= figure.bbox.width:
            return
        legend.remove()


def along_batch(panel: Any, values: Any, labels: Any = None) -> None:
    """Draw one number for each matrix of a batch, against the labels of the batch's axis.

    Without labels, or for a batch with several axes, they are drawn against the number of the
    matrix. Frequencies are on a logarithmic scale.
    """
    names = [] if labels is None else [str(name) for name in labels.dims[:-2]]
    name = names[0] if len(names) == 1 else ""
    place = labels.coords[name] if name and name in labels.coords else None
    over = np.arange(np.size(values)) if place is None else place.values
    if place is None:
        # there is nothing between two matrices to join by a line
        panel.plot(over, np.ravel(values), "o")
        panel.xaxis.get_major_locator().set_params(integer=True)
        panel.set_xlabel("number of the matrix")
        return
    panel.plot(over, np.ravel(values), ".-")
    units = place.attrs.get("units", "1")
    panel.set_xlabel(axis_label(place, name))
    if units in ("Hz", "rad/s") and (over > 0).all():
        panel.set_xscale("log")
