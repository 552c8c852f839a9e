"""Figures of the fault filter."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.diagnosis import FaultFront, FaultLoop
from workbench.figures import label, legend_below
from workbench.systems import bilinear_continuous, response
from workbench.types import Dataset, Figure, RealArray, StateSpace

from ...control.control_problem import optical_gain
from ...drive.tables import Axis
from ...laboratory.bench_setup import RATE
from .defect_estimates import relative_errors
from .loop import FAST, SLOW, grid

COLOURS = {"robust": figures.BLUE, "H-infinity": figures.GREEN, "high-pass": figures.ORANGE}
"""Colour of each filter."""
NAMES = {
    "robust": "robust, sampled",
    "H-infinity": "H-infinity, nominal",
    "high-pass": "high-pass, 450 Hz",
}
"""Names of the filters in tables and figures."""


def shape_errors(answer: Dataset, name: str, shape: str) -> RealArray:
    """Relative errors (12,) of a filter's estimates of a defect."""
    one = answer.sel(filter=name, shape=shape)
    return relative_errors(one["defect"].values, one["estimate"].values)


def total(front: Any) -> Any:
    """Leakage plus three times the noise's rms [m], at each point of the front."""
    return front.sel(quantity="leakage") + 3 * front.sel(quantity="noise")


def front(answer: Dataset) -> Figure:
    """Leakage and noise over the relative error: the filters found, and a lower bound.

    The filters found for each error are not the exact front: filters of more basis functions leak
    less.
    """
    figure, (panel,) = figures.axes(1, 1, size=(7.4, 5.2))
    looks = (("o--", figures.GREEN), ("s-", figures.BLUE))
    for kind, (dash, colour) in zip(answer["kind"].values, looks, strict=True):
        size = 1e6 * total(answer["front"].sel(kind=kind))
        panel.plot(answer["point"], size, dash, color=colour, label=f"filters found, {kind}")
    grey: Any = {"color": "0.85", "label": "out of reach, nominal plant"}
    least = min(float(total(answer["front"]).min()), float(answer["least_total"].min()))
    panel.fill_between(answer["point"], 2e5 * least, 1e6 * answer["least_total"], **grey)
    for name in answer["filter"].values.tolist():
        one = answer["judged"].sel(filter=name, kind="every plant")
        mark, size = ("*", 12) if name == "robust" else ("D", 7)
        style: Any = {"color": COLOURS[name], "label": f"{NAMES[name]}, every plant"}
        panel.plot(one.sel(quantity="error"), 1e6 * total(one), mark, markersize=size, **style)
    words = "largest relative error of the estimate above 1.5 kHz"
    share = float(answer["set_share"])
    title = "" if share >= 1.0 else f"for {share:.3g} of the set, which the loop itself bears"
    label(panel, x=words, y=r"leakage + 3 rms of the noise [$\mu$m]", title=title, log="y")
    panel.set_ylim(bottom=2e5 * least)
    legend_below(figure, panel, columns=2)
    return figure


def filters(axis: Axis, full: StateSpace, discrete: StateSpace) -> Figure:
    """Both filters over frequency, from displacement in units of the loop's error."""
    frequency = np.geomspace(1.0, 0.499 * RATE, 600)
    K_optn = optical_gain(axis)
    figure, (gain, phase) = figures.axes(2, 1, size=(7.4, 6.4), sharex=True)
    for K, dash, words in ((full, "-", "continuous"), (discrete, "--", "sampled")):
        values = response(K, 2 * np.pi * frequency)[:, 0, 0]
        size = 20 * np.log10(np.abs(values) / K_optn)
        gain.plot(frequency, size, dash, label=f"{words}, order {K.nstates}")
        phase.plot(frequency, figures.phase(values), dash)
    level = -20 * np.log10(K_optn)
    gain.axhline(level, color="0.5", linewidth=0.8)
    place: Any = {"xytext": (4, 3), "textcoords": "offset points"}
    gain.annotate(r"$1 / K_{optn}$", (frequency[0], level), **place)
    label(gain, y="$|K_f|$ [dB re 1 m per unit]", log="x")
    label(phase, x="frequency [Hz]", y=r"$\arg K_f$ [deg]", log="x")
    legend_below(figure, gain)
    return figure


def channel(loop: FaultLoop, K: StateSpace) -> Figure:
    """Gain from a defect to its estimate, and relative error: nominal, and extremes
    over the set.
    """
    front = FaultFront(loop, grid(loop))
    T = front.estimate(bilinear_continuous(K))
    figure, (gain, error) = figures.axes(2, 1, size=(7.4, 6.4), sharex=True)
    every = T[:, None] / front.p
    sizes = np.abs(every)
    words, frequency = "every plant", front.frequency_hz
    low, high = sizes.min(axis=1), sizes.max(axis=1)
    gain.fill_between(frequency, low, high, color=figures.SKY, alpha=0.5, label=words)
    error.plot(frequency, np.abs(1 - every).max(axis=1), color=figures.SKY, label=words)
    for panel, nominal in ((gain, np.abs(T)), (error, np.abs(1 - T))):
        panel.plot(frequency, nominal, color=figures.BLUE, label="nominal plant")
        for at in (SLOW, FAST):
            panel.axvline(at, color="0.6", linewidth=0.8)
    label(gain, y="gain, defect to estimate", log="xy")
    label(error, x="frequency [Hz]", y="relative error", log="xy")
    gain.set_ylim(1e-5, 4)
    error.set_ylim(0.02, 4)
    legend_below(figure, error, columns=2)
    return figure


def defects(answer: Dataset) -> Figure:
    """Every shape of defect and its estimates on the drives, by each filter."""
    shapes, names = answer["shape"].values, answer["filter"].values.tolist()
    figure, panels = figures.axes(
        len(shapes), len(names), size=(11.0, 7.4), sharex=True, sharey=True
    )
    places = ((shape, name) for shape in shapes for name in names)
    for panel, (shape, name) in zip(panels, places, strict=True):
        one = 1e6 * answer[["estimate", "defect"]].sel(shape=shape, filter=name)
        time = 1e3 * answer["time"]
        panel.plot(time, one["estimate"].T, color=COLOURS[name], linewidth=0.7)
        panel.plot(time, one["defect"], color=figures.BLACK, linewidth=1.2)
        panel.set_title(f"{shape}, {NAMES[name]}", fontsize=9)
        label(
            panel,
            x="time [ms]" if shape == shapes[-1] else "",
            y=r"defect [$\mu$m]" if name == names[0] else "",
        )
    return figure
