"""Tables and figures of sensitivities and margins."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from workbench import figures
from workbench.heavy_types import DataArray, Dataset, Figure

from ..loops import SCALES

if TYPE_CHECKING:
    from ...drive.tables import Axis

LINES = {"continuous": figures.BLUE, "sampled": figures.ORANGE, "delayed": figures.GREEN}

WORDS = {"full": "full gain", "third": "a third of the gain"}


def gain_margin_db(answer: Dataset) -> DataArray:
    """Gain margins [dB] as Table A.4 has them: the smaller change, up or down."""
    up, down = (20 * np.log10(answer[side]) for side in ("increase", "decrease"))
    smaller: DataArray = np.minimum(up, -down)
    return smaller


def tables_of(answer: Dataset, bands: dict[str, list[tuple[float, float]]]) -> dict[str, str]:
    """Margins beside Table A.4, peaks of |W_p S|, bandwidths, bands of the Red Book."""
    return {
        "margins": _margins(answer),
        "weighted-sensitivity": _weighted(answer),
        "bandwidths": _bandwidths(answer),
        "red-book": _bands(bands),
    }


def _margins(answer: Dataset) -> str:
    loops = [str(loop) for loop in answer["loop"].values]
    measured = bool(answer["measured_db"].notnull().any())
    heads = ["drive", *(["Table A.4 [dB]"] if measured else [])]
    for loop in loops:
        heads += [f"{loop}: up [dB]", "down [dB]", "phase [deg]"]
        heads += ["from Table A.4 [dB]"] if measured else []
    lines = _head(heads)
    for drive in answer["drive"].values:
        one = answer.sel(drive=drive)
        table = float(one["measured_db"])
        cells = [_number(table, 1)] if measured else []
        for loop in loops:
            each = one.sel(loop=loop)
            up, down = (20 * np.log10(float(each[side])) for side in ("increase", "decrease"))
            cells += [f"{up:.1f}", f"{down:.1f}", f"{float(each['phase']):.1f}"]
            cells += [_number(float(gain_margin_db(each)) - table, 1)] if measured else []
        lines.append(f"| {drive} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _weighted(answer: Dataset) -> str:
    heads = ["drive"]
    for scale in answer["scale"].values:
        heads += [f"{WORDS[scale]}: largest W_p S", "at [Hz]", "above 1 [Hz]"]
    lines = _head(heads)
    for drive in answer["drive"].values:
        cells = []
        for scale in answer["scale"].values:
            one = answer.sel(drive=drive, scale=scale)
            fails = [band for band in one["fails_hz"].values if not np.isnan(band).any()]
            text = ", ".join(f"{low:.3g} to {high:.3g}" for low, high in fails) or "nowhere"
            cells += [f"{float(one['weighted'].sel(bound='upper')):.4f}"]
            cells += [f"{float(one['weighted_hz']):.1f}", text]
        lines.append(f"| {drive} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _bandwidths(answer: Dataset) -> str:
    lines = _head(
        ["loop", "definition", "nominal [Hz]", "least of twelve [Hz]", "largest of twelve [Hz]"]
    )
    words = {
        "S": "magnitude of S passes -3 dB",
        "crossover": "magnitude of L passes 1",
        "T": "magnitude of T passes -3 dB",
    }
    for loop in answer["loop"].values:
        for definition in answer["definition"].values:
            one = answer["bandwidth"].sel(loop=loop, definition=definition)
            nominal, twelve = float(one.sel(drive="nominal")), one.isel(drive=slice(-1))
            lines.append(
                f"| {loop} | {words[str(definition)]} | {nominal:.0f} "
                f"| {float(twelve.min()):.0f} | {float(twelve.max()):.0f} |"
            )
    return "\n".join(lines) + "\n"


def _bands(bands: dict[str, list[tuple[float, float]]]) -> str:
    lines = ["| statement | bands [Hz] |", "| --- | --- |"]
    for statement, found in bands.items():
        text = ", ".join(f"{low:.1f} to {high:.1f}" for low, high in found) or "none"
        lines.append(f"| {statement} | {text} |")
    return "\n".join(lines) + "\n"


def _head(heads: list[str]) -> list[str]:
    return [f"| {' | '.join(heads)} |", "| --- |" + " ---: |" * (len(heads) - 1)]


def _number(value: float, digits: int) -> str:
    return "-" if np.isnan(value) else f"{value:.{digits}f}"


def figures_of(answer: Dataset, axis: Axis) -> dict[str, Figure]:
    """Figure 6.6, and margins beside Table A.4 (section 6.3.3)."""
    return {"sensitivity": _sensitivity(answer, axis), "margins": _margin_figure(answer, axis)}


def _sensitivity(answer: Dataset, axis: Axis) -> Figure:
    """|S| of twelve drives at both gains, continuous and with the sampled loop's delay."""
    figure, panels = figures.axes(2, 2, size=(9.5, 7.0), sharex=True, sharey=True)
    frequency = answer["frequency"]
    twelve = answer["L"].isel(drive=slice(-1))
    rows = ("continuous", "delayed")
    for panel, (loop, scale) in zip(panels, [(r, s) for r in rows for s in SCALES], strict=True):
        S = abs(1 / (1 + SCALES[scale] * twelve.sel(loop=loop)))
        for k, size in enumerate(S.values):
            label = "twelve drives" if k == 0 else None
            panel.loglog(frequency, size, color=figures.BLUE, linewidth=0.7, label=label)
        panel.loglog(
            frequency, answer["permitted"], "--", color=figures.BLACK, label="1/W_p (eq. 6.11)"
        )
        panel.loglog(
            frequency, answer["red_book"], ":", color=figures.ORANGE, label="Red Book's own limit"
        )
        panel.set_title(f"{axis}, {loop}, {WORDS[scale]}")
        panel.set_ylim(1e-4, 10)
    for panel in panels[::2]:
        panel.set_ylabel("|S| [1]")
    for panel in panels[2:]:
        panel.set_xlabel("frequency [Hz]")
    figures.legend_below(figure, panels[0])
    return figure


def _margin_figure(answer: Dataset, axis: Axis) -> Figure:
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
    gains.set_xlabel("gain margin, up or down [dB]")
    gains.set_xlim(left=0)
    phases.set_xlim(0, 1.1 * float(answer["phase"].max()))
    phases.set_xlabel("phase margin [deg]")
    gains.set_title(f"{axis}, gain")
    phases.set_title(f"{axis}, phase")
    figures.legend_below(figure, gains, columns=4)
    return figure
