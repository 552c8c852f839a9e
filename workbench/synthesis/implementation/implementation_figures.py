"""Figures, tables and stored parts of implemented controllers."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench._core.heavy_types import DataArray, Dataset, Figure, StateSpace
from workbench._core.tables import markdown_table
from workbench.certify.sampled_sets import Roots, mu_at
from workbench.synthesis.h_infinity.figures import grid
from workbench.synthesis.implementation.implemented import ImplementedController
from workbench.synthesis.implementation.sampled_loop import SampledMargins
from workbench.synthesis.implementation.second_order import Sections
from workbench.systems.generalised_plant import response

MARGINS = ("gain_low", "gain_high", "phase", "phase_at", "delay")
"""Names of the stored margins of a control signal."""


def figures_of(
    answer: ImplementedController,
    S: StateSpace,
    around: tuple[StateSpace, Roots, Roots | None] | None,
    given: StateSpace,
) -> dict[str, Figure]:
    """Sensitivity S of the sampled loop, mu over frequency for a set, and the controllers.

    ``around`` holds the weighted transfer functions around the deviations of a set.
    """
    omega = grid(S)
    values = np.linalg.norm(response(S, omega), 2, axis=(-2, -1))
    hertz = omega / (2 * np.pi)
    figure, (panel,) = figures.axes(1, 1)
    panel.plot(hertz, values, color=figures.BLUE, label="sensitivity $S$, sampled")
    panel.axhline(
        answer.sensitivity, color=figures.BLACK, ls="--", label="certified peak of the sensitivity"
    )
    if around is not None and answer.peak is not None:
        mu = mu_at(*around, omega)
        panel.plot(hertz, mu, color=figures.ORANGE, label=r"$\mu$ of the set of plants")
        panel.axhline(
            answer.peak.upper, color=figures.ORANGE, ls="--", label=r"certified peak of $\mu$"
        )
    figures.label(panel, x="frequency [Hz]", y="magnitude [1]", log="xy")
    figures.legend_below(figure, panel, columns=2)
    found = {"loop": figure}
    figure, (top,) = figures.axes(1, 1)
    size = np.linalg.norm(response(answer.K, omega), 2, axis=(-2, -1))
    top.plot(hertz, size, color=figures.BLUE, label=f"sampled, {answer.found}")
    if not given.dt:
        design = np.linalg.norm(response(given, omega), 2, axis=(-2, -1))
        top.plot(hertz, design, color=figures.BLACK, ls=":", label="given, continuous")
    figures.label(top, x="frequency [Hz]", y="largest singular value of $K$", log="xy")
    figures.legend_below(figure, top)
    return found | {"controller": figure}


def margins_table(answer: ImplementedController) -> str:
    """Margins of every control signal, in Markdown."""
    head = ["control", "gain from", "to", "phase [deg]", "delay [samples]"]
    rows = [
        [
            name,
            f"{row.gain[0]:.3g}",
            f"{row.gain[1]:.3g}",
            f"{row.phase_deg:.3g}",
            f"{row.delay_samples:.3g}",
        ]
        for name, row in zip(answer.K.output_labels, answer.margins, strict=True)
    ]
    return markdown_table(head, rows)


def stored_margins(margins: tuple[SampledMargins, ...]) -> dict[str, Any]:
    """Margins as a variable of a dataset."""
    rows = [[*row.gain, row.phase_deg, row.phase_at, row.delay_samples] for row in margins]
    said = f"margins of each control: {', '.join(MARGINS)} (1, 1, deg, rad/s, samples)"
    return {"margins": (("control", "margin"), np.array(rows, float), {"long_name": said})}


def read_margins(data: Dataset) -> tuple[SampledMargins, ...]:
    """The margins that `stored_margins` stored."""
    return tuple(
        SampledMargins((float(low), float(high)), float(phase), float(at), float(delay))
        for low, high, phase, at, delay in data["margins"].values
    )


def padded_sections(sections: Sections) -> Any:
    """Sections as a variable of a dataset; missing rows of a channel are NaN."""
    most = max(len(rows) for line in sections.channels for rows in line)
    found = np.full((sections.noutputs, sections.ninputs, most, 6), np.nan)
    for i, line in enumerate(sections.channels):
        for j, rows in enumerate(line):
            found[i, j, : len(rows)] = rows
    dims = ("control", "measurement", "section", "coefficient")
    return dims, found, {"long_name": "b0 b1 b2 1 a1 a2 of each section, rounded"}


def read_sections(stored: DataArray, period: float) -> Sections:
    """The sections that `padded_sections` stored."""
    values = stored.values
    channels = tuple(tuple(rows[~np.isnan(rows[:, 0])] for rows in line) for line in values)
    return Sections(channels, period)
