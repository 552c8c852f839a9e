"""Tables and figures of sensitivities and margins."""

from __future__ import annotations

import numpy as np

from workbench import figures
from workbench.study import Rows
from workbench.types import DataArray, Dataset, Figure

from ...drive.tables import Axis
from ..loops import SCALES

LINES = {"continuous": figures.BLUE, "sampled": figures.ORANGE, "delayed": figures.GREEN}

DEFINITIONS = {
    "S": "magnitude of S passes -3 dB",
    "crossover": "magnitude of L passes 1",
    "T": "magnitude of T passes -3 dB",
}
"""Definitions of bandwidth, in words."""
WORDS = {"full": "full gain", "third": "a third of the gain"}


def twelve(values: DataArray) -> DataArray:
    """Values of the measured drives, without the nominal one."""
    return values.isel(drive=slice(-1))


def gain_margin_db(increase: DataArray, decrease: DataArray) -> DataArray:
    """Gain margins [dB] as in Table A.4: the smaller change, up or down."""
    smaller: DataArray = np.minimum(20 * np.log10(increase), -(20 * np.log10(decrease)))
    return smaller


def margins_table(answer: Dataset) -> Rows:
    """Gain and phase margins of every drive and loop, with Table A.4."""
    measured = bool(answer["measured_db"].notnull().any())
    heads = ["drive", *(["Table A.4 [dB]"] if measured else [])]
    for loop in answer["loop"].values:
        heads += [f"{loop}: up [dB]", "down [dB]", "phase [deg]"]
        heads += ["from Table A.4 [dB]"] if measured else []
    rows = []
    for drive in answer["drive"].values:
        one = answer.sel(drive=drive)
        printed = float(one["measured_db"])
        cells = [str(drive), *([_number(printed)] if measured else [])]
        for loop in answer["loop"].values:
            each = one.sel(loop=loop)
            up, down = (20 * np.log10(float(each[side])) for side in ("increase", "decrease"))
            cells += [f"{up:.1f}", f"{down:.1f}", f"{float(each['phase']):.1f}"]
            margin = float(gain_margin_db(each["increase"], each["decrease"]))
            cells += [_number(margin - printed)] if measured else []
        rows.append(cells)
    return heads, rows


def weighted_table(answer: Dataset) -> Rows:
    """Peaks of |W_p S| of every drive at both gains, and the bands in which it exceeds 1."""
    heads = ["drive"]
    for scale in answer["scale"].values:
        heads += [f"{WORDS[scale]}: largest W_p S", "at [Hz]", "above 1 [Hz]"]
    rows = []
    for drive in answer["drive"].values:
        cells = [str(drive)]
        for scale in answer["scale"].values:
            one = answer.sel(drive=drive, scale=scale)
            fails = [band for band in one["fails_hz"].values if not np.isnan(band).any()]
            cells += [
                f"{float(one['weighted'].sel(bound='upper')):.4f}",
                f"{float(one['weighted_hz']):.1f}",
                ", ".join(f"{low:.3g} to {high:.3g}" for low, high in fails) or "nowhere",
            ]
        rows.append(cells)
    return heads, rows


def bandwidths_table(bandwidth: DataArray) -> Rows:
    """Bandwidths of the nominal loops, and their range over the twelve drives."""
    heads = ["loop", "definition", "nominal [Hz]", "least of twelve [Hz]", "largest of twelve [Hz]"]
    rows = []
    for loop in bandwidth["loop"].values:
        for definition, words in DEFINITIONS.items():
            one = bandwidth.sel(loop=loop, definition=definition)
            values = (one.sel(drive="nominal"), twelve(one).min(), twelve(one).max())
            rows.append([str(loop), words, *(f"{float(value):.0f}" for value in values)])
    return heads, rows


def _number(decibels: float) -> str:
    return "-" if np.isnan(decibels) else f"{decibels:.1f}"


def sensitivity_figure(answer: Dataset, axis: Axis) -> Figure:
    """|S| of twelve drives at both gains, continuous and with the sampled loop's delay."""
    figure, panels = figures.axes(2, 2, size=(9.5, 7.0), sharex=True, sharey=True)
    frequency = answer["frequency"]
    rows = ("continuous", "delayed")
    for panel, (loop, scale) in zip(panels, [(r, s) for r in rows for s in SCALES], strict=True):
        S = abs(1 / (1 + SCALES[scale] * twelve(answer["L"]).sel(loop=loop)))
        for k, size in enumerate(S.values):
            label = "twelve drives" if k == 0 else None
            panel.loglog(frequency, size, color=figures.BLUE, linewidth=0.7, label=label)
        permitted, red_book = answer["permitted"], answer["red_book"]
        panel.loglog(frequency, permitted, "--", color=figures.BLACK, label="$1/|W_p|$ (eq. 6.11)")
        panel.loglog(frequency, red_book, ":", color=figures.ORANGE, label="Red Book's own limit")
        figures.label(
            panel,
            x="frequency [Hz]" if loop == rows[-1] else "",
            y="$|S|$ [1]" if scale == "full" else "",
            title=f"{axis}, {loop}, {WORDS[scale]}",
        )
        panel.set_ylim(1e-4, 10)
    figures.legend_below(figure, panels[0])
    return figures.with_figure_numbers(figure, "6.6")


def margins_figure(answer: Dataset, axis: Axis) -> Figure:
    """Gain margins up and down, and phase margins, of every drive."""
    figure, (gains, phases) = figures.axes(1, 2, size=(9.5, 4.8), sharey=True)
    drives = [str(drive) for drive in answer["drive"].values]
    place = np.arange(len(drives))
    for loop, colour in LINES.items():
        one = answer.sel(loop=loop)
        up, down = (20 * abs(np.log10(one[side])) for side in ("increase", "decrease"))
        gains.plot(up, place, "o", color=colour, label=f"{loop}, up")
        gains.plot(down, place, "<", color=colour, label=f"{loop}, down", fillstyle="none")
        phases.plot(one["phase"], place, "o", color=colour)
    if answer["measured_db"].notnull().any():
        gains.plot(answer["measured_db"], place, "kx", label="measured (Table A.4)")
    gains.set_yticks(place, drives)
    gains.invert_yaxis()
    gains.set_xlim(left=0)
    phases.set_xlim(0, 1.1 * float(answer["phase"].max()))
    figures.label(gains, x="gain margin, up or down [dB]", title=f"{axis}, gain")
    figures.label(phases, x="phase margin [deg]", title=f"{axis}, phase")
    figures.legend_below(figure, gains, columns=4)
    return figure
