"""Figures of experiments: one period of a multisine."""

from __future__ import annotations

import numpy as np

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Figure


def period_figure(answer: RealArray, schroeder: RealArray) -> Figure:
    """One period of a multisine beside Schroeder's, both (N,) in units of the rms value."""
    figure, (panel,) = figures.axes(1, 1)
    time = np.arange(len(answer)) / len(answer)
    for signal, name, color in (
        (schroeder, "Schroeder", figures.SKY),
        (answer, "answer", figures.BLUE),
    ):
        panel.plot(time, signal, color=color, label=f"{name}: {np.abs(signal).max():.3f}")
    panel.set_xlabel("time [periods]")
    panel.set_ylabel("signal over its rms [1]")
    figures.legend_below(figure, panel)
    return figure
