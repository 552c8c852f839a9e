"""Responses of one draw by every excitation, and the errors of all methods over frequency."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.types import Dataset, Figure

from .estimators import ESTIMATORS
from .excitations import EXCITATIONS, RESPONSES

MARKERS = "osD^v<"


def methods_bode(answer: Dataset, title: str) -> Figure:
    """Magnitude and phase without a model, with 99 % regions, at both sizes of noise."""
    drawn, panels = figures.axes(2, 2, size=(9.0, 6.0), sharex=True, sharey="row")
    frequency, truth = answer["frequency"].values, answer["truth"].values
    span = float(np.diff(frequency)[0])
    shown = [name for name in RESPONSES if name != "spectra_1s"]
    for column, noise in enumerate(answer["noise"].values.tolist()):
        magnitude, phase = panels[column::2]
        magnitude.plot(frequency, abs(truth), color=figures.BLACK, label="noise-free")
        phase.plot(frequency, np.degrees(np.angle(truth)), color=figures.BLACK)
        for n, name in enumerate(shown):
            one = answer.sel(noise=noise, response=name)
            response, radius = one["first"].values, one["first_radius"].values
            look: Any = {
                "color": figures.CYCLE[n], "marker": MARKERS[n], "markersize": 3,
                "linestyle": "none", "elinewidth": 0.7, "capsize": 1.5,
            }  # fmt: skip
            at = frequency + (n - len(shown) / 2) * span / 8
            lead = np.degrees(np.arcsin(np.minimum(radius / abs(response), 1.0)))
            magnitude.errorbar(at, abs(response), radius, label=name.replace("_", " "), **look)
            phase.errorbar(at, np.degrees(np.angle(response)), lead, **look)
        figures.label(magnitude, title=f"{title}, {noise}")
        figures.label(phase, x="frequency [Hz]")
    figures.label(panels[0], y="$|v_r/u|$ [V/V]")
    figures.label(panels[2], y="phase [deg]")
    figures.legend_below(drawn, panels[0])
    return drawn


def error_curves(answer: Dataset, title: str) -> Figure:
    """Rms error over the draws at each frequency: without a model, and of models by estimator."""
    noises = answer["noise"].values.tolist()
    drawn, panels = figures.axes(len(noises), 4, size=(12.0, 6.0), sharex=True, sharey=True)
    frequency = answer["frequency"].values
    for row, noise in enumerate(noises):
        plain, *models = panels[4 * row : 4 * row + 4]
        for n, name in enumerate(RESPONSES):
            error = answer["error"].sel(noise=noise, response=name).astype(float)
            size = 100 * np.sqrt((error**2).mean("draw"))
            words = f"by {name.replace('_', ' ')}"
            plain.plot(frequency, size, color=figures.CYCLE[n], linestyle="--", label=words)
        for panel, excitation in zip(models, EXCITATIONS, strict=True):
            for n, estimator in enumerate(ESTIMATORS):
                at = {"noise": noise, "excitation": excitation, "estimator": estimator}
                size = 100 * np.sqrt((answer["fit_error"].sel(at).astype(float) ** 2).mean("draw"))
                style = ":" if estimator == "prediction_errors" else "-"
                words = estimator.replace("_", " ")
                panel.plot(frequency, size, style, color=figures.CYCLE[n], label=words)
            figures.label(panel, title=f"models, {excitation}, {noise}")
        figures.label(plain, y="relative error [%]", title=f"no model, {noise}", log="y")
    for panel in panels[-4:]:
        figures.label(panel, x="frequency [Hz]")
    handles, labels = panels[0].get_legend_handles_labels()
    more, names = panels[1].get_legend_handles_labels()
    drawn.legend(handles + more, labels + names, loc="outside lower center", ncols=5, frameon=False)
    drawn.suptitle(title, fontsize=10)
    return drawn
