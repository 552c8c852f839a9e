"""Figure 6.5 and the tables of the study at 5X, compared with the statements of the thesis."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from workbench import figures
from workbench.study import markdown_table
from workbench.types import Dataset, Figure

from ...drive.tables import Axis

LOOKS = {
    "mu-PID": (":", figures.ORANGE),
    "adjusted mu-PID": ("--", figures.ORANGE),
    "full order": ("-", figures.BLUE),
    "ninth order": ("-.", figures.GREEN),
}
PANELS = {
    "disturbance": "$w_p$ to $z_p$",
    "control": "$w_u$ to $z_u$",
    "both": "$w_p$ to both",
}
"""Signals of each channel."""


def figure_6_5(axis: Axis, answer: Dataset) -> Figure:
    """Figure 6.5, with both channels together and the bounds that no controller can beat."""
    figure, panels = figures.axes(3, 1, size=(7.5, 9.5), sharex=True)
    frequency = answer["frequency"]
    for panel, (channel, signals) in zip(panels, PANELS.items(), strict=True):
        for name, (dash, colour) in LOOKS.items():
            curve = answer["mu"].sel(controller=name, channel=channel, bound="upper")
            panel.loglog(frequency, curve, dash, color=colour, label=name)
        if channel in answer["bounded"].values:
            least = answer["least_mu"].sel(bounded=channel, bound="lower")
            label = "no controller, at this frequency"
            panel.fill_between(frequency, 1e-3, least, color="0.85", label=label)
        panel.axhline(1.0, color="0.4", linewidth=0.8)
        figures.label(panel, y=f"$\\mu$, {signals}")
        panel.set_ylim(0.03, 60.0)
    both = panels[-1]
    nominal, dynamic = answer["proven_level"].values
    pointwise = float(answer["pointwise_bound"].sel(bounded="both"))
    uncertain = np.fmax(pointwise, dynamic)
    for level, dash, plant in ((nominal, ":", "nominal"), (uncertain, "-", "uncertain")):
        label = f"no controller's peak, {plant} plant"
        both.axhline(level, color=figures.PURPLE, linestyle=dash, linewidth=1.6, label=label)
    both.set_xlabel("frequency [Hz]")
    panels[0].set_title(f"{axis}, 5X, stadiums")
    panels[0].set_xlim(float(frequency.min()), float(frequency.max()))
    figures.legend_below(figure, both, columns=2)
    return figure


def peaks_table(answer: Dataset) -> str:
    """Certified peaks [lower, upper] and their frequencies, one line per controller."""
    channels = answer["channel"].values
    rows = []
    for name in answer["controller"].values:
        one = answer.sel(controller=name)
        peaks = ["{:.3f} to {:.3f}".format(*one["peak"].sel(channel=c).values) for c in channels]
        where = float(one["peak_frequency"].sel(channel="both"))
        rows.append([name, *peaks, f"{where:.4g}"])
    reductions = ", ".join(
        f"{name} {float(peak):.3g}"
        for name, peak in zip(answer["reduction"].values, answer["reduction_peak"], strict=True)
    )
    heads = ["controller", *(PANELS[channel].replace("$", "") for channel in channels), "at [Hz]"]
    return (
        f"{markdown_table(heads, rows)}\nReductions of the full order, w_p to both: {reductions}.\n"
    )


def conclusions_table(axis: Axis, numbers: Mapping[str, float]) -> str:
    """Conclusions of section 6.3.2, with the numbers found."""

    def three(*names: str) -> str:
        return " and ".join(f"{numbers[name]:.3g}" for name in names)

    def below(value: float, text: str) -> str:
        return f"{text}: {'below' if value < 1 else 'above'} 1"

    def both(name: str) -> str:
        return three(f"peak_{name}_disturbance", f"peak_{name}_control")

    gain, norm, least = (numbers[n] for n in ("adjusted_gain", "nominal_norm", "pointwise_bound"))
    fit, slow = numbers["pointwise_bound_sets"], numbers["pointwise_bound_1X"]
    at, possible = numbers["pointwise_frequency_hz"], numbers["least_possible"]
    asked = [
        ("mu-PID, w_p to z_p", "20", three("peak_mu_pid_disturbance")),
        ("mu-PID, w_u to z_u", "below 1", three("peak_mu_pid_control")),
        (
            "mu-PID with more gain",
            "both channels comparable, above 1",
            f"gain x {gain:.3g}: {both('adjusted')}",
        ),
        (
            "controller of higher order",
            "74th, above 1",
            f"{numbers['order_full']:.0f}th: {both('full')}",
        ),
        ("reduced to ninth order", "above 1, flat", both("ninth")),
    ]
    found = {
        "least peak of any controller, nominal plant": below(
            norm, f"from {numbers['nominal_bound']:.4g} to {norm:.4g}"
        ),
        "least mu of any controller at one frequency": below(least, f"{least:.4g} at {at:.3g} Hz"),
        "the same, narrowest stadiums without fitted weights": below(fit, f"{fit:.4g}"),
        "the same, fitted weights, at 1X": below(slow, f"{slow:.4g}"),
        "least peak of any controller, uncertain plant": (
            f"from {possible:.4g} to {numbers['least_reached']:.4g}"
        ),
    }
    rows = [*asked, *((statement, "not asked", here) for statement, here in found.items())]
    rows.append(("this hardware cannot be driven at 5X", "yes", _verdict(numbers)))
    table = markdown_table(["statement", "thesis", "here"], rows)
    return f"{axis}; the thesis has results of the focus loop only.\n\n{table}"


def _verdict(numbers: Mapping[str, float]) -> str:
    if numbers["nominal_bound"] > 1.0:
        return "confirmed: no linear controller does it, even for the nominal drive"
    if numbers["least_possible"] > 1.0:
        return (
            "confirmed for the fitted stadiums, which no linear controller can master at "
            f"{numbers['pointwise_frequency_hz']:.3g} Hz; the nominal drive would allow it"
        )
    if numbers["least_reached"] < 1.0:
        return "refuted: a controller has a peak below 1"
    return f"open: none found, none excluded above {numbers['least_possible']:.4g}"
