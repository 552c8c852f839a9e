"""How the methods of a comparison look, the same in every figure."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import cycle, islice
from typing import Any

from workbench.bench.comparison.layout import METHOD
from workbench.figures import CYCLE
from workbench.heavy_types import Axes, Dataset, Figure

MARKERS = "osD^vp<>*hdP"
"""None is a cross, which marks a false claim."""
LINES = ("-", "--", "-.", ":")
GID = "method:"
"""Prefix of the id of everything drawn for a method, by which a page shows or hides it."""
WIDTH = 7.4
"""Width of a figure [inches]: a column and a half of a journal."""
ROW = 0.22
"""Height of a row of a legend [inches]."""


@dataclass(frozen=True)
class Look:
    """Colour, marker and line of a method."""

    name: str
    colour: str
    marker: str
    line: Any

    @property
    def drawn(self) -> dict[str, Any]:
        """Keywords of everything drawn for the method."""
        return {"color": self.colour, "gid": f"{GID}{self.name}"}


def method_looks(data: Dataset) -> dict[str, Look]:
    """The look of every method of a comparison, by name.

    Up to seven methods differ in colour, marker and line. Those that share a colour, seven apart,
    differ in marker and line.
    """
    names = [str(name) for name in data[METHOD].values]
    lines = [LINES[(i + 2 * (i // len(CYCLE))) % len(LINES)] for i in range(len(names))]
    markers = islice(cycle(MARKERS), len(names))
    colours = islice(cycle(CYCLE), len(names))
    parts = zip(names, colours, markers, lines, strict=True)
    return {name: Look(name, *each) for name, *each in parts}


def legend(figure: Figure, handles: list[Any], width: float = WIDTH) -> None:
    """A legend below the axes, in as many columns as the longest of its labels allows.

    The figure grows by the height of the legend, so that the axes keep theirs.
    """
    labels = [str(handle.get_label()) for handle in handles]
    longest = max(map(len, labels), default=1)
    columns = max(1, min(len(labels), int(width / (0.55 + 0.075 * longest))))
    rows = -(-len(labels) // columns)
    figure.set_figheight(figure.get_figheight() + ROW * rows)
    figure.legend(
        handles=handles, loc="outside lower center", ncols=columns, frameon=False, fontsize=9
    )


def keys(looks: dict[str, Look], *, line: bool = True, marker: bool = True) -> list[Any]:
    """Legend entries of methods."""
    from matplotlib.lines import Line2D

    return [
        Line2D(
            [],
            [],
            color=look.colour,
            linestyle=look.line if line else "none",
            marker=look.marker if marker else "none",
            markersize=5,
            label=look.name,
        )
        for look in looks.values()
    ]


def shortened(title: str, most: int = 46) -> str:
    """A title that fits above a panel: a long one loses its middle."""
    if len(title) <= most:
        return title
    half = (most - 3) // 2
    return f"{title[:half]}...{title[-half:]}"


def share_axis(panel: Axes) -> None:
    """A vertical axis of shares from 0 to 1."""
    panel.set_ylim(-0.03, 1.03)
    panel.set_yticks([0.0, 0.25, 0.5, 0.75, 1.0])
