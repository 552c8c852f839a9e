"""The front, the two controllers on it, and their properties."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from workbench import figures
from workbench.study import Rows
from workbench.types import Axes, DataArray, Dataset, Figure

from ...drive.tables import Axis

LOOKS = {"high": ("-", figures.BLUE), "low": ("--", figures.ORANGE), "reference": (":", "0.2")}
WORDS = {"high": "high bandwidth", "low": "low bandwidth", "reference": "reference controller"}


def front_table(answer: Dataset) -> Rows:
    """Certified gains of every controller, and the lower bound of max(a, share b) for any
    controller.
    """
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
    return heads, rows


def cases_table(answer: Dataset, relaxed: float) -> Rows:
    """Margins of the nominal loops in continuous time, and certified robust performance of z_p."""
    heads = [
        "controller", "order", "crossover [Hz]", "|S| below -3 dB to [Hz]", "|T| above to [Hz]",
        "phase margin [deg]", "gain margin [dB]", "robust performance", f"with W_p / {relaxed:g}",
    ]  # fmt: skip
    rows = []
    for case in answer["case"].values.tolist():
        one = answer.sel(case=case)
        order = answer.sizes["state"] if case in ("high", "low") else 3
        widths = (one[key] for key in ("crossover_hz", "bandwidth_S", "bandwidth_T"))
        gain_margin = f"{_decibel(one['decrease'])}, {_decibel(one['increase'])}"
        peaks = [f"{value:.3f}" for value in one["mu"].sel(bound="upper").values]
        hertz = [f"{float(value):.0f}" for value in widths]
        phase = f"{float(one['phase']):.1f}"
        rows.append([WORDS[case], str(order), *hertz, phase, gain_margin, *peaks])
    return heads, rows


def _decibel(factor: DataArray) -> str:
    """A gain margin [dB]; 0 and infinity mean that there is none."""
    size = float(factor)
    return f"{20 * math.log10(size):+.1f}" if 0 < size < math.inf else "none"


def front_figure(axis: Axis, answer: Dataset, relaxed: float) -> Figure:
    """b over a: nominal and worst cases, the reference controller, and the region out of reach."""
    figure, (panel,) = figures.axes(1, 1, size=(7.5, 5.6))
    nominal, worst = answer["nominal"].values, answer["worst"].sel(bound="upper").values
    reference = answer["reference_nominal"].values
    reference_worst = answer["reference_worst"].sel(bound="upper").values
    for gains, style, colour, label in (
        (nominal, "o-", figures.BLUE, "H-infinity, nominal"),
        (worst, "o--", figures.SKY, "H-infinity, worst plant"),
        (reference, "s-", "0.2", "reference x gain, nominal"),
        (reference_worst, "s--", "0.55", "reference x gain, worst plant"),
    ):
        panel.loglog(gains[:, 0], gains[:, 1], style, color=colour, markersize=3.5, label=label)
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
    title = f"{axis}, disturbances against surface defects"
    figures.label(
        panel, x="$a$, largest $|W_p S|$ [1]", y="$b$, largest $|W_{sd} T|$ [1]", title=title
    )
    figures.legend_below(figure, panel, columns=3)
    return figure


def _shade(panel: Axes, answer: Dataset, left: float, bottom: float) -> None:
    """Shade the union of the rectangles that no controller with c <= 1 reaches."""
    level, share = answer["excluded"].values, answer["share"].values
    a = np.geomspace(left, level.max(), 2000)
    inside = a[:, None] < level
    b = np.where(inside, level / share, 0.0).max(axis=1)
    top, label = np.maximum(b, bottom), "out of reach, $c \\leq 1$"
    panel.fill_between(a, bottom, top, color="0.88", linewidth=0, label=label)


def loops_figure(axis: Axis, answer: Dataset) -> Figure:
    figure, (S, T, step, defect) = figures.axes(2, 2, size=(10.0, 7.2))
    frequency, time = answer["frequency"].values, 1e3 * answer["time"].values
    for case, (dash, colour) in LOOKS.items():
        one = answer.sel(case=case)
        S.loglog(frequency, one["S"], dash, color=colour, label=WORDS[case])
        T.loglog(frequency, one["T"], dash, color=colour)
        step.plot(time, one["step_error"], dash, color=colour)
        defect.plot(time, one["defect_error"], dash, color=colour)
    limit: dict[str, Any] = {"color": "0.7", "linewidth": 3, "zorder": 0}
    label = "$1/|W_p|$; $|W_{sd}|$; false displacement"
    S.loglog(frequency, answer["permitted"], **limit, label=label)
    T.loglog(frequency, answer["defects"], **limit)
    T.set_ylim(bottom=1e-3)
    defect.plot(time, answer["false"], **limit)
    hertz, milliseconds = "frequency [Hz]", "time [ms]"
    figures.label(S, x=hertz, y="$|S|$ [1]", title=f"{axis}, sensitivity")
    figures.label(T, x=hertz, y="$|T|$ [1]", title="complementary sensitivity")
    figures.label(
        step, x=milliseconds, y="error over the step [1]", title="after a step of the disc"
    )
    passing = "while a surface defect passes, and after"
    figures.label(defect, x=milliseconds, y="error over the false displacement [1]", title=passing)
    figures.legend_below(figure, S)
    return figure
