"""The cells of a comparison as points that show their data when pointed at."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Axes, Dataset, Figure
from workbench.bench.comparison.layout import METHOD, NOT_COMPARED, UNFIT, seconds
from workbench.bench.comparison.styles import Look, keys, legend, method_looks
from workbench.bench.comparison.verdicts import CONTRADICTION, WRONG
from workbench.bench.report.toggles import Told
from workbench.errors import ResultError

LINEAR = 1e-12
"""Gaps below this are drawn on a linear scale: rounding errors, far below the finest accuracy
level.
"""
MOST_CELLS = 5000
"""Most cells that are drawn as points: with more, the page would respond slowly."""
TICKS = (-1.0, -1e-4, -1e-8, 0.0, 1e-8, 1e-4, 1.0)
FALSE = (WRONG, CONTRADICTION)
"""Verdicts on claims that another certificate refutes."""


@dataclass(frozen=True)
class CellPoint:
    """A cell as a point: certified, open or false; its wall time [s], its gap, and its text."""

    method: str
    kind: str
    seconds: float
    gap: float
    words: str


def every_cell(data: Dataset) -> tuple[Figure, list[Told]]:
    """Certified gap over wall time of every cell, with a text for each point.

    Filled points are certified, hollow ones are not, thin crosses are false claims. Cells without a
    finite gap form a row of their own below the others; cells without a time are left out.

    Raises
    ------
    ResultError
        There are more than `MOST_CELLS` cells, or none with a time.
    """
    cells = list(_cells(data))
    if len(cells) > MOST_CELLS:
        raise ResultError(f"{len(cells)} cells are too many points; {MOST_CELLS} are drawn at most")
    cells = [cell for cell in cells if 0 < cell.seconds < np.inf]
    if not cells:
        raise ResultError("no cell has a time")
    figure, (panel,) = figures.axes(1, 1, size=(7.4, 4.6))
    heights = scaled(np.array([cell.gap for cell in cells]))
    known = np.isfinite(heights)
    floor = float(heights[known].min(initial=0.0)) - 2.0
    heights[~known] = floor
    groups = defaultdict[tuple[str, str], list[int]](list)
    for place, cell in enumerate(cells):
        groups[cell.method, cell.kind].append(place)
    looks = method_looks(data)
    told: list[Told] = []
    for (method, kind), places in groups.items():
        x = [cells[place].seconds for place in places]
        _plot(panel, looks[method], kind, x, heights[places])
        told.append((looks[method].drawn["gid"], [cells[place].words for place in places]))
    figures.label(panel, x="statement and solve [s]", y="certified gap [relative]", log="x")
    top = float(heights.max(initial=1.0))
    ticks = {f"{tick:g}": float(scaled(np.array(tick))) for tick in TICKS}
    names = {name: height for name, height in ticks.items() if floor + 1.0 < height < top + 1.0}
    names |= {} if known.all() else {"no finite gap": floor}
    panel.set_yticks(list(names.values()), list(names))
    panel.set_ylim(floor - 0.7, top + 0.7)
    legend(figure, keys(looks, line=False))
    return figure, told


def scaled(gap: RealArray) -> RealArray:
    """Heights of gaps on a scale that is logarithmic for both signs and linear near zero."""
    return np.asarray(np.sign(gap) * np.log10(1.0 + np.abs(gap) / LINEAR))


def _plot(panel: Axes, look: Look, kind: str, x: Any, y: RealArray) -> None:
    panel.plot(
        x,
        y,
        "x" if kind == "false" else look.marker,
        markerfacecolor="none" if kind == "open" else look.colour,
        markersize=7 if kind == "false" else 5,
        **look.drawn,
    )


def _cells(data: Dataset) -> Iterator[CellPoint]:
    verdicts = data["verdict" if "verdict" in data else "outcome"]
    certified = data["certified" if "certified" in data else "success"].values
    spent = seconds(data).values
    repeated = verdicts.sizes.get("repetition", 1) > 1
    for place in np.ndindex(*verdicts.shape):
        verdict = str(verdicts.values[place])
        if verdict in ("", UNFIT, NOT_COMPARED):
            continue
        labels = [str(data[name].values[i]) for name, i in zip(verdicts.dims, place, strict=True)]
        names = dict(zip(verdicts.dims, labels, strict=True))
        gap, time = float(data["gap"].values[place]), float(spent[place])
        words = f"{names['problem']} by {names[METHOD]}, {names['accuracy']}"
        words += f", repetition {names['repetition']}" if repeated else ""
        words += f": {verdict}, "
        words += "no certified gap" if np.isnan(gap) else f"gap {gap:.2g}"
        words += f", {time:.3g} s"
        kind = "certified" if certified[place] else "open"
        yield CellPoint(names[METHOD], "false" if verdict in FALSE else kind, time, gap, words)
