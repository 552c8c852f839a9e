"""Tables and figures of strategy C with designed fault filters.

Figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.study import draws_summary, interval_text, markdown_table, verdict_of_share
from workbench.types import DataArray, Dataset, Figure

from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis

COLOURS = {
    "reference": figures.BLACK,
    "high-pass": figures.ORANGE,
    "estimation": figures.GREEN,
    "with margins": figures.BLUE,
}
"""Colour of the reference strategy and of each filter."""


def loops(answer: Dataset, peak: float) -> str:
    """The loop with each filter while a defect passes, with one sample of delay, for the worst
    drive.
    """
    rows = []
    for name in answer["filter"].values.tolist():
        one = answer.sel(filter=name, sampling="delayed")
        stable = one["growth"] < 0
        margins = [
            f"{float(one[kind].min()):.1f}" if bool(stable.all()) else "none"
            for kind in ("gain_margin", "phase_margin")
        ]
        bounds = one["removal"].sel(bound="upper")
        mu = float(bounds.sel(condition="robust stability"))
        largest = peak * float(bounds.sel(condition="robust sensitivity"))
        unstable = f"{int((~stable).sum())} of {stable.size}"
        rows.append([name, unstable, f"{float(one['growth'].max()):.0f}", *margins])
        rows[-1] += [f"{mu:.3g}", f"{largest:.3g}"]
    heads = ["filter", "unstable loops", "fastest growth [1/s]", "gain margin [dB]"]
    heads += ["phase margin [deg]", "mu of stability", "largest S, every plant"]
    return markdown_table(heads, rows)


def experiments(answer: Dataset, smaller: DataArray) -> str:
    """Excursions by length and filter, all drives."""
    rows = []
    for length in answer["length"].values.tolist():
        for name in answer["case"].values.tolist():
            at = {"length": length, "case": name}
            told = interval_text(draws_summary(1e6 * answer["excursion"].sel(at), "drive"))
            share = float(smaller.sel(at))
            below = ["", ""] if name == "reference" else [f"{share:.0%}", verdict_of_share(share)]
            lost = f"{float((answer['events'].sel(at) > 0).mean()):.0%}"
            rows.append([f"{1e3 * length:.1f}", name, told, lost, *below])
    heads = ["scratch [mm]", "filter", "excursion [um]", "lost", "below the reference", "claim"]
    return markdown_table(heads, rows)


def front(answer: Dataset) -> str:
    """Cost of a bounded sensitivity for the estimate."""
    rows = []
    for peak in answer["peak_allowed"].values.tolist():
        for error in answer["point"].values.tolist():
            one = answer["front"].sel(peak_allowed=peak, point=error)
            leakage, noise = (float(one.sel(quantity=name)) for name in ("leakage", "noise"))
            cells = [f"{1e6 * leakage:.3f}", f"{3e6 * noise:.3f}"]
            rows.append([f"{peak:g}", f"{error:g}", *(cells if leakage > 0 else ["none", ""])])
    return markdown_table(
        ["sensitivity allowed", "error allowed", "leakage [um]", "3 rms [um]"], rows
    )


def figure_8_10(answer: Dataset, axis: Axis) -> Figure:
    """Open loops while a defect passes."""
    drawn, (gain, phase) = figures.axes(2, 1, size=(7.4, 6.4), sharex=True)
    frequency = answer["frequency"].values
    for name in answer["filter"].values.tolist():
        one = answer.sel(filter=name)
        L = one["L_real"].values + 1j * one["L_imag"].values
        gain.plot(frequency, 20 * np.log10(abs(L)), color=COLOURS[name], label=name)
        phase.plot(frequency, figures.phase(L), color=COLOURS[name])
    gain.axhline(0.0, color="0.5", linewidth=0.8)
    phase.axhline(-180.0, color="0.5", linewidth=0.8)
    title = f"{axis}, loop of K (1 - F), nominal drive, a sample late"
    figures.label(gain, y="gain [dB]", title=title, log="x")
    figures.label(phase, x="frequency [Hz]", y="phase [deg]", log="x")
    gain.set_ylim(-40.0, 60.0)
    figures.legend_below(drawn, gain)
    return drawn


def excursions(answer: Dataset, axis: Axis) -> Figure:
    """Excursions of every case by drive."""
    lengths = answer["length"].values.tolist()
    drawn, panels = figures.axes(len(lengths), 1, size=(8.4, 6.4), sharex=True)
    names = answer["case"].values.tolist()
    for panel, length in zip(panels, lengths, strict=True):
        for k, name in enumerate(names):
            one = draws_summary(1e6 * answer["excursion"].sel(length=length, case=name))
            mean, low, high = one.transpose("summary", "drive").values
            places = np.arange(answer.sizes["drive"]) + 0.15 * (k - (len(names) - 1) / 2)
            panel.vlines(places, low, high, color=COLOURS[name], linewidth=1.2)
            panel.plot(places, mean, "os^D"[k], color=COLOURS[name], label=name, markersize=4)
        limit = 1e6 * ACCEPTABLE_ERROR[axis]
        look: Any = {"color": "0.4", "linestyle": "--", "linewidth": 0.9}
        panel.axhline(limit, label="allowed (Red Book)", **look)
        title = f"{axis}, scratch of {1e3 * length:.1f} mm: mean and 90 % of the draws"
        figures.label(panel, x="", y=r"excursion [$\mu$m]", title=title, log="y")
    panels[-1].set_xticks(range(answer.sizes["drive"]), answer["drive"].values)
    figures.label(panels[-1], x="drive")
    figures.legend_below(drawn, panels[0], columns=5)
    return drawn


def costs(answer: Dataset, axis: Axis) -> Figure:
    """Leakage and noise of the best filters over the error, for each sensitivity allowed."""
    drawn, (panel,) = figures.axes(1, 1, size=(7.0, 4.4))
    for n, peak in enumerate(answer["peak_allowed"].values.tolist()):
        one = answer["front"].sel(peak_allowed=peak)
        total = one.sel(quantity="leakage") + 3 * one.sel(quantity="noise")
        label = f"|S| up to {peak:g} while a defect passes"
        panel.plot(answer["point"], 1e6 * total, "o-", color=figures.CYCLE[n], label=label)
    words = "largest relative error of the estimate above 1.5 kHz"
    title = f"{axis}, every plant of the set"
    figures.label(panel, x=words, y=r"leakage + 3 rms of the noise [$\mu$m]", title=title, log="y")
    figures.legend_below(drawn, panel, columns=1)
    return drawn
