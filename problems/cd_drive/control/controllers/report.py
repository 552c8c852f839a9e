"""Figure 6.4 with all controllers, and their table."""

from __future__ import annotations

from workbench import figures
from workbench.types import Dataset, Figure

from ...drive.tables import Axis

LOOKS = {
    "mu-PID": (":", figures.ORANGE),
    "third order": ("-", figures.GREEN),
    "D-K": ("--", figures.PURPLE),
    "(mu, D)-K": ("-.", figures.SKY),
    "(D, G)-K": ("-", figures.BLUE),
}
SIGNALS = {"disturbance": "$w_p$ to $z_p$", "both": "$w_p$ to both"}


def figure_6_4(axis: Axis, answer: Dataset, channel: str) -> Figure:
    """Mu of every controller with the uncertainty for which it was made, one panel per model."""
    figure, panels = figures.axes(2, 2, size=(10.0, 8.0), sharex=True, sharey=True)
    for panel, model in zip(panels, answer["model"].values, strict=True):
        at = answer.sel(model=model)
        for name, (dash, colour) in LOOKS.items():
            curve = at["mu"].sel(controller=name, channel=channel, bound="upper")
            panel.loglog(answer["frequency"], curve, dash, color=colour, label=name)
        if channel == "both" and bool(at["least_mu"].notnull().any()):
            label = "no controller, at this frequency"
            panel.fill_between(answer["frequency"], 1e-3, at["least_mu"], color="0.85", label=label)
        panel.axhline(1.0, color="0.4", linewidth=0.8)
        panel.set_ylim(0.05, 10.0)
        figures.label(panel, title=f"{axis}, 1X, {model}")
    for panel in panels[2:]:
        figures.label(panel, x="frequency [Hz]")
    for panel in panels[::2]:
        figures.label(panel, y=f"$\\mu$, {SIGNALS[channel]}")
    figures.legend_below(figure, panels[-1], columns=5)
    return figures.with_figure_numbers(figure, "6.4")


def peaks_table(answer: Dataset) -> tuple[list[str], list[list[str]]]:
    """Certified upper bounds, one line per controller and model."""
    channels = answer["channel"].values
    rows = []
    for model in answer["model"].values:
        for name in answer["controller"].values:
            at = answer.sel(model=model, controller=name)
            if not bool(at["order"].notnull()):
                continue
            peaks = [f"{float(at['peak'].sel(channel=c, bound='upper')):.4f}" for c in channels]
            bound, where = float(at["least_peak"]), float(at["least_peak_frequency"])
            least = "" if bound != bound else f"{bound:.4f} at {where:.1f} Hz"
            rows.append([model, name, str(int(at["order"])), *peaks, least])
    return ["uncertainty", "controller", "order", *channels, "no controller below"], rows
