"""Figures and tables of the fault filter."""

from __future__ import annotations

import numpy as np

from workbench import figures
from workbench.arrays import RealArray
from workbench.heavy_types import Dataset, Figure
from workbench.systems.generalised_plant import response
from workbench.systems.storage import restored

from ...control.control_problem import optical_gain
from ...laboratory.bench_setup import RATE
from .defect_estimates import relative_errors
from .front import FaultFront
from .loop import FAST, SLOW, FaultLoop, unsampled

LOOKS = {
    "robust": ("-", figures.BLUE),
    "H-infinity": ("--", figures.GREEN),
    "high-pass": (":", figures.ORANGE),
}
NAMES = {
    "robust": "robust, sampled",
    "H-infinity": "H-infinity, nominal",
    "high-pass": "high-pass, 450 Hz",
}


def shape_errors(answer: Dataset, name: str, shape: str) -> RealArray:
    """Relative errors (12,) of a filter's estimates of a defect."""
    one = answer.sel(filter=name, shape=shape)
    return relative_errors(one["defect"].values, one["estimate"].values)


def filter_figures(loop: FaultLoop, answer: Dataset) -> dict[str, Figure]:
    return {
        "front": _front(answer),
        "figure-7-12": _filters(answer),
        "estimate": _channel(loop, answer),
        "figure-7-13": _defects(answer),
    }


def filter_tables(answer: Dataset) -> dict[str, str]:
    """The front, and what each filter does."""
    lines = [
        "| relative error allowed | nominal plant [um] | no filter below [um] | every plant [um] |",
        "| ---: | ---: | ---: | ---: |",
    ]
    for error in answer["point"].values:
        at = answer["front"].sel(point=error)
        total = 1e6 * (at.sel(quantity="leakage") + 3 * at.sel(quantity="noise"))
        nominal, every = (float(total.sel(kind=kind)) for kind in answer["kind"].values)
        bound = 1e6 * float(answer["least_total"].sel(point=error))
        lines.append(f"| {error:.2f} | {nominal:.3f} | {bound:.3f} | {_or_none(every)} |")
    rows = [
        "| filter | error above 1.5 kHz | leakage [um] | 3 rms [um] | "
        + " | ".join(f"{shape}" for shape in answer["shape"].values)
        + " |",
        "| --- " + "| ---: " * (3 + answer.sizes["shape"]) + "|",
    ]
    for name in answer["filter"].values:
        error, leakage, noise = answer["judged"].sel(filter=name, kind="every plant").values
        shapes = " | ".join(
            f"{shape_errors(answer, name, shape).max():.2f}" for shape in answer["shape"].values
        )
        rows.append(
            f"| {NAMES[str(name)]} | {error:.3f} | {1e6 * leakage:.3f} | {3e6 * noise:.3f} "
            f"| {shapes} |"
        )
    return {"front": "\n".join(lines) + "\n", "filters": "\n".join(rows) + "\n"}


def _or_none(value: float) -> str:
    return f"{value:.3f}" if np.isfinite(value) else "none found"


def _front(answer: Dataset) -> Figure:
    figure, (panel,) = figures.axes(1, 1, size=(7.4, 5.2))
    looks = (("o--", figures.GREEN), ("s-", figures.BLUE))
    for kind, (dash, colour) in zip(answer["kind"].values, looks, strict=True):
        at = answer["front"].sel(kind=kind)
        leakage, noise = (1e6 * at.sel(quantity=name) for name in ("leakage", "noise"))
        panel.semilogy(answer["point"], leakage + 3 * noise, dash, color=colour, label=str(kind))
    panel.fill_between(
        answer["point"], 1e-2, 1e6 * answer["least_total"], color="0.85",
        label="out of reach, nominal plant",
    )  # fmt: skip
    for name in answer["filter"].values:
        error, leakage, noise = answer["judged"].sel(filter=name, kind="every plant").values
        mark = "*" if name == "robust" else "D"
        panel.plot(
            error, 1e6 * (leakage + 3 * noise), mark, color=LOOKS[str(name)][1],
            markersize=12 if mark == "*" else 7, label=f"{NAMES[str(name)]}, every plant",
        )  # fmt: skip
    panel.set_ylim(bottom=0.1)
    panel.set_xlabel("largest relative error of the estimate above 1.5 kHz")
    panel.set_ylabel("leakage + 3 rms of the noise [um]")
    figures.legend_below(figure, panel, columns=2)
    return figure


def _filters(answer: Dataset) -> Figure:
    frequency = np.geomspace(1.0, 0.499 * RATE, 600)
    omega = 2 * np.pi * frequency
    K_optn = optical_gain("focus")
    full, few = restored(answer, "full"), restored(answer, "discrete")
    curves = {
        f"continuous, order {full.nstates}": response(full, omega)[:, 0, 0],
        f"sampled, order {few.nstates}": response(few, omega)[:, 0, 0],
    }
    figure, (gain, phase) = figures.axes(2, 1, size=(7.4, 6.4), sharex=True)
    for (label, values), dash in zip(curves.items(), ("-", "--"), strict=True):
        gain.semilogx(frequency, 20 * np.log10(np.abs(values) / K_optn), dash, label=label)
        phase.semilogx(frequency, np.degrees(np.unwrap(np.angle(values))), dash)
    gain.axhline(-20 * np.log10(K_optn), color="0.5", linewidth=0.8)
    gain.annotate("1 / K_optn", (frequency[0], -20 * np.log10(K_optn)), xytext=(4, 3),
                  textcoords="offset points")  # fmt: skip
    gain.set_ylabel("|K_f| [dB re 1 m per unit]")
    phase.set_ylabel("arg K_f [deg]")
    phase.set_xlabel("frequency [Hz]")
    handles, labels = gain.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False)
    return figure


def _channel(loop: FaultLoop, answer: Dataset) -> Figure:
    """What of a defect is estimated: nominal, and the largest and least gain over the set."""
    front = FaultFront(loop)
    T = front.estimate(unsampled(restored(answer, "discrete")))
    figure, (gain, error) = figures.axes(2, 1, size=(7.4, 6.4), sharex=True)
    every = np.abs(T[:, None] / front.p)
    gain.fill_between(front.frequency, every.min(axis=1), every.max(axis=1), color=figures.SKY,
                      alpha=0.5, label="every plant")  # fmt: skip
    gain.loglog(front.frequency, np.abs(T), color=figures.BLUE, label="nominal plant")
    gain.set_ylabel("gain, defect to estimate")
    gain.set_ylim(1e-5, 4)
    wrong = np.abs(1 - T[:, None] / front.p).max(axis=1)
    error.loglog(front.frequency, wrong, color=figures.SKY, label="every plant")
    error.loglog(front.frequency, np.abs(1 - T), color=figures.BLUE, label="nominal plant")
    error.set_ylabel("relative error")
    error.set_ylim(0.02, 4)
    error.set_xlabel("frequency [Hz]")
    for panel in (gain, error):
        for at in (SLOW, FAST):
            panel.axvline(at, color="0.6", linewidth=0.8)
    figures.legend_below(figure, error, columns=2)
    return figure


def _defects(answer: Dataset) -> Figure:
    shapes, names = answer["shape"].values, answer["filter"].values
    figure, panels = figures.axes(
        len(shapes), len(names), size=(11.0, 7.4), sharex=True, sharey=True
    )
    grid = [panels[i : i + len(names)] for i in range(0, len(panels), len(names))]
    time = 1e3 * answer["time"]
    for row, shape in zip(grid, shapes, strict=True):
        for panel, name in zip(row, names, strict=True):
            one = answer.sel(shape=shape, filter=name)
            panel.plot(time, 1e6 * one["estimate"].T, color=LOOKS[str(name)][1], linewidth=0.7)
            panel.plot(time, 1e6 * one["defect"], color=figures.BLACK, linewidth=1.2)
            panel.set_title(f"{shape}, {NAMES[str(name)]}", fontsize=9)
        row[0].set_ylabel("defect [um]")
    for panel in grid[-1]:
        panel.set_xlabel("time [ms]")
    return figure
