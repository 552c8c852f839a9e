"""Figures of parameter fits: each response and record with its model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from workbench import figures
from workbench._core.heavy_types import Figure
from workbench.identification.parameters.measured import Measured, MeasuredRecord, MeasuredResponse


def fit_figures(data: Sequence[Measured], values: Mapping[str, float]) -> dict[str, Figure]:
    """One figure for each response and each record, by name."""
    drawn = {}
    for datum in data:
        stem = "-".join(datum.name.lower().split())
        if isinstance(datum, MeasuredResponse):
            drawn[stem] = response_figure(datum, values)
        elif isinstance(datum, MeasuredRecord):
            drawn[stem] = record_figure(datum, values)
    return drawn


def response_figure(datum: MeasuredResponse, values: Mapping[str, float]) -> Figure:
    """Magnitude, phase and weighted error of every entry over frequency."""
    figure, panels = figures.axes(3, 1, size=(7.0, 7.0), sharex=True)
    count = len(datum.frequency_hz)
    measured = datum.response.reshape(count, -1)
    model = datum.predicted(values).reshape(count, -1)
    for entry in range(measured.shape[1]):
        color = figures.CYCLE[entry % len(figures.CYCLE)]
        name = "" if measured.shape[1] == 1 else f", entry {entry}"
        dots: dict[str, Any] = {"marker": ".", "linestyle": "none", "color": color, "alpha": 0.5}
        for panel, part in ((panels[0], np.abs), (panels[1], _degrees)):
            panel.plot(
                datum.frequency_hz, part(measured[:, entry]), label=f"measured{name}", **dots
            )
            panel.plot(
                datum.frequency_hz, part(model[:, entry]), color=figures.BLACK, label=f"model{name}"
            )
        error = np.abs(model - measured)[:, entry] * datum.weights[:, entry]
        panels[2].plot(datum.frequency_hz, error, **dots)
    panels[0].set_yscale("log")
    panels[0].set_ylabel("magnitude [1]")
    panels[1].set_ylabel("phase [deg]")
    panels[2].set_ylabel("|error| / std" if datum.weighted else "|error| [1]")
    panels[2].set_xlabel("frequency [Hz]")
    for panel in panels:
        panel.set_xscale("log")
    panels[0].set_title(datum.name)
    figures.legend_below(figure, panels[0])
    return figure


def record_figure(datum: MeasuredRecord, values: Mapping[str, float]) -> Figure:
    """Measured and simulated outputs over the samples, one panel each."""
    figure, panels = figures.axes(len(datum.y), 1, size=(7.0, 2.0 + 2.0 * len(datum.y)))
    for index, (panel, measured, model) in enumerate(
        zip(panels, datum.y, datum.predicted(values), strict=True)
    ):
        panel.plot(measured, color=figures.BLUE, alpha=0.6, label="measured")
        panel.plot(model, color=figures.BLACK, label="model")
        panel.set_ylabel(f"output {index} [1]")
    panels[-1].set_xlabel("sample")
    panels[0].set_title(datum.name)
    figures.legend_below(figure, panels[0])
    return figure


def _degrees(values: np.ndarray) -> np.ndarray:
    """Phase [deg] of complex values."""
    return np.degrees(np.angle(values))
