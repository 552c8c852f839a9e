"""Figures and tables of `cd/{axis}/excursion`: eq. 8.1 against the loop, maps of survival."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from workbench import figures
from workbench.heavy_types import Dataset, Figure

from ...drive.photo_diodes import CAPTURE
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis
from ..strategy_looks import titled


def figures_of(answer: Dataset, axis: Axis) -> dict[str, Figure]:
    """Both figures, by file stem."""
    return {"equation-8-1": against_theory(answer, axis), "survival": maps(answer, axis)}


def against_theory(answer: Dataset, axis: Axis) -> Figure:
    """Excursion at the defect's end over length, worst angle; and over angle, longest defect."""
    figure, panels = figures.axes(1, 2, size=(10.0, 4.4))
    reference = answer["end"].sel(strategy="reference", share=1.0)
    curves = (
        ("standing", "lens that stops, eq. 8.1", figures.BLACK, "--"),
        ("free", "free lens, voltage held", figures.GREEN, "-."),
        ("driven", "lens driven by the blind controller", figures.BLUE, "-"),
    )
    series = [(answer[name], label, colour, line, "") for name, label, colour, line in curves]
    series.append((reference, "simulated, reference strategy", figures.ORANGE, "", "o"))
    for array, label, colour, line, marker in series:
        look: Any = {"color": colour, "linestyle": line or "none", "marker": marker, "label": label}
        turn = str(array.dims[0])
        panels[0].plot(1e3 * array["length"], 1e6 * abs(array).max(turn), **look)
        panels[1].plot(np.degrees(array[turn]), 1e6 * array.isel(length=-1), **look)
    panels[0].set_xlabel("length of the defect [mm]")
    panels[0].set_title("worst angle")
    panels[1].set_xlabel("middle of the defect [deg of the deviation]")
    panels[1].set_title(f"{1e3 * float(answer['length'][-1]):.1f} mm")
    capture, spec = 1e6 * CAPTURE[axis], 1e6 * ACCEPTABLE_ERROR[axis]
    panels[0].set_yscale("log")
    panels[0].set_ylim(bottom=spec / 20)
    panels[1].set_yscale("symlog", linthresh=spec, linscale=0.5)
    panels[1].axhline(-capture, color=figures.PURPLE, lw=1.0, ls=":")
    for panel in panels:
        panel.axhline(capture, color=figures.PURPLE, lw=1.0, ls=":", label="capture")
    panels[0].set_ylabel("|true error| at the defect's end [um]")
    panels[1].set_ylabel("true error at the defect's end [um]")
    figures.legend_below(figure, panels[0], 3)
    return figure


def maps(answer: Dataset, axis: Axis) -> Figure:
    """Over angle and length: largest deviation survived; largest error at the Red Book's."""
    from matplotlib.colors import BoundaryNorm, LogNorm

    names = [str(name) for name in answer["strategy"].values]
    figure, panels = figures.axes(2, len(names), size=(13.0, 6.0), sharex=True, sharey=True)
    share = answer["share"].values
    edges = np.concatenate([[0.0], share, [share[-1] * 1.25]])
    survived = np.array([survived_share(answer.sel(strategy=name), axis) for name in names])
    size = 1e6 * answer["peak"].sel(share=1.0)
    spec = 1e6 * ACCEPTABLE_ERROR[axis]
    scale = LogNorm(spec / 5, 20 * spec)
    angle, length = np.degrees(answer["angle"].values), 1e3 * answer["length"].values
    above = below = None
    for n, name in enumerate(names):
        upper, lower = panels[n], panels[len(names) + n]
        above = upper.pcolormesh(
            angle,
            length,
            survived[n].T,
            norm=BoundaryNorm(edges, 256),
            cmap="viridis",
            shading="nearest",
        )
        below = lower.pcolormesh(
            angle,
            length,
            size.sel(strategy=name).values.T,
            norm=scale,
            cmap="magma_r",
            shading="nearest",
        )
        upper.set_title(titled(name))
        lower.set_xlabel("middle [deg]")
        for panel in (upper, lower):
            panel.grid(False)
    for panel in panels[:: len(names)]:
        panel.set_ylabel("length [mm]")
    assert above is not None and below is not None
    bar = figure.colorbar(
        above,
        ax=panels[: len(names)],
        label="deviation survived [Red Book's]",
        ticks=(edges[1:] + edges[:-1]) / 2,
    )
    bar.ax.tick_params(size=0)
    bar.ax.set_yticklabels(["none", *(f"{one:g}" for one in share)])
    figure.colorbar(
        below,
        ax=panels[len(names) :],
        label="largest error [um]",
        extend="both",
    )
    return figure


def survived_share(one: Dataset, axis: Axis) -> np.ndarray:
    """Largest share up to which every smaller one is survived too (angle, length); 0: none."""
    kept = (one["peak"] <= CAPTURE[axis]).transpose("angle", "length", "share").values
    count = np.cumprod(kept, axis=-1).sum(axis=-1)
    shares: np.ndarray = np.concatenate([[0.0], one["share"].values])[count]
    return shares


def tables_of(answer: Dataset, numbers: Mapping[str, float]) -> dict[str, str]:
    """What each strategy survives, and the three answers for the reference strategy."""
    rows = [
        "| strategy | kept, all | kept, Red Book | in spec, Red Book | worst [um] | "
        "shortest defect lost [mm] |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name in answer["strategy"].values:
        lost = numbers[f"first_lost_{name}_mm"]
        rows.append(
            f"| {titled(str(name))} | {numbers[f'survived_{name}']:.1%} "
            f"| {numbers[f'survived_red_book_{name}']:.1%} "
            f"| {numbers[f'in_spec_red_book_{name}']:.1%} "
            f"| {numbers[f'worst_red_book_{name}_um']:.2f} "
            f"| {'none' if np.isnan(lost) else f'{lost:.2f}'} |"
        )
    theory = [
        "| lens during the longest defect, worst angle | error [um] |",
        "| --- | --- |",
        *(
            f"| {label} | {numbers[f'{key}_um']:.2f} |"
            for key, label in (
                ("standing", "stops (eq. 8.1)"),
                ("free", "free, voltage held"),
                ("driven", "driven by the blind controller"),
            )
        ),
        f"| eq. 8.1 at 500 um, 9 Hz, 1.9 ms | {numbers['thesis_um']:.2f} |",
    ]
    return {"survival": "\n".join(rows), "theory": "\n".join(theory)}
