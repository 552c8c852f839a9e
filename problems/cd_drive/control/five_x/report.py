"""Figure 6.5 and the tables of the study at 5X, beside what the thesis says."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from workbench import figures
from workbench.heavy_types import Dataset, Figure

from ...drive.tables import Axis

LOOKS = {
    "mu-PID": (":", figures.ORANGE),
    "adjusted mu-PID": ("--", figures.ORANGE),
    "full order": ("-", figures.BLUE),
    "ninth order": ("-.", figures.GREEN),
}
PANELS = {"disturbance": "w_p to z_p", "control": "w_u to z_u", "both": "w_p to both"}


def figure_6_5(axis: Axis, answer: Dataset) -> Figure:
    """Figure 6.5, with both channels together and what no controller can beat."""
    figure, panels = figures.axes(3, 1, size=(7.5, 9.5), sharex=True)
    frequency = answer["frequency"]
    for panel, (channel, signals) in zip(panels, PANELS.items(), strict=True):
        for name, (dash, colour) in LOOKS.items():
            curve = answer["mu"].sel(controller=name, channel=channel, bound="upper")
            panel.loglog(frequency, curve, dash, color=colour, label=name)
        if channel in answer["bounded"].values:
            least = answer["least_mu"].sel(bounded=channel, bound="lower")
            panel.fill_between(
                frequency, 1e-3, least, color="0.85", label="no controller, at this frequency"
            )
        panel.axhline(1.0, color="0.4", linewidth=0.8)
        panel.set_ylabel(f"mu, {signals}")
        panel.set_ylim(0.03, 60.0)
    both = panels[-1]
    nominal, dynamic = answer["proven_level"].values
    pointwise = float(answer["pointwise_bound"].sel(bounded="both"))
    for level, dash, plant in (
        (nominal, ":", "nominal"),
        (np.fmax(pointwise, dynamic), "-", "uncertain"),
    ):
        label = f"no controller's peak, {plant} plant"
        both.axhline(level, color=figures.PURPLE, linestyle=dash, linewidth=1.6, label=label)
    both.set_xlabel("frequency [Hz]")
    panels[0].set_title(f"{axis}, 5X, stadiums")
    panels[0].set_xlim(float(frequency.min()), float(frequency.max()))
    figures.legend_below(figure, both, columns=2)
    return figure


def peaks_table(answer: Dataset) -> str:
    """Certified peaks [lower, upper] and their frequencies, a line for every controller."""
    channels = answer["channel"].values
    lines = [
        f"| controller | {' | '.join(PANELS[channel] for channel in channels)} | at [Hz] |",
        "| --- |" + " ---: |" * (len(channels) + 1),
    ]
    for name in answer["controller"].values:
        one = answer.sel(controller=name)
        peaks = [
            "{:.3f} to {:.3f}".format(*one["peak"].sel(channel=channel).values)
            for channel in channels
        ]
        where = float(one["peak_frequency"].sel(channel="both"))
        lines.append(f"| {name} | {' | '.join(peaks)} | {where:.4g} |")
    reductions = ", ".join(
        f"{name} {float(peak):.3g}"
        for name, peak in zip(answer["reduction"].values, answer["reduction_peak"], strict=True)
    )
    lines += ["", f"Reductions of the full order, w_p to both: {reductions}."]
    return "\n".join(lines) + "\n"


def conclusions_table(axis: Axis, numbers: Mapping[str, float]) -> str:
    """What section 6.3.2 concludes, and what was found."""

    def below(value: float) -> str:
        return "below 1" if value < 1 else "above 1"

    fit = numbers["pointwise_bound_sets"]
    lines = [
        f"{axis}; the thesis has results of the focus loop only.",
        "",
        "| statement | thesis | here |",
        "| --- | --- | --- |",
        f"| mu-PID, w_p to z_p | 20 | {numbers['peak_mu_pid_disturbance']:.3g} |",
        f"| mu-PID, w_u to z_u | below 1 | {numbers['peak_mu_pid_control']:.3g} |",
        "| mu-PID with more gain | both channels comparable, above 1 | gain x "
        f"{numbers['adjusted_gain']:.3g}: {numbers['peak_adjusted_disturbance']:.3g} and "
        f"{numbers['peak_adjusted_control']:.3g} |",
        f"| controller of higher order | 74th, above 1 | {numbers['order_full']:.0f}th: "
        f"{numbers['peak_full_disturbance']:.3g} and {numbers['peak_full_control']:.3g} |",
        f"| reduced to ninth order | above 1, flat | {numbers['peak_ninth_disturbance']:.3g} and "
        f"{numbers['peak_ninth_control']:.3g} |",
        "| least peak of any controller, nominal plant | not asked | from "
        f"{numbers['nominal_bound']:.4g} to {numbers['nominal_norm']:.4g}: "
        f"{below(numbers['nominal_norm'])} |",
        "| least mu of any controller at one frequency | not asked | "
        f"{numbers['pointwise_bound']:.4g} at {numbers['pointwise_frequency']:.3g} Hz: "
        f"{below(numbers['pointwise_bound'])} |",
        "| the same, narrowest stadiums without fitted weights | not asked | "
        f"{fit:.4g}: {below(fit)} |",
        f"| the same, fitted weights, at 1X | not asked | {numbers['pointwise_bound_1X']:.4g}: "
        f"{below(numbers['pointwise_bound_1X'])} |",
        "| least peak of any controller, uncertain plant | not asked | from "
        f"{numbers['least_possible']:.4g} to {numbers['least_reached']:.4g} |",
        f"| this hardware cannot be driven at 5X | yes | {_verdict(numbers)} |",
    ]
    return "\n".join(lines) + "\n"


def _verdict(numbers: Mapping[str, float]) -> str:
    if numbers["nominal_bound"] > 1.0:
        return "confirmed: no linear controller does it, even for the nominal drive"
    if numbers["least_possible"] > 1.0:
        return (
            "confirmed for the fitted stadiums, which no linear controller can master at "
            f"{numbers['pointwise_frequency']:.3g} Hz; the nominal drive would allow it"
        )
    if numbers["least_reached"] < 1.0:
        return "refuted: a controller has a peak below 1"
    return f"open: none found, none excluded above {numbers['least_possible']:.4g}"
