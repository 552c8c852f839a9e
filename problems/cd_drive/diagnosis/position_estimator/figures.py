"""Figures of the position estimators: 7.14 and 7.15, the tracked rotation, and the drives."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.figures import label, legend_below
from workbench.study import draws_summary
from workbench.types import Axes, Dataset, Figure

from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis

LOOKS: dict[str, dict[str, Any]] = {
    "thesis": {"color": figures.PURPLE, "linestyle": ":"},
    "ITAE 5 kHz": {"color": figures.ORANGE, "linestyle": "--"},
    "ITAE 300 Hz": {"color": figures.GREEN, "linestyle": "-."},
    "Kalman settled": {"color": figures.SKY},
    "Kalman": {"color": figures.BLUE},
}
"""Style of the lines of each estimator."""
TRUE: dict[str, Any] = {"color": figures.BLACK, "linewidth": 0.9}
"""Style of the true values."""


def effort(answer: Dataset) -> Figure:
    """The control that makes the lens follow the disc, whole and about one scratch."""
    figure, (whole, zoom, quality) = figures.axes(
        3, 1, size=(7.2, 8.0), height_ratios=(1.0, 1.0, 0.45)
    )
    for name in ("ITAE 5 kHz", "thesis", "Kalman"):
        one = answer.sel(estimator=name)
        whole.plot(one["time"], one["effort"], label=name, **LOOKS[name])
        zoom.plot(one["zoomed"], one["effort_zoomed"], **LOOKS[name])
    whole.plot(answer["time"], answer["true_effort"], label="true", **TRUE)
    swing = float(abs(answer["true_effort"]).max())
    middle = float(answer.sel(estimator="Kalman")["effort_zoomed"].mean())
    whole.set_ylim(-2.5 * swing, 2.5 * swing)
    zoom.set_ylim(middle - swing, middle + swing)
    label(whole, x="time [s]", y="$u_p$ [V]", title="one record")
    label(zoom, y="$u_p$ [V], one scratch")
    _quality(quality, answer)
    quality.sharex(zoom)
    legend_below(figure, whole)
    return figure


def error(answer: Dataset, axis: Axis) -> Figure:
    """The estimated error about one scratch."""
    figure, (above, below, quality) = figures.axes(
        3, 1, size=(7.2, 8.0), sharex=True, height_ratios=(1.0, 1.0, 0.4)
    )
    time = answer["zoomed"]
    for panel in (above, below):
        panel.plot(time, 1e6 * answer["measured_error"], color="0.6", label="measured")
        panel.plot(time, 1e6 * answer["true_error"], label="true", **TRUE)
    for name in ("thesis", "ITAE 5 kHz", "ITAE 300 Hz", "Kalman"):
        one = 1e6 * answer["estimated_error"].sel(estimator=name)
        if name in answer["rival"]:
            below.plot(time, one, **LOOKS[name])
        above.plot(time, one, label=name, **LOOKS[name])
    size = 1e6 * ACCEPTABLE_ERROR[axis]
    above.set_ylim(-4 * size, 4 * size)
    label(above, y=r"$x_{cd} - x$ [$\mu$m]", title="one record, all estimators, cropped")
    words = r"estimated $x_{cd} - x$ [$\mu$m]"
    label(below, y=words, title="those that bridge the scratch")
    _quality(quality, answer)
    legend_below(figure, above, columns=3)
    return figure


def _quality(panel: Axes, answer: Dataset) -> None:
    panel.plot(answer["zoomed"], answer["quality"], color=figures.BLACK)
    panel.set_ylim(-0.05, 1.05)
    label(panel, x="time from the start of the scratch [ms]", y="$w_Q$ [1]")


def rotation(answer: Dataset) -> Figure:
    """The tracked rotation frequency, and the error that it saves."""
    figure, (frequency, errors) = figures.axes(1, 2, size=(8.4, 3.8))
    time = np.concatenate([answer["early"], answer["time"]])
    cases, width = answer["case"].values, 0.38
    for k, name in enumerate(answer["rival"].values):
        look = LOOKS[str(name)]
        parts = answer["followed_start"], answer["followed"]
        course = np.concatenate([part.sel(rival=name) for part in parts])
        frequency.plot(time, course, label=str(name), **look)
        rms = draws_summary(1e6 * answer["error"].sel(estimator=name, phase="quiet", size="rms"))
        _bars(errors, np.arange(len(cases)) + (k - 0.5) * width, rms, width, color=look["color"])
    errors.set_xticks(range(len(cases)), [f"rotation\n{case}" for case in cases])
    label(frequency, x="time [s]", y="rotation followed [Hz]", title="one record")
    label(errors, y=r"rms error away from scratches [$\mu$m]", title="mean of the draws")
    legend_below(figure, frequency)
    return figure


def drives(answer: Dataset) -> Figure:
    """Largest errors of the rivals on all drives: mean, and 90 % range of the draws."""
    figure, panels = figures.axes(2, 1, size=(7.2, 6.0), sharex=True)
    names, width = answer["drive"].values, 0.27
    bars = [("measured", answer["drive_measured"], "0.55")]
    bars += [
        (name, answer["drive_error"].sel(rival=name), LOOKS[name]["color"])
        for name in answer["rival"].values.tolist()
    ]
    phases = {"during": "in a scratch", "after": "in the 5 ms after"}
    for panel, (phase, words) in zip(panels, phases.items(), strict=True):
        for k, (rival, one, colour) in enumerate(bars):
            size = draws_summary(1e6 * one.sel(phase=phase, size="largest"))
            places = np.arange(len(names)) + (k - 1) * width
            _bars(panel, places, size, width, color=colour, label=rival)
        label(panel, y=f"largest error [$\\mu$m]\n{words}")
    panels[1].set_xticks(range(len(names)), names)
    legend_below(figure, panels[0])
    return figure


def _bars(panel: Axes, places: Any, summary: Any, width: float, **look: Any) -> None:
    """Means as bars, with a line over the interval of the draws."""
    mean, low, high = summary.transpose("summary", ...).values
    panel.bar(places, mean, width, **look)
    panel.vlines(places, low, high, color=figures.BLACK, linewidth=0.8)


def growth(answer: Dataset) -> Figure:
    """Growth of the slowest mode over a constant quality."""
    figure, (panel,) = figures.axes(1, 1, size=(7.0, 4.2))
    for name in answer["fixed"].values.tolist():
        one = answer["growth"].sel(fixed=name)
        panel.plot(answer["quality_level"], one, label=name, **LOOKS[name])
    panel.axhline(0.0, color=figures.BLACK, linewidth=0.8)
    panel.set_yscale("symlog", linthresh=10.0)
    label(
        panel,
        x="quality that scales the gain, and stays [1]",
        y="growth of the slowest mode [1/s]",
    )
    legend_below(figure, panel)
    return figure
