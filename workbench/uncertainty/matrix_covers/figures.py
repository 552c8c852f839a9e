"""Figures of matrix covers: the entries' magnitudes with the cover, its size, and the Deltas."""

from __future__ import annotations

import numpy as np

from workbench import figures
from workbench.arrays import RealArray
from workbench.heavy_types import Figure
from workbench.uncertainty.matrix_covers.model import MatrixModel
from workbench.uncertainty.matrix_covers.responses import MatrixResponses, system_response

MOST_DRAWN = 60
"""Most plants that are drawn."""


def matrix_cover_figures(
    responses: MatrixResponses,
    model: MatrixModel,
    norms: RealArray,
    radii: RealArray,
    least: RealArray,
) -> dict[str, Figure]:
    """``magnitudes``, ``radius`` and ``deltas``."""
    return {
        "magnitudes": magnitudes_figure(responses, model),
        "radius": radius_figure(responses, radii, least),
        "deltas": deltas_figure(responses, norms),
    }


def magnitudes_figure(responses: MatrixResponses, model: MatrixModel) -> Figure:
    """Bode magnitudes, a panel for each output and input, with the band of the model's plants."""
    p, m = responses.values.shape[2:]
    figure, panels = figures.axes(p, m, size=(3.6 * m + 0.6, 2.5 * p + 1.0), sharex=True)
    frequency = responses.omega / (2 * np.pi)
    nominal = system_response(model.nominal, responses.omega)
    centre, radius = model.entry_discs(responses.omega)
    high = np.where(np.isfinite(radius), np.abs(centre) + radius, np.nan)
    low = np.where(np.isfinite(radius), np.maximum(np.abs(centre) - radius, 0.0), np.nan)
    for (i, j), panel in zip(np.ndindex(p, m), panels, strict=True):
        sizes = np.abs(responses.values[:, :, i, j])
        lines = np.where(sizes > 0, sizes, np.nan)
        bottom = np.nanmin(lines) / 10 if np.isfinite(lines).any() else 1e-300
        panel.fill_between(
            frequency, np.maximum(low[:, i, j], bottom), np.maximum(high[:, i, j], bottom),
            color=figures.SKY, alpha=0.3, linewidth=0, label="plants of the model",
        )  # fmt: skip
        for k, line in enumerate(lines.T[:MOST_DRAWN]):
            label = "plants" if k == 0 else None
            panel.plot(frequency, line, color="0.45", linewidth=0.5, label=label)
        drawn = np.where(np.abs(nominal[:, i, j]) > 0, np.abs(nominal[:, i, j]), np.nan)
        panel.plot(frequency, drawn, color=figures.BLUE, label="nominal")
        x = "frequency [Hz]" if i == p - 1 else ""
        figures.label(
            panel, x, "magnitude" if j == 0 else "", f"output {i + 1}, input {j + 1}", "xy"
        )
    figures.legend_below(figure, panels[0], 3)
    return figure


def radius_figure(responses: MatrixResponses, radii: RealArray, least: RealArray) -> Figure:
    """Mean radius of the model's sets, and the least that any weights could have."""
    figure, (panel,) = figures.axes()
    frequency = responses.omega / (2 * np.pi)
    panel.plot(frequency, radii, color=figures.BLUE, label="weights of the given orders")
    panel.plot(frequency, least, ":", color=figures.BLACK, label="least at each frequency")
    figures.label(panel, "frequency [Hz]", "geometric mean of the radius", log="xy")
    figures.legend_below(figure, panel)
    return figure


def deltas_figure(responses: MatrixResponses, norms: RealArray) -> Figure:
    """Norm of each plant's Delta; 1 is the boundary of the model."""
    figure, (panel,) = figures.axes()
    frequency = responses.omega / (2 * np.pi)
    for k, line in enumerate(norms.T[:MOST_DRAWN]):
        panel.plot(frequency, line, color="0.45", lw=0.6, label="plants" if k == 0 else None)
    panel.plot(frequency, norms.max(axis=1), color=figures.BLUE, label="largest")
    panel.axhline(1.0, color=figures.ORANGE, ls="--", label="boundary of the model")
    figures.label(panel, "frequency [Hz]", "norm of $\\Delta$", log="x")
    figures.legend_below(figure, panel)
    return figure
