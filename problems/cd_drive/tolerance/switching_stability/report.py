"""Loops, dwell times and errors of a drive whose controller switches: tables and figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from workbench import figures
from workbench.study import markdown_table
from workbench.types import Dataset, Figure

from ...drive.disc import VELOCITY
from ...drive.photo_diodes import CAPTURE
from ...drive.red_book import ACCEPTABLE_ERROR
from ...laboratory.bench_setup import PERIOD

if TYPE_CHECKING:
    from ...drive.tables import Axis

LOOKS = {
    "K": ("-", figures.BLUE),
    "K (1 - F)": ("--", figures.ORANGE),
    "K'": ("-.", figures.GREEN),
}
WORDS = {
    "open": "open loop (reference strategy)",
    "filter": "K (1 - F) (strategy C)",
    "lower": "K' by mu synthesis",
}
COLOURS = {"open": figures.BLUE, "filter": figures.ORANGE, "lower": figures.GREEN}
MM = 1e3 * PERIOD * VELOCITY
"""Length [mm] of track that passes per sample."""


def switching_tables(axis: Axis, answer: Dataset) -> dict[str, str]:
    return {
        "loops": _loops(answer),
        "dwell": _dwell(answer),
        "errors": _errors(axis, answer),
        "laboratory": _laboratory(answer),
    }


def _loops(answer: Dataset) -> str:
    """Margins of the nominal loops, the worst of the drives, and the share of the set tolerated."""
    heads = [
        "loop", "controller", "gain margin [dB]", "phase margin [deg]", "least of drives [dB]",
        "least of drives [deg]", "slowest motion, worst drive [1/s]", "unstable drives",
        "mu of robust stability", "share of the set tolerated",
    ]  # fmt: skip
    rows = []
    for sampling in answer["sampling"].values.tolist():
        for name in answer["controller"].values.tolist():
            one = answer.sel(controller=name, sampling=sampling)
            nominal, rest = one.sel(plant="nominal"), one.isel(plant=slice(0, -1))
            late = {"continuous": "none", "delayed": "delay"}.get(sampling)
            upper = float(one["mu"].sel(late=late, limit="upper")) if late else np.nan
            stable = bool((rest["growth"] < 0).all())
            rows.append(
                [
                    sampling,
                    name,
                    *(f"{float(nominal[key]):.1f}" for key in ("gain_margin", "phase_margin")),
                    *(
                        f"{float(rest[key].min()):.1f}" if stable else "unstable"
                        for key in ("gain_margin", "phase_margin")
                    ),
                    f"{float(rest['growth'].max()):+.1f}",
                    str(int((rest["growth"] >= 0).sum())),
                    f"{upper:.3f}" if late else "",
                    f"{1 / upper:.2f}" if late else "",
                ]
            )
    return markdown_table(heads, rows)


def _dwell(answer: Dataset) -> str:
    """Shortest distances between defects [samples]: proven stable, and shown unstable."""
    longest = answer.sizes["length"]
    heads = ["drive"]
    for strategy in answer["strategy"].values.tolist():
        heads += [f"{strategy}, proven", f"{strategy}, unstable"]
    rows = []
    for drive in answer["drive"].values.tolist():
        one = answer.sel(drive=drive)
        numbers = np.stack([one["dwell"].values, one["unstable"].values], axis=1).ravel()
        rows.append([drive, *(f"{number:.0f}" for number in numbers)])
    if "dwell_common" in answer:
        cells = [[f"{number:.0f}", ""] for number in answer["dwell_common"].values]
        rows.append(["all at once", *(cell for pair in cells for cell in pair)])
    share, volume = answer["box_share"].values, answer["box_volume"].values
    below = "\n".join(
        f"K to K' and back, the parametric set times {a:g}: {b:.1%} of its volume proven."
        for a, b in zip(share, volume, strict=True)
    )
    if answer.sizes["cell"]:
        longest_dwell, best = int(answer["cell_dwell"].max()), float(answer["box_of_cells"])
        below += f"\nSamples between defects that are enough, times {best:g}: {longest_dwell}."
    gap = int((answer["dwell"] - 1 - answer["unstable"]).max())
    between = "none: every proof is tight" if gap == 0 else f"at most {gap}"
    head = (
        f"Samples of {1e6 * PERIOD:.1f} us; defects of 1 to {longest} samples. "
        f"Distances neither proven nor made unstable: {between}.\n\n"
    )
    return head + markdown_table(heads, rows) + "\n" + below + "\n"


def _errors(axis: Axis, answer: Dataset) -> str:
    """Largest errors over all drives after the longest defect, and the longest defect that is
    allowed.
    """
    unit, far = ACCEPTABLE_ERROR[axis] * 1e6, int(answer["distance"][-1])
    heads = [
        "disc", "strategy", "bound at the longest defect [um]", "simulated [um]",
        f"longest within {unit:g} um, proven [mm]", "simulated [mm]",
        f"longest within {CAPTURE[axis] * 1e6:g} um, proven [mm]", "simulated [mm]",
    ]  # fmt: skip
    rows = []
    for case in answer["case"].values.tolist():
        for strategy in answer["strategy"].values.tolist():
            one = answer.sel(strategy=strategy, case=case).max("drive").isel(distance=-1, spaced=-1)
            cells = [case, WORDS[strategy], f"{float(one['bound'][-1]):.2f}"]
            cells.append(f"{float(one['simulated'][-1]):.2f}")
            for limit in (unit, CAPTURE[axis] * 1e6):
                cells += [
                    f"{reach:.2f}" if reach > 0.0 else "none"
                    for reach in (
                        float(proven(one["bound"].values[:, None], limit)[0]),
                        float(_crossed(one["simulated"].values[:, None], one, limit)[0]),
                    )
                ]
            rows.append(cells)
        cells = [case, "K goes on", f"{float(answer['alone'].sel(case=case).max()):.2f}"]
        rows.append(cells + [""] * 5)
    return f"All drives; defects {MM * far:.0f} mm apart.\n\n" + markdown_table(heads, rows)


def _laboratory(answer: Dataset) -> str:
    """Bounds, compared with the errors of the strategies in the virtual laboratory."""
    heads = ["strategy", "longest defect [mm]", "bound [um]"]
    heads += [f"{float(size):g} of the disc [um]" for size in answer["size"].values]
    rows = []
    for strategy in answer["strategy"].values.tolist():
        for length in answer["tested"].values.tolist():
            one = answer.sel(strategy=strategy, tested=length)
            bound = answer["bound"].sel(strategy=strategy, case="rotation", length=length)
            cells = [WORDS[strategy], f"{MM * length:.2f}", f"{float(bound[-1]):.2f}"]
            rows.append(cells + [f"{x:.2f}" for x in one["laboratory"].max("drive").values])
    head = (
        "Largest true error of all drives at 9 Hz; the bound is for the whole disc. In the "
        "laboratory K and K' follow each other; the bound is for a shared integrator.\n\n"
    )
    return head + markdown_table(heads, rows)


def switching_figures(axis: Axis, answer: Dataset) -> dict[str, Figure]:
    return {
        "figure-8-10": figures.with_figure_numbers(_open_loops(axis, answer), "8.10"),
        "dwell": _dwell_figure(axis, answer),
        "region": _region(axis, answer),
    }


def _open_loops(axis: Axis, answer: Dataset) -> Figure:
    """Bode and Nyquist plots of the nominal loops, sampled without delay."""
    figure, (size, phase, nyquist) = figures.axes(1, 3, size=(12.0, 4.4))
    frequency = answer["frequency"].values
    for name, (dash, colour) in LOOKS.items():
        one = answer.sel(controller=name)
        L = one["L_real"].values + 1j * one["L_imag"].values
        size.plot(frequency, abs(L), dash, color=colour, label=name)
        phase.plot(frequency, figures.phase(L), dash, color=colour)
        nyquist.plot(L.real, L.imag, dash, color=colour)
    angle = np.linspace(0, 2 * np.pi, 200)
    nyquist.plot(np.cos(angle), np.sin(angle), color="0.7", linewidth=0.8)
    nyquist.plot(-1, 0, "+", color="0.2", markersize=9)
    nyquist.set_xlim(-2.5, 1.25)
    nyquist.set_ylim(-2.25, 1.5)
    nyquist.set_aspect("equal")
    size.axhline(1.0, color="0.4", linewidth=0.8)
    phase.axhline(-180.0, color="0.4", linewidth=0.8)
    title = f"{axis}, nominal open loops sampled at 35 kHz"
    figures.label(size, x="frequency [Hz]", y="$|L|$ [1]", log="xy")
    figures.label(phase, x="frequency [Hz]", y=r"$\arg L$ [deg]", title=title, log="x")
    figures.label(nyquist, x=r"$\mathrm{Re}\,L$ [1]", y=r"$\mathrm{Im}\,L$ [1]")
    figures.legend_below(figure, size)
    return figure


def _dwell_figure(axis: Axis, answer: Dataset) -> Figure:
    figure, (panel,) = figures.axes(1, 1, size=(8.0, 4.6))
    place = np.arange(answer.sizes["drive"])
    width = 0.26
    for i, strategy in enumerate(answer["strategy"].values.tolist()):
        one = answer.sel(strategy=strategy)
        at = place + (i - 1) * width
        colour = COLOURS[strategy]
        panel.bar(at, one["dwell"], width * 0.9, color=colour, label=f"{WORDS[strategy]}, proven")
        panel.plot(
            at, np.maximum(one["unstable"], 0.7), "_", color=figures.BLACK, markersize=9,
            label="made unstable by periodic defects" if i == 2 else None,
        )  # fmt: skip
        if "dwell_common" in one:
            panel.axhline(
                float(one["dwell_common"]), color=colour, linewidth=1, linestyle=":",
                label=f"{strategy}, one set of functions",
            )  # fmt: skip
    panel.set_ylim(bottom=0.7)
    panel.set_xticks(place, answer["drive"].values)
    longest = f"{axis}, defects up to {MM * answer.sizes['length']:.1f} mm"
    title = f"{longest}: clean samples needed between them"
    figures.label(panel, y="distance [samples]", title=title, log="y")
    figures.legend_below(figure, panel, columns=2)
    return figure


def _region(axis: Axis, answer: Dataset) -> Figure:
    """Regions where the errors of all drives stay in the linear range and in the capture range."""
    strategies, cases = answer["strategy"].values.tolist(), answer["case"].values.tolist()
    figure, panels = figures.axes(
        len(cases), len(strategies), size=(10.5, 6.6), sharex=True, sharey=True
    )
    limits = {ACCEPTABLE_ERROR[axis] * 1e6: figures.BLUE, CAPTURE[axis] * 1e6: figures.ORANGE}
    titles = {"rotation": "largest deviation, 3 to 9 Hz", "envelope": "one harmonic, 1 to 500 Hz"}
    handles = None
    for panel, (case, strategy) in zip(
        panels, [(case, each) for case in cases for each in strategies], strict=True
    ):
        one = answer.sel(case=case, strategy=strategy)
        for limit, colour in limits.items():
            reach = proven(one["bound"].values, limit)
            simulated = _crossed(one["simulated"].max("drive").values, one, limit)
            panel.semilogx(
                MM * one["distance"], reach, color=colour, label=f"within {limit:g} $\\mu$m, proven"
            )
            panel.semilogx(
                MM * one["spaced"], simulated, "o:", color=colour, markersize=3,
                label=f"within {limit:g} $\\mu$m, simulated",
            )  # fmt: skip
            panel.fill_between(
                MM * one["distance"], 0.0, reach, color=colour, alpha=0.12, linewidth=0
            )
        handles = handles or panel
        panel.set_title(f"{WORDS[strategy]}:\n{titles[case]}", fontsize=9)
        panel.set_ylim(-0.05, 1.05 * MM * answer.sizes["length"])
    for panel in panels[:: len(strategies)]:
        panel.set_ylabel("longest defect [mm]")
    for panel in panels[-len(strategies) :]:
        figures.label(panel, x="distance between defects [mm]", log="x")
    assert handles is not None
    figures.legend_below(figure, handles)
    return figure


def proven(bound: np.ndarray, limit: float) -> np.ndarray:
    """Length [mm] up to which bounds (lengths, distances), beginning at one sample,
    keep a limit.
    """
    inside = bound <= limit
    held: np.ndarray = np.where(inside.all(axis=0), len(inside), np.argmin(inside, axis=0))
    return MM * held


def _crossed(error: np.ndarray, answer: Dataset, limit: float) -> np.ndarray:
    """Length [mm] at which simulated errors (lengths, distances) first exceed a limit.

    It is interpolated linearly between the simulated lengths; 0 if the shortest exceeds the limit.
    """
    played = answer["played"].values.astype(float)
    found = np.zeros(error.shape[1])
    for i, column in enumerate(error.T):
        over = np.flatnonzero(column > limit)
        if not over.size:
            found[i] = played[-1]
        elif over[0] > 0:
            before, after = over[0] - 1, over[0]
            share = (limit - column[before]) / (column[after] - column[before])
            found[i] = played[before] + share * (played[after] - played[before])
    return MM * found
