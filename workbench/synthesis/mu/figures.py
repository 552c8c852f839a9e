"""Figures of mu synthesis: mixed mu over frequency, and the rounds of the iteration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench import figures
from workbench._core.heavy_types import Figure, StateSpace
from workbench.mu import frequency_sweep
from workbench.structure import Structure
from workbench.synthesis.h_infinity.figures import grid
from workbench.synthesis.mu.rounds import Iterate

LOG_SCALE_RATIO = 10.0
"""Rounds get a logarithmic axis if the ratio of the largest to the best peak exceeds this."""


def bounds_figure(loop: StateSpace, structure: Structure, peak: float) -> Figure:
    """Figure of the bounds on mixed mu of a closed loop, and of those with real scalars made
    complex.

    `peak` is the certified upper bound over all frequencies.
    """
    omega = grid(loop)
    hertz = omega / (2 * np.pi)
    mixed = frequency_sweep(loop, structure, omega=omega)
    figure, (panel,) = figures.axes(1, 1, size=(7.0, 4.0))
    top = max(peak, float(np.max(mixed.upper)))
    if structure.complexified() != structure:  # otherwise both curves coincide
        complex_ = frequency_sweep(loop, structure.complexified(), omega=omega).upper
        panel.semilogx(hertz, complex_, ":", color=figures.ORANGE, label="all blocks complex")
        top = max(top, float(np.max(complex_)))
    panel.semilogx(hertz, mixed.upper, color=figures.BLUE, label="upper bound")
    panel.semilogx(hertz, mixed.lower, "--", color=figures.SKY, label="lower bound")
    panel.axhline(peak, color="0.4", linewidth=0.8, label="certified peak")
    panel.set_ylim(0.0, 1.1 * top)
    figures.label(panel, x="frequency [Hz]", y=r"$\mu$ [1]", title="robust performance")
    figures.legend_below(figure, panel)
    return figure


def rounds_figure(history: Sequence[Iterate], peak: float) -> Figure:
    """Figure of the peaks, the levels and the orders of the controllers over the rounds.

    `peak` is the certified upper bound of the best controller.
    """
    count = np.arange(1, len(history) + 1)
    figure, (peaks, orders) = figures.axes(2, 1, size=(7.0, 5.0), sharex=True)
    levels = [each.level for each in history]
    if np.isfinite(levels).any():  # a controller of fixed structure has no level
        # Hollow markers drawn below those of the peaks, since the values are often equal.
        peaks.plot(
            count, levels, "s:", color=figures.ORANGE, markerfacecolor="none", markersize=8,
            label="H-infinity level",
        )  # fmt: skip
    peaks.plot(
        count, [each.peak for each in history], "o-",
        color=figures.BLUE, markersize=4, label="peak of mixed mu",
    )  # fmt: skip
    peaks.axhline(peak, color="0.4", linewidth=0.8, label="certified, best")
    worst = max((each.peak for each in history), default=peak)
    orders.bar(count, [each.order for each in history], color=figures.SKY)
    log = "y" if worst > LOG_SCALE_RATIO * peak else ""
    figures.label(peaks, y=r"$\mu$, $\gamma$ [1]", log=log)
    figures.label(orders, x="round", y="order of $K$")
    orders.locator_params(integer=True)
    figures.legend_below(figure, peaks)
    return figure
