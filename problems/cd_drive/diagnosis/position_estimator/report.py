"""Figures 7.14 and 7.15, the rotation followed, and the drives, of the position estimators."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.heavy_types import Axes, Dataset, Figure

from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis

LOOKS: dict[str, dict[str, Any]] = {
    "thesis": {"color": figures.PURPLE, "linestyle": ":"},
    "ITAE 5 kHz": {"color": figures.ORANGE, "linestyle": "--"},
    "ITAE 300 Hz": {"color": figures.GREEN, "linestyle": "-."},
    "Kalman settled": {"color": figures.SKY},
    "Kalman": {"color": figures.BLUE},
}
TRUE: dict[str, Any] = {"color": figures.BLACK, "linewidth": 0.9}


def figures_of(answer: Dataset, axis: Axis) -> dict[str, Figure]:
    """All figures of a study."""
    return {
        "figure-7-14": _effort(answer),
        "figure-7-15": _error(answer, axis),
        "rotation": _rotation(answer),
        "drives": _drives(answer),
        "graded-quality": _growth(answer),
    }


def numbers_of(answer: Dataset) -> dict[str, float]:
    """Metrics that follow from the arrays alone, lengths in micrometres."""
    um = 1e6 * answer["error"]
    numbers = {}
    for name in answer["estimator"].values:
        for case in answer["case"].values:
            word = _word(name) + ("" if case == "known" else f"_{case}")
            one = um.sel(estimator=name, case=case)
            numbers[f"spike_{word}_um"] = float(one.sel(phase="after", size="largest"))
            numbers[f"during_{word}_um"] = float(one.sel(phase="during", size="largest"))
            numbers[f"rms_quiet_{word}_um"] = float(one.sel(phase="quiet", size="rms"))
    for name in answer["fixed"].values:
        level = answer["growth"].sel(fixed=name)
        numbers[f"growth_{_word(name)}_per_s"] = float(level.max())
    for phase in ("during", "after", "quiet"):
        measured = 1e6 * answer["error_measured"].sel(phase=phase)
        numbers[f"{phase}_measured_um"] = float(measured.sel(size="largest"))
    for name in answer["rival"].values:
        word = _word(name)
        one = 1e6 * answer["drive_error"].sel(rival=name, size="largest").max("drive")
        numbers[f"drives_during_{word}_um"] = float(one.sel(phase="during"))
        numbers[f"drives_spike_{word}_um"] = float(one.sel(phase="after"))
        numbers[f"followed_{word}_hz"] = float(answer["followed"].sel(rival=name)[-1])
    worst = 1e6 * answer["drive_measured"].sel(size="largest").max("drive")
    numbers["drives_during_measured_um"] = float(worst.sel(phase="during"))
    if "K_obs_printed" in answer:
        off = answer["K_obs"] / answer["K_obs_printed"] - 1
        numbers |= {f"K_obs_{k + 1}_deviation": float(value) for k, value in enumerate(off.values)}
    for noise in answer["noise"].values:
        one = 1e6 * answer["prompt_error"].sel(noise=noise, phase="after", size="largest")
        numbers[f"spike_thesis_prompt_noise_{noise}_um"] = float(one)
    return numbers


def _word(name: Any) -> str:
    return "_".join(str(name).lower().split())


def tables_of(answer: Dataset) -> dict[str, str]:
    """Errors by estimator and case, and the gains of eq. 7.34."""
    head = "| estimator | rotation | in a scratch | 5 ms after | otherwise, rms |"
    lines = [head, "| --- | --- |" + " ---: |" * 3]
    um = 1e6 * answer["error"]
    rows = [("measured", "", 1e6 * answer["error_measured"])]
    rows += [
        (str(name), str(case), um.sel(estimator=name, case=case))
        for name in answer["estimator"].values
        for case in answer["case"].values
    ]
    for name, case, one in rows:
        cells = [one.sel(phase="during")[1], one.sel(phase="after")[1], one.sel(phase="quiet")[0]]
        lines.append(f"| {name} | {case} | " + " | ".join(f"{float(c):.3g}" for c in cells) + " |")
    found = {"errors": "Largest errors of x_cd - x [um].\n\n" + "\n".join(lines) + "\n"}
    if "K_obs_printed" in answer:
        lines = ["| K_obs | printed | computed | deviation |", "| --- |" + " ---: |" * 3]
        pairs = zip(answer["K_obs"].values, answer["K_obs_printed"].values, strict=True)
        for k, (own, printed) in enumerate(pairs, start=1):
            lines.append(f"| {k} | {printed:.5g} | {own:.5g} | {own / printed - 1:+.1%} |")
        found["equation-7-34"] = "\n".join(lines) + "\n"
    return found


def _effort(answer: Dataset) -> Figure:
    figure, (whole, zoom, quality) = figures.axes(
        3, 1, size=(7.2, 8.0), height_ratios=(1.0, 1.0, 0.45)
    )
    for name in ("ITAE 5 kHz", "thesis", "Kalman"):
        one = answer.sel(estimator=name)
        whole.plot(one["time"], one["effort"], label=name, **LOOKS[name])
        zoom.plot(one["zoomed"], one["effort_zoomed"], **LOOKS[name])
    whole.plot(answer["time"], answer["true_effort"], label="true", **TRUE)
    swing = float(abs(answer["true_effort"]).max())
    whole.set_ylim(-2.5 * swing, 2.5 * swing)
    whole.set_xlabel("time [s]")
    whole.set_ylabel("$u_p$ [V]")
    middle = float(answer.sel(estimator="Kalman")["effort_zoomed"].mean())
    zoom.set_ylim(middle - swing, middle + swing)
    zoom.set_ylabel("$u_p$ [V], one scratch")
    _quality(quality, answer)
    quality.sharex(zoom)
    figures.legend_below(figure, whole)
    return figure


def _error(answer: Dataset, axis: Axis) -> Figure:
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
    above.set_ylabel("$x_{cd} - x$ [um]")
    above.set_title("all estimators, cropped")
    below.set_title("those that bridge the scratch")
    below.set_ylabel("estimated $x_{cd} - x$ [um]")
    _quality(quality, answer)
    figures.legend_below(figure, above, columns=3)
    return figure


def _quality(panel: Axes, answer: Dataset) -> None:
    panel.plot(answer["zoomed"], answer["quality"], color=figures.BLACK)
    panel.set_ylim(-0.05, 1.05)
    panel.set_ylabel("$w_Q$ [1]")
    panel.set_xlabel("time from the start of the scratch [ms]")


def _rotation(answer: Dataset) -> Figure:
    figure, (frequency, errors) = figures.axes(1, 2, size=(8.4, 3.8))
    time = np.concatenate([answer["early"], answer["time"]])
    for name in answer["rival"].values:
        parts = answer["followed_start"], answer["followed"]
        course = np.concatenate([part.sel(rival=name) for part in parts])
        frequency.plot(time, course, label=str(name), **LOOKS[str(name)])
    frequency.set_xlabel("time [s]")
    frequency.set_ylabel("rotation followed [Hz]")
    frequency.legend(loc="lower right", frameon=False)
    cases, width = answer["case"].values, 0.38
    for k, name in enumerate(answer["rival"].values):
        one = 1e6 * answer["error"].sel(estimator=name, phase="quiet", size="rms")
        colour = LOOKS[str(name)]["color"]
        errors.bar(np.arange(len(cases)) + (k - 0.5) * width, one, width, color=colour)
    errors.set_xticks(range(len(cases)), [f"rotation\n{case}" for case in cases])
    errors.set_ylabel("rms error away from scratches [um]")
    return figure


def _drives(answer: Dataset) -> Figure:
    figure, panels = figures.axes(2, 1, size=(7.2, 6.0), sharex=True)
    names, width = answer["drive"].values, 0.27
    for panel, phase, title in zip(
        panels, ("during", "after"), ("in a scratch", "in the 5 ms after"), strict=True
    ):
        bars = [("measured", answer["drive_measured"], "0.55")]
        for rival in answer["rival"].values:
            one = answer["drive_error"].sel(rival=rival)
            bars.append((str(rival), one, LOOKS[str(rival)]["color"]))
        for k, (label, one, colour) in enumerate(bars):
            size = 1e6 * one.sel(phase=phase, size="largest")
            places = np.arange(len(names)) + (k - 1) * width
            panel.bar(places, size, width, color=colour, label=label)
        panel.set_ylabel(f"largest error [um]\n{title}")
    panels[1].set_xticks(range(len(names)), names)
    figures.legend_below(figure, panels[0])
    return figure


def _growth(answer: Dataset) -> Figure:
    figure, (panel,) = figures.axes(size=(7.0, 4.2))
    for name in answer["fixed"].values:
        one = answer["growth"].sel(fixed=name)
        panel.plot(answer["quality_level"], one, label=str(name), **LOOKS[str(name)])
    panel.axhline(0.0, color=figures.BLACK, linewidth=0.8)
    panel.set_yscale("symlog", linthresh=10.0)
    panel.set_xlabel("quality that scales the gain, and stays [1]")
    panel.set_ylabel("growth of the slowest mode [1/s]")
    figures.legend_below(figure, panel)
    return figure
