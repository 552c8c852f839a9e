"""Figures of mu synthesis: mixed mu over frequency, the controller, the rounds of an iteration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from workbench import figures
from workbench.mu import sweep
from workbench.synthesis.hinf.figures import controller as bode
from workbench.synthesis.hinf.figures import grid

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from workbench.synthesis.mu.program import MuController, MuSynthesis


def bounds(program: MuSynthesis, answer: MuController) -> Figure:
    """Bounds of mixed mu, and the upper bound with complex scalars in place of the real ones."""
    loop = program.plant.close(answer.K)
    omega = grid(loop)
    mixed = sweep(loop, program.closed, omega)
    complex_ = sweep(loop, program.closed.complexified(), omega)
    figure, (panel,) = figures.axes(size=(7.0, 4.0))
    panel.semilogx(omega, complex_.upper, ":", color=figures.ORANGE, label="all blocks complex")
    panel.semilogx(omega, mixed.upper, color=figures.BLUE, label="upper bound")
    panel.semilogx(omega, mixed.lower, "--", color=figures.SKY, label="lower bound")
    panel.axhline(answer.upper, color="0.4", linewidth=0.8, label="certified peak")
    panel.set_ylim(0.0, 1.1 * max(answer.upper, float(np.max(complex_.upper))))
    panel.set_xlabel("angular frequency [rad/s]")
    panel.set_ylabel("mu [1]")
    panel.set_title("robust performance")
    figures.legend_below(figure, panel)
    return figure


def controller(program: MuSynthesis, answer: MuController) -> Figure:
    """Singular values of the controller."""
    return bode(answer.K, program.plant.close(answer.K))


def rounds(answer: MuController) -> Figure:
    """Peaks and levels over the rounds, and the controllers' orders."""
    count = np.arange(1, len(answer.history) + 1)
    figure, (peaks, orders) = figures.axes(2, 1, size=(7.0, 5.0), sharex=True)
    peaks.plot(count, [each.peak for each in answer.history], "o-", label="peak of mixed mu")
    levels = [each.level for each in answer.history]
    if np.isfinite(levels).any():  # a structured controller has none
        peaks.plot(count, levels, "s:", label="H-infinity level")
    peaks.axhline(answer.upper, color="0.4", linewidth=0.8, label="certified, best")
    orders.bar(count, [each.order for each in answer.history], color=figures.SKY)
    peaks.set_ylabel("mu, gamma [1]")
    orders.set_ylabel("order of K")
    orders.set_xlabel("round")
    orders.locator_params(axis="x", integer=True)
    figures.legend_below(figure, peaks)
    return figure
