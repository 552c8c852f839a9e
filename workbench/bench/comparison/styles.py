"""Colours, markers and lines of a comparison's methods, the same in every figure."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import cycle, islice
from typing import Any

import numpy as np

from workbench._core.heavy_types import Axes, Dataset, Figure
from workbench.bench.comparison.layout import METHOD, asked_cells
from workbench.figures import CYCLE

MARKERS = "osD^vp<>*hdP"
"""Markers of methods; none is a cross, which marks a false claim."""
LINES = ("-", "--", "-.", ":")
GID = "method:"
"""Beginning of the id of everything drawn for a method; a page shows or hides it by this id."""
WIDTH = 7.4
"""Width of a figure [inch]: one and a half columns of a journal."""
ROW = 0.22
"""Height of a row of a legend [inch]."""


@dataclass(frozen=True)
class Look:
    """Colour, marker and line of a method."""

    name: str
    colour: str
    marker: str
    line: Any

    @property
    def drawn(self) -> dict[str, Any]:
        """Keywords for everything that is drawn for the method."""
        return {"color": self.colour, "gid": f"{GID}{self.name}"}


def method_looks(data: Dataset) -> dict[str, Look]:
    """The look of every method of a comparison, by name.

    Up to seven methods of a Program have different colours. Methods of a Program that share a
    colour differ in marker or line.
    """
    names = [str(name) for name in data[METHOD].values]
    lines = [LINES[(i + 2 * (i // len(CYCLE))) % len(LINES)] for i in range(len(names))]
    markers = islice(cycle(MARKERS), len(names))
    parts = zip(names, _colours(data), markers, lines, strict=True)
    return {name: Look(name, *each) for name, *each in parts}


def _colours(data: Dataset) -> list[str]:
    """A colour for every method: the one used least in its Programs, then least overall."""
    here = np.asarray(asked_cells(data).any(axis=tuple(range(2, data["outcome"].ndim))))
    # older comparisons do not store them: then all methods share one
    programs = np.zeros(len(here))
    if "program" in data.coords:
        programs = np.asarray(data["program"].values)
    of_program = np.array([here[programs == one].any(axis=0) for one in np.unique(programs)])
    found: list[int] = []
    for method in range(data.sizes[METHOD]):
        beside = of_program[of_program[:, method]].any(axis=0)[:method]
        near = Counter(found[other] for other in np.flatnonzero(beside))
        all_of = Counter(found)
        found.append(min(range(len(CYCLE)), key=lambda one: (near[one], all_of[one], one)))
    return [CYCLE[one] for one in found]


def legend(figure: Figure, handles: list[Any], width: float = WIDTH) -> None:
    """A legend below the axes, with as many columns as its longest label allows.

    The figure grows by the legend's height, so that the axes keep theirs.
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
    """A title that fits above a panel; a long one is shortened in the middle."""
    if len(title) <= most:
        return title
    half = (most - 3) // 2
    return f"{title[:half]}...{title[-half:]}"


def share_axis(panel: Axes) -> None:
    """Set a vertical axis for shares from 0 to 1."""
    panel.set_ylim(-0.03, 1.03)
    panel.set_yticks([0.0, 0.25, 0.5, 0.75, 1.0])
