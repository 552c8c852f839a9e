"""Figures of the identification: measured responses with their regions, fitted and true ones."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.types import ComplexArray, Dataset, Figure


def open_loop_bode(answer: Dataset, title: str) -> Figure:
    """v_r/u of one draw: every period, the mean with its interval, and the response
    without noise.
    """
    drawn, panels = figures.axes(2, 2, size=(9.0, 6.0), sharex=True)
    frequency, response = answer["frequency"].values, answer["response"].values
    radius, exact = answer["radius"].values, answer["exact"].values

    def plot(column: int, values: ComplexArray, *style: str, **look: Any) -> None:
        parts = (abs(values), np.degrees(np.angle(values)))
        for panel, one in zip(panels[column::2], parts, strict=True):
            panel.plot(frequency, one, *style, **look)

    # Rasterised, since there are thousands of points.
    dots: Any = {"linestyle": "none", "marker": ".", "markersize": 1.5, "rasterized": True}
    plot(0, answer["periods"].values, color=figures.BLUE, **dots)
    plot(1, exact, "--", color=figures.BLACK, label="noise-free")
    angle, lead = np.degrees(np.angle(response)), np.degrees(radius / abs(response))
    bands = ((abs(response), radius), (angle, lead))
    for panel, (middle, half) in zip(panels[1::2], bands, strict=True):
        panel.fill_between(
            frequency, middle - half, middle + half, label="99 % interval",
            color=figures.ORANGE, alpha=0.5, linewidth=0,
        )  # fmt: skip
    plot(1, response, color=figures.BLUE, linewidth=1.0, label="measured")
    for column, shown in enumerate((title, "mean of ten periods, 99 % interval")):
        figures.label(panels[column], title=shown)
        figures.label(panels[2 + column], x="frequency [Hz]")
    figures.label(panels[0], y="$|v_r/u|$ [V/V]")
    figures.label(panels[2], y="phase [deg]")
    figures.legend_below(drawn, panels[1])
    return drawn


def closed_loop_bode(answer: Dataset, title: str) -> Figure:
    """Magnitude, phase and error of one draw: measured with the 99 % region, fitted, and without
    noise.
    """
    drawn, (magnitude, phase, error) = figures.axes(3, 1, size=(7.0, 8.0), sharex=True)
    frequency, measured = answer["frequency"].values, answer["response"].values
    fitted, true, radius = (answer[name].values for name in ("fitted", "exact", "radius"))
    size = abs(measured)
    share = np.minimum(radius / size, 1.0)
    lead = np.degrees(np.arcsin(share))
    dots: Any = {"marker": ".", "markersize": 2.5, "linestyle": "none", "color": figures.BLUE}
    region: Any = {"color": figures.SKY, "alpha": 0.4, "linewidth": 0.0}
    # The measured phase is unwrapped around the fitted one, so that noise cannot make it jump.
    around = figures.phase(fitted)
    measured_phase = around + np.degrees(np.angle(measured / fitted))

    low, high = size * (1 - 0.999 * share), size * (1 + share)
    magnitude.fill_between(frequency, low, high, label="99 % region", **region)
    magnitude.plot(frequency, size, label="measured", **dots)
    phase.fill_between(frequency, measured_phase - lead, measured_phase + lead, **region)
    phase.plot(frequency, measured_phase, **dots)
    lines = (("noise-free", true, figures.BLACK, "--"), ("fitted", fitted, figures.ORANGE, "-"))
    for name, response, color, style in lines:
        own = around + np.degrees(np.angle(response / fitted))
        magnitude.plot(frequency, abs(response), style, color=color, label=name)
        phase.plot(frequency, own, style, color=color)
        error.plot(frequency, abs(response - measured) / radius, ".", markersize=2.5, color=color)
    error.axhline(1.0, color=figures.BLACK, linewidth=0.8)
    magnitude.set_ylim(0.5 * abs(true).min(), 2.0 * abs(true).max())
    around_true = around + np.degrees(np.angle(true / fitted))
    phase.set_ylim(around_true.min() - 40.0, around_true.max() + 40.0)
    figures.label(magnitude, y="x / coil voltage [m/V]", title=title, log="y")
    figures.label(phase, y="phase [deg]")
    figures.label(error, x="frequency [Hz]", y="distance / radius [1]", log="x")
    ticks = [100, 200, 500, 1000, 2000]
    error.set_xticks(ticks, [str(tick) for tick in ticks])
    error.minorticks_off()
    error.set_ylim(0.0, None)
    figures.legend_below(drawn, magnitude)
    return drawn
