"""The front, the two controllers on it, and what they do."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from workbench import figures
from workbench.heavy_types import Axes, DataArray, Dataset, Figure

from ..methods.report import aligned

if TYPE_CHECKING:
    from ...drive.tables import Axis

LOOKS = {"high": ("-", figures.BLUE), "low": ("--", figures.ORANGE), "reference": (":", "0.2")}
WORDS = {"high": "high bandwidth", "low": "low bandwidth", "reference": "reference controller"}


def two_controllers_tables(answer: Dataset, relaxed: float) -> dict[str, str]:
    return {"front": _front_table(answer), "two": _two(answer, relaxed)}


def _front_table(answer: Dataset) -> str:
    """Certified gains of every controller, and how small max(a, share b) of any may be."""
    heads = ["controller", "a", "b", "c", "worst a", "worst b", "max(a, share b)", "its bound"]
    rows = []
    chosen = dict(zip(answer["chosen"].values.tolist(), answer["bandwidth"].values, strict=True))
    for i, share in enumerate(answer["share"].values):
        one = answer.isel(share=i)
        a, b, c = one["nominal"].values
        worst = [f"{value:.3f}" for value in one["worst"].sel(bound="upper").values]
        name = f"share {share:.3g}" + (f", {chosen[i]}" if i in chosen else "")
        level = [f"{max(a, share * b):.3f}", f"{float(one['excluded']):.3f}"]
        rows.append([name, f"{a:.3f}", f"{b:.3f}", f"{c:.3f}", *worst, *level])
    for i, gain in enumerate(answer["gain"].values):
        one = answer.isel(gain=i)
        worst = [f"{value:.3f}" for value in one["reference_worst"].sel(bound="upper").values]
        numbers = [f"{value:.3f}" for value in one["reference_nominal"].values]
        rows.append([f"reference x {gain:.3g}", *numbers, *worst, "", ""])
    return aligned(heads, rows)


def _two(answer: Dataset, relaxed: float) -> str:
    """Margins of the nominal loops in continuous time, and certified robust performance of z_p."""
    heads = [
        "controller", "order", "crossover [Hz]", "|S| below -3 dB to [Hz]", "|T| above to [Hz]",
        "phase margin [deg]", "gain margin [dB]", "robust performance", f"with W_p / {relaxed:g}",
    ]  # fmt: skip
    rows = []
    for case in answer["case"].values.tolist():
        one = answer.sel(case=case)
        order = answer.sizes["state"] if case in ("high", "low") else 3
        rows.append(
            [
                WORDS[case],
                str(order),
                *(
                    f"{float(one[key]):.0f}"
                    for key in ("crossover_hz", "bandwidth_S", "bandwidth_T")
                ),
                f"{float(one['phase']):.1f}",
                f"{_decibel(one['decrease'])}, {_decibel(one['increase'])}",
                *(f"{value:.3f}" for value in one["mu"].sel(bound="upper").values),
            ]
        )
    return aligned(heads, rows)


def _decibel(factor: DataArray) -> str:
    """A gain margin; 0 and infinity where there is none."""
    size = float(factor)
    return f"{20 * math.log10(size):+.1f}" if 0 < size < math.inf else "none"


def two_controllers_figures(axis: Axis, answer: Dataset, relaxed: float) -> dict[str, Figure]:
    return {"front": _front(axis, answer, relaxed), "loops": _loops(axis, answer)}


def _front(axis: Axis, answer: Dataset, relaxed: float) -> Figure:
    """b over a: nominal and worst cases, the reference controller, and what is out of reach."""
    figure, (panel,) = figures.axes(size=(7.5, 5.6))
    nominal, worst = answer["nominal"].values, answer["worst"].sel(bound="upper").values
    panel.loglog(
        nominal[:, 0], nominal[:, 1], "o-", color=figures.BLUE, markersize=3.5,
        label="H-infinity, nominal",
    )  # fmt: skip
    panel.loglog(
        worst[:, 0], worst[:, 1], "o--", color=figures.SKY, markersize=3.5,
        label="H-infinity, worst plant",
    )  # fmt: skip
    reference = answer["reference_nominal"].values
    reference_worst = answer["reference_worst"].sel(bound="upper").values
    panel.loglog(
        reference[:, 0], reference[:, 1], "s-", color="0.2", markersize=3.5,
        label="reference x gain, nominal",
    )  # fmt: skip
    panel.loglog(
        reference_worst[:, 0], reference_worst[:, 1], "s--", color="0.55", markersize=3.5,
        label="reference x gain, worst plant",
    )  # fmt: skip
    unity = int(np.argmin(abs(answer["gain"].values - 1)))
    panel.plot(*reference[unity, :2], "D", color="0.2", markersize=8, label="reference controller")
    for name, place in zip(answer["bandwidth"].values, answer["chosen"].values, strict=True):
        colour = LOOKS[name][1]
        panel.plot(*nominal[place, :2], "*", color=colour, markersize=13, label=WORDS[name])
        panel.plot(*worst[place, :2], "*", color=colour, markersize=13, markerfacecolor="none")
    left, bottom = 0.9 * nominal[:, 0].min() * 0.9, 0.7 * nominal[:, 1].min()
    _shade(panel, answer, left, bottom)
    panel.axvline(relaxed, color="0.6", linewidth=0.8, linestyle=":")
    panel.set_xlim(left=left)
    panel.set_ylim(bottom=bottom)
    panel.set_title(f"{axis}, disturbances against surface defects")
    panel.set_xlabel("a, largest |W_p S| [1]")
    panel.set_ylabel("b, largest |W_sd T| [1]")
    figures.legend_below(figure, panel, 3)
    return figure


def _shade(panel: Axes, answer: Dataset, left: float, bottom: float) -> None:
    """The union of the rectangles that no controller with c <= 1 is in."""
    level, share = answer["excluded"].values, answer["share"].values
    a = np.geomspace(left, level.max(), 2000)
    inside = a[:, None] < level
    b = np.where(inside, level / share, 0.0).max(axis=1)
    panel.fill_between(
        a, bottom, np.maximum(b, bottom), color="0.88", linewidth=0,
        label="out of reach, c <= 1",
    )  # fmt: skip


def _loops(axis: Axis, answer: Dataset) -> Figure:
    figure, (S, T, step, defect) = figures.axes(2, 2, size=(10.0, 7.2))
    frequency, time = answer["frequency"].values, 1e3 * answer["time"].values
    for case, (dash, colour) in LOOKS.items():
        one = answer.sel(case=case)
        S.loglog(frequency, one["S"], dash, color=colour, label=WORDS[case])
        T.loglog(frequency, one["T"], dash, color=colour)
        step.plot(time, one["step_error"], dash, color=colour)
        defect.plot(time, one["defect_error"], dash, color=colour)
    S.loglog(
        frequency, answer["permitted"], color="0.7", linewidth=3, zorder=0,
        label="1/|W_p|; |W_sd|; false displacement",
    )  # fmt: skip
    T.loglog(frequency, answer["defects"], color="0.7", linewidth=3, zorder=0)
    T.set_ylim(bottom=1e-3)
    defect.plot(time, answer["false"], color="0.7", linewidth=3, zorder=0)
    S.set_title(f"{axis}, sensitivity")
    T.set_title("complementary sensitivity")
    step.set_title("after a step of the disc")
    defect.set_title("while a surface defect passes, and after")
    S.set_ylabel("|S| [1]")
    T.set_ylabel("|T| [1]")
    step.set_ylabel("error over the step [1]")
    defect.set_ylabel("error over the false displacement [1]")
    for panel in (S, T):
        panel.set_xlabel("frequency [Hz]")
    for panel in (step, defect):
        panel.set_xlabel("time [ms]")
    figures.legend_below(figure, S)
    return figure
