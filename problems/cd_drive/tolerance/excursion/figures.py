"""Figures of `cd/{axis}/excursion`: eq. 8.1 compared with the loop, and maps of survival."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.types import Dataset, Figure

from ...drive.photo_diodes import CAPTURE
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis
from ..strategy_looks import titled


def against_theory(answer: Dataset, axis: Axis) -> Figure:
    """Excursion at the defect's end: over length at the worst angle, and over angle for the longest
    defect.
    """
    figure, panels = figures.axes(1, 2, size=(10.0, 4.4))
    reference = answer["end"]
    curves = (
        ("standing", "lens that stops, eq. 8.1", figures.BLACK, "--"),
        ("free", "free lens, voltage held", figures.GREEN, "-."),
        ("driven", "lens driven by the blind controller", figures.BLUE, "-"),
    )
    series = [(answer[name], label, colour, line, "") for name, label, colour, line in curves]
    series.append(
        (reference, "simulated without noise, reference strategy", figures.ORANGE, "", "o")
    )
    for array, label, colour, line, marker in series:
        look: Any = {"color": colour, "linestyle": line or "none", "marker": marker, "label": label}
        turn = str(array.dims[0])
        panels[0].plot(1e3 * array["length"], 1e6 * abs(array).max(turn), **look)
        panels[1].plot(np.degrees(array[turn]), 1e6 * array.isel(length=-1), **look)
    capture, spec = 1e6 * CAPTURE[axis], 1e6 * ACCEPTABLE_ERROR[axis]
    panels[0].set_ylim(bottom=spec / 20)
    panels[1].set_yscale("symlog", linthresh=spec, linscale=0.5)
    panels[1].axhline(-capture, color=figures.PURPLE, lw=1.0, ls=":")
    for panel in panels:
        panel.axhline(capture, color=figures.PURPLE, lw=1.0, ls=":", label="capture")
    end = r"at the defect's end [$\mu$m]"
    figures.label(
        panels[0],
        x="length of the defect [mm]",
        y=f"|true error| {end}",
        title="worst angle",
        log="y",
    )
    longest = f"{1e3 * float(answer['length'][-1]):.1f} mm"
    figures.label(panels[1], x="middle of the defect [deg]", y=f"true error {end}", title=longest)
    figures.legend_below(figure, panels[0], columns=3)
    return figure


def maps(answer: Dataset, axis: Axis) -> Figure:
    """Over angle and length: largest deviation survived, and largest error at the Red Book's
    deviation.
    """
    from matplotlib.colors import BoundaryNorm, LogNorm

    names = [str(name) for name in answer["strategy"].values]
    figure, panels = figures.axes(2, len(names), size=(13.0, 6.0), sharex=True, sharey=True)
    share = answer["share"].values
    edges = np.concatenate([[0.0], share, [share[-1] * 1.25]])
    survived = np.array([survived_share(answer.sel(strategy=name), axis) for name in names])
    size = 1e6 * answer["peak"].sel(share=1.0).median("draw").transpose("strategy", ...)
    spec = 1e6 * ACCEPTABLE_ERROR[axis]
    scale = LogNorm(spec / 5, 20 * spec)
    angle, length = np.degrees(answer["angle"].values), 1e3 * answer["length"].values
    rows = panels[: len(names)], panels[len(names) :]
    looks = (BoundaryNorm(edges, 256), "viridis"), (scale, "magma_r")
    meshes = []
    for row, values, (norm, colours) in zip(rows, (survived, size.values), looks, strict=True):
        for panel, one in zip(row, values, strict=True):
            shown: Any = {"norm": norm, "cmap": colours, "shading": "nearest"}
            mesh = panel.pcolormesh(angle, length, one.T, **shown)
            panel.grid(False)
        row[0].set_ylabel("length [mm]")
        meshes.append(mesh)
    for upper, lower, name in zip(*rows, names, strict=True):
        upper.set_title(titled(name))
        lower.set_xlabel("middle [deg]")
    middles = (edges[1:] + edges[:-1]) / 2
    words = "deviation survived\nin all draws [Red Book's]"
    bar = figure.colorbar(meshes[0], ax=rows[0], label=words, ticks=middles)
    bar.ax.tick_params(size=0)
    bar.ax.set_yticklabels(["none", *(f"{one:g}" for one in share)])
    figure.colorbar(
        meshes[1], ax=rows[1], label="largest error,\nmedian draw [$\\mu$m]", extend="both"
    )
    return figure


def survived_share(one: Dataset, axis: Axis) -> np.ndarray:
    """Largest share of the deviation up to which every draw survives (angle, length); 0: none."""
    kept = (one["peak"] <= CAPTURE[axis]).all("draw").transpose("angle", "length", "share").values
    count = np.cumprod(kept, axis=-1).sum(axis=-1)
    shares: np.ndarray = np.concatenate([[0.0], one["share"].values])[count]
    return shares
