"""Figures of covers: shapes around their points in the plane, sizes along the first axis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from workbench import figures
from workbench._core.heavy_types import DataArray, Figure
from workbench.geometry.shapes import Shape

POINTS_OF_ROUND_END = 48
"""Number of points of the polygon that draws a round end."""
FILLED_BELOW = 60
"""Figures with fewer shapes than this fill the shapes and draw their points large."""


def shape_figures(
    points: DataArray, answer: Shape, windows: Mapping[str, tuple[float, float]]
) -> dict[str, Figure]:
    """Figures of all shapes, of the shapes in each window, and of the sizes over the first axis.

    Unless there is a single leading axis with numbers, there is only the figure of all shapes.

    Parameters
    ----------
    points
        Complex, dims (axis, ..., point).
    windows
        Ranges of the first axis's coordinate, by caption.
    """
    first = points.coords.get(points.dims[0])
    if points.ndim != 2 or first is None or first.dtype.kind not in "iuf":
        return {"plane": plane(points, answer, "all sets")}
    axis = first
    drawn = {"plane": plane(points, answer, "whole")}
    for caption, (low, high) in windows.items():
        chosen = np.flatnonzero((axis.values >= low) & (axis.values <= high))
        name = "plane-" + "-".join(caption.lower().split())
        drawn[name] = plane(points, answer, caption, chosen)
    drawn["sizes"] = sizes(axis, answer, points.attrs.get("units", "1"))
    return drawn


def plane(points: DataArray, answer: Shape, title: str, chosen: np.ndarray | None = None) -> Figure:
    """Points and shapes in the complex plane, coloured by the coordinate of the first axis.

    ``chosen`` holds the indices of the sets to draw; by default all are drawn.
    """
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.colors import LogNorm, Normalize

    values = points.values.reshape(-1, points.shape[-1])
    outlines = outline(answer)
    chosen = np.arange(len(values)) if chosen is None else chosen
    figure, (axes,) = figures.axes(1, 1, size=(7.0, 5.6))
    axis = points.coords.get(points.dims[0]) if points.ndim == 2 else None
    if axis is not None and axis.dtype.kind not in "iuf":
        axis = None
    along = np.arange(len(values)) if axis is None else axis.values.astype(float)
    logarithmic = axis is not None and _is_logarithmic(axis)
    shown = along[chosen] if len(chosen) else along
    norm = (LogNorm if logarithmic else Normalize)(shown.min(), shown.max())
    corners = [np.column_stack([outlines[i].real, outlines[i].imag]) for i in chosen]
    coloured: Any = {"array": along[chosen], "norm": norm, "cmap": "viridis"}
    shapes = LineCollection(corners, linewidths=0.8, **coloured)
    axes.add_collection(shapes)
    if len(chosen) < FILLED_BELOW:
        axes.add_collection(PolyCollection(corners, linewidths=0, alpha=0.06, **coloured))
    if axis is not None and len(chosen) == len(values):  # the path of each point through the sets
        axes.plot(values.real, values.imag, color="0.6", linewidth=0.5, zorder=1)
    axes.scatter(
        values[chosen].real.ravel(),
        values[chosen].imag.ravel(),
        s=9 if len(chosen) < FILLED_BELOW else 2,
        c=np.repeat(along[chosen], values.shape[1]),
        norm=norm,
        cmap="viridis",
        linewidths=0,
        rasterized=True,
        zorder=3,
    )
    axes.autoscale()
    axes.set_aspect("equal", adjustable="datalim")
    quantity = points.attrs.get("long_name", "points")
    unit = points.attrs.get("units", "1")
    axes.set_xlabel(f"real part of {quantity} [{unit}]")
    axes.set_ylabel(f"imaginary part [{unit}]")
    axes.set_title(title)
    if axis is not None:
        bar = figure.colorbar(shapes, ax=axes, label=_label(axis))
        _plain_ticks(bar.ax.yaxis, float(norm.vmin or 0), float(norm.vmax or 0))
    return figure


def sizes(axis: DataArray, answer: Shape, unit: str) -> Figure:
    """Radius over the axis; for stadiums half-length and orientation too."""
    stadium = bool(np.any(np.nan_to_num(answer.half_length) > 0))
    figure, panels = figures.axes(
        2 if stadium else 1, 1, size=(7.0, 6.0 if stadium else 4.2), sharex=True
    )
    top = panels[0]
    top.plot(axis, answer.radius, color=figures.BLUE, label="radius")
    if stadium:
        straight = np.where(np.asarray(answer.half_length) > 0, answer.half_length, np.nan)
        top.plot(axis, straight, color=figures.ORANGE, label="half-length")
    positive = np.asarray(answer.radius)[np.asarray(answer.radius) > 0]
    figures.label(top, y=f"size [{unit}]", log="y" if positive.size else "")
    figures.legend_below(figure, top)
    if stadium:
        panels[1].plot(
            axis, np.degrees(answer.angle), ".", color=figures.GREEN, markersize=3, label="angle"
        )
        panels[1].set_ylabel("orientation [deg]")
        panels[1].set_ylim(-6, 186)
        panels[1].set_yticks([0, 45, 90, 135, 180])
    figures.label(panels[-1], x=_label(axis), log="x" if _is_logarithmic(axis) else "")
    return figure


def outline(answer: Shape) -> np.ndarray:
    """Closed outlines of circles or stadiums, complex; one row of points for each set.

    Examples
    --------
    >>> from workbench.geometry import outline, smallest_circle
    >>> line = outline(smallest_circle([[1.0 + 0j, 3.0]]))[0]
    >>> bool((abs(abs(line - 2.0) - 1.0) < 1e-9).all()), bool(line[0] == line[-1])
    (True, True)
    """
    half = np.linspace(-np.pi / 2, np.pi / 2, POINTS_OF_ROUND_END)
    center, radius = np.ravel(answer.center)[:, None], np.ravel(answer.radius)[:, None]
    length, angle = np.ravel(answer.half_length)[:, None], np.ravel(answer.angle)[:, None]
    ahead = length + radius * np.exp(1j * half)
    corners = np.concatenate([ahead, -ahead, ahead[:, :1]], axis=1)
    return center + corners * np.exp(1j * angle)


def _is_logarithmic(axis: DataArray) -> bool:
    """Whether an axis is positive and spans a factor of 20 or more."""
    values = axis.values
    return bool(np.all(values > 0) and values.max() >= 20 * values.min())


def _label(axis: DataArray) -> str:
    """Name and unit of an axis."""
    return f"{axis.attrs.get('long_name', axis.name)} [{axis.attrs.get('units', '1')}]"


def _plain_ticks(scale: object, low: float, high: float) -> None:
    """Label a logarithmic scale that spans less than a decade with plain numbers."""
    from matplotlib.ticker import MaxNLocator, NullFormatter, ScalarFormatter

    if not 0 < high < 10 * low:
        return
    scale.set_major_locator(MaxNLocator(6))  # type: ignore[attr-defined]
    scale.set_major_formatter(ScalarFormatter())  # type: ignore[attr-defined]
    scale.set_minor_formatter(NullFormatter())  # type: ignore[attr-defined]
