"""Bode diagrams of the plant in a loop and of its models."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.types import Dataset, Figure


def models_bode(answer: Dataset, title: str, limit: float) -> Figure:
    """Magnitude, phase and relative error of every model, with twice its standard deviation."""
    drawn, (magnitude, phase, error) = figures.axes(3, 1, size=(7.0, 8.5), sharex=True)
    frequency, truth = answer["frequency"].values, answer["truth"].values
    around = figures.phase(truth)
    magnitude.plot(frequency, abs(truth), color=figures.BLACK, label="true plant", linewidth=2.0)
    phase.plot(frequency, around, color=figures.BLACK, linewidth=2.0)
    for n, name in enumerate(answer["estimator"].values.tolist()):
        one = answer.sel(estimator=name)
        response, deviation = one["model"].values, one["deviation"].values
        look: Any = {"color": figures.CYCLE[n], "linewidth": 1.0}
        apart = abs(response / truth - 1)
        magnitude.plot(frequency, abs(response), label=name.replace("-", " "), **look)
        phase.plot(frequency, around + np.degrees(np.angle(response / truth)), **look)
        error.plot(frequency, 100 * apart, **look)
        if np.isfinite(deviation).all():
            error.plot(frequency, 100 * 2 * deviation / abs(truth), linestyle="--", **look)
    magnitude.plot([], [], color=figures.BLACK, linestyle="--", label="two standard deviations")
    error.axhline(100 * limit, color=figures.BLACK, linestyle=":", linewidth=0.8)
    figures.label(magnitude, y="error over input [1/V]", title=title, log="xy")
    figures.label(phase, y="phase [deg]")
    figures.label(error, x="frequency [Hz]", y="relative error [%]", log="xy")
    error.set_ylim(0.1, None)
    figures.legend_below(drawn, magnitude, columns=3)
    return drawn
