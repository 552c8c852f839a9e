"""Figures of matrix covers: magnitudes of the entries, size of the sets, and norms of Delta."""

from __future__ import annotations

import numpy as np

from workbench import figures
from workbench._core.arrays import Array, RealArray
from workbench._core.heavy_types import Figure
from workbench.uncertainty.matrix_covers.responses import MatrixResponses

MOST_DRAWN = 60
"""Largest number of plants that are drawn. More lines cannot be told apart. Half or double changes
the figure only.
"""


def magnitudes_figure(
    omega: RealArray, nominal: Array, centre: Array, radius: RealArray, values: Array | None = None
) -> Figure:
    """Bode magnitudes, a panel for each output and input, with the band of a model's plants.

    ``nominal`` (F, p, m) is the nominal's response, ``centre`` and ``radius`` are those of the
    discs that the entries fill, ``values`` (F, N, p, m) the responses of plants. The band is cut
    one decade beyond the lines. It extends to this cut where the model's plants are unbounded.
    """
    p, m = nominal.shape[1:]
    figure, panels = figures.axes(p, m, size=(3.6 * m + 0.6, 2.5 * p + 1.0), sharex=True)
    frequency = omega / (2 * np.pi)
    high, low = np.abs(centre) + radius, np.abs(centre) - radius
    for (i, j), panel in zip(np.ndindex(p, m), panels, strict=True):
        lines = np.abs(nominal[:, i, j])[:, None]
        if values is not None:
            lines = np.column_stack([lines, np.abs(values[:, :MOST_DRAWN, i, j])])
        lines = np.where(lines > 0, lines, np.nan)
        known = np.isfinite(lines).any()
        bottom, top = (np.nanmin(lines) / 10, np.nanmax(lines) * 10) if known else (1e-300, 1.0)
        panel.fill_between(
            frequency,
            np.clip(low[:, i, j], bottom, top),
            np.clip(high[:, i, j], bottom, top),
            color=figures.SKY,
            alpha=0.3,
            linewidth=0,
            label="plants of the model",
        )
        for k, line in enumerate(lines.T[1:]):
            label = "plants" if k == 0 else None
            panel.plot(frequency, line, color="0.45", linewidth=0.5, label=label)
        panel.plot(frequency, lines[:, 0], color=figures.BLUE, label="nominal")
        x, y = "frequency [Hz]" if i == p - 1 else "", "magnitude" if j == 0 else ""
        figures.label(panel, x=x, y=y, title=f"output {i + 1}, input {j + 1}", log="xy")
    figures.legend_below(figure, panels[0], columns=3)
    return figure


def radius_figure(responses: MatrixResponses, radii: RealArray, least: RealArray) -> Figure:
    """Mean radius of the model's sets, and the least radius possible with any weights."""
    return _beside_least(responses, radii, least, "geometric mean of the radius")


def loop_mu_figure(responses: MatrixResponses, mu: RealArray, least: RealArray) -> Figure:
    """The loop's mu with the model, and the least mu possible with any weights."""
    return _beside_least(responses, mu, least, "$\\mu$ of the loop")


def _beside_least(
    responses: MatrixResponses, found: RealArray, least: RealArray, text: str
) -> Figure:
    figure, (panel,) = figures.axes(1, 1)
    frequency = responses.omega / (2 * np.pi)
    panel.plot(frequency, found, color=figures.BLUE, label="weights of the given orders")
    panel.plot(frequency, least, ":", color=figures.BLACK, label="least at each frequency")
    figures.label(panel, x="frequency [Hz]", y=text, log="xy")
    figures.legend_below(figure, panel)
    return figure


def deltas_figure(responses: MatrixResponses, norms: RealArray) -> Figure:
    """Norm of each plant's Delta; 1 is the boundary of the model."""
    figure, (panel,) = figures.axes(1, 1)
    frequency = responses.omega / (2 * np.pi)
    for k, line in enumerate(norms.T[:MOST_DRAWN]):
        panel.plot(frequency, line, color="0.45", lw=0.6, label="plants" if k == 0 else None)
    panel.plot(frequency, norms.max(axis=1), color=figures.BLUE, label="largest")
    panel.axhline(1.0, color=figures.ORANGE, ls="--", label="boundary of the model")
    figures.label(panel, x="frequency [Hz]", y="norm of $\\Delta$", log="x")
    figures.legend_below(figure, panel)
    return figure
