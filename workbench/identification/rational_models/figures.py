"""Figures of rational models: response with its band over the data, and residuals."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench._core.arrays import ComplexArray
from workbench._core.heavy_types import Figure
from workbench.identification.rational_models.model import CommonPoleModel
from workbench.identification.rational_models.uncertainty import ModelUncertainty
from workbench.identification.rational_models.weighted import WeightedResponse

DRAWN_FREQUENCIES = 1000
"""Number of frequencies at which the model is drawn, in addition to those of the data."""
LEAST_BAND = 1e-2
"""Lower end, as a fraction of the magnitude, of a band that would reach 0, so that its end is
visible.
"""


def rational_model_figure(
    data: WeightedResponse,
    model: CommonPoleModel,
    uncertainty: ModelUncertainty,
    confidence: float = 0.95,
) -> Figure:
    """Magnitude and phase of every entry: data, model, and the band of the model."""
    between = np.geomspace(data.omega[0], data.omega[-1], DRAWN_FREQUENCIES)[1:-1]
    omega = np.union1d(between, data.omega)
    fit = model.response(omega)
    sizes, angles = (
        uncertainty.magnitude_band(omega, confidence=confidence),
        uncertainty.phase_band(omega, confidence=confidence),
    )
    p, m = model.shape
    figure, panels = figures.axes(2 * p, m, size=(7.0 if m == 1 else 4.5 * m, 5.0 * p), sharex=True)
    for i, j in np.ndindex(p, m):
        top, bottom = panels[2 * i * m + j], panels[(2 * i + 1) * m + j]
        value, band = np.abs(fit[:, i, j]), sizes[:, i, j]
        dots: Any = {"marker": ".", "linestyle": "none", "color": figures.BLUE, "markersize": 4}
        top.plot(data.omega, np.abs(data.response[:, i, j]), label="data", **dots)
        top.plot(omega, value, color=figures.ORANGE, label="model")
        low = np.maximum(value - band, LEAST_BAND * value)
        look: Any = {"color": figures.ORANGE, "alpha": 0.25, "linewidth": 0}
        top.fill_between(omega, low, value + band, label=f"{100 * confidence:g} % band", **look)
        deviation = data.deviation[:, i, j]
        top.plot(data.omega, deviation, color=figures.GREEN, linewidth=0.8, label="deviation")
        top.set_yscale("log")
        top.set_ylabel(f"magnitude {i + 1}, {j + 1} [1]")
        turned = np.unwrap(np.angle(data.response[:, i, j]))
        along = np.unwrap(np.angle(fit[:, i, j]))
        along += 2 * np.pi * np.round((turned[0] - along[0]) / (2 * np.pi))
        bottom.plot(data.omega, np.degrees(turned), **dots)
        bottom.plot(omega, np.degrees(along), color=figures.ORANGE)
        turn = np.minimum(angles[:, i, j], np.pi)
        bottom.fill_between(omega, np.degrees(along - turn), np.degrees(along + turn), **look)
        bottom.set_ylabel("phase [deg]")
        for panel in (top, bottom):
            panel.set_xscale("log")
    for panel in panels[-m:]:
        panel.set_xlabel("angular frequency [rad/s]")
    figures.legend_below(figure, panels[0])
    return figure


def rational_residual_figure(data: WeightedResponse, residual: ComplexArray) -> Figure:
    """Magnitudes of the residuals of every entry, in standard deviations."""
    figure, (panel,) = figures.axes(1, 1)
    for i, j in np.ndindex(data.shape):
        size = np.abs(residual[:, i, j]) / np.sqrt(2)
        panel.plot(data.omega, size, ".", markersize=4, label=f"output {i + 1}, input {j + 1}")
    level = float(np.sqrt(-np.log(0.05)))
    panel.axhline(level, color=figures.BLACK, linewidth=0.8, label="95 % of right ones are below")
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xlabel("angular frequency [rad/s]")
    panel.set_ylabel("residual over its standard deviation")
    figures.legend_below(figure, panel)
    return figure
