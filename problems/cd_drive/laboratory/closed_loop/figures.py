"""Figure 4.5: a response measured in closed loop, and the model fitted to it."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.heavy_types import Dataset, Figure


def bode(answer: Dataset, title: str) -> Figure:
    """Magnitude, phase and error: measured with the 99 % region, fitted, true."""
    figure, (magnitude, phase, error) = figures.axes(3, 1, size=(7.0, 8.0), sharex=True)
    frequency, measured = answer["frequency"].values, answer["response"].values
    fitted, true, radius = (answer[name].values for name in ("fitted", "true", "radius"))
    size = abs(measured)
    share = np.minimum(radius / size, 1.0)
    lead = np.degrees(np.arcsin(share))
    dots: dict[str, Any] = {
        "marker": ".",
        "markersize": 2.5,
        "linestyle": "none",
        "color": figures.BLUE,
    }
    region: dict[str, Any] = {"color": figures.SKY, "alpha": 0.4, "linewidth": 0.0}
    # The measured phase is unwrapped about the fitted one: noise then cannot make it jump.
    around = figures.phase(fitted)
    measured_phase = around + np.degrees(np.angle(measured / fitted))

    magnitude.fill_between(
        frequency, size * (1 - 0.999 * share), size * (1 + share), label="99 % region", **region
    )
    magnitude.plot(frequency, size, label="measured", **dots)
    phase.fill_between(frequency, measured_phase - lead, measured_phase + lead, **region)
    phase.plot(frequency, measured_phase, **dots)
    lines = (("true", true, figures.BLACK, "--"), ("fitted", fitted, figures.ORANGE, "-"))
    for name, response, color, style in lines:
        own = around + np.degrees(np.angle(response / fitted))
        magnitude.plot(frequency, abs(response), style, color=color, label=name)
        phase.plot(frequency, own, style, color=color)
        error.plot(frequency, abs(response - measured) / radius, ".", markersize=2.5, color=color)
    error.axhline(1.0, color=figures.BLACK, linewidth=0.8)
    magnitude.set_ylim(0.5 * abs(true).min(), 2.0 * abs(true).max())
    around_true = around + np.degrees(np.angle(true / fitted))
    phase.set_ylim(around_true.min() - 40.0, around_true.max() + 40.0)
    magnitude.set_yscale("log")
    magnitude.set_title(title)
    magnitude.set_ylabel("x / coil voltage [m/V]")
    phase.set_ylabel("phase [deg]")
    error.set_ylabel("distance / radius [1]")
    error.set_xlabel("frequency [Hz]")
    error.set_xscale("log")
    ticks = [100, 200, 500, 1000, 2000]
    error.set_xticks(ticks, [str(tick) for tick in ticks])
    error.minorticks_off()
    error.set_ylim(0.0, None)
    figures.legend_below(figure, magnitude)
    return figure
