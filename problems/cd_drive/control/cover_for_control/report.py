"""Figures and table of the stadiums that were chosen for control."""

from __future__ import annotations

from workbench import figures
from workbench.types import Dataset, Figure, RealArray

from ...drive.tables import Axis

LOOKS = {
    "narrowest": (":", figures.ORANGE, "narrowest stadiums, reference controller"),
    "controller for it": ("--", figures.GREEN, "narrowest stadiums, controller for them"),
    "in turn": ("-.", figures.PURPLE, "stadiums and controller in turn"),
    "together": ("-", figures.BLUE, "nominal, stadiums and controller together"),
}


def cover_figures(
    axis: Axis, answer: Dataset, sizes: list[tuple[RealArray, RealArray]]
) -> dict[str, Figure]:
    """Mu of the stages over frequency; sizes (W_c, W_r) of the first and the last model."""
    mu, (panel,) = figures.axes(1, 1, size=(7.2, 4.8))
    for name, (dash, colour, label) in LOOKS.items():
        curve = answer["mu"].sel(stage=name, bound="upper")
        panel.loglog(answer["frequency"], curve, dash, color=colour, label=label)
    panel.axhline(1.0, color="0.4", linewidth=0.8)
    figures.label(panel, x="frequency [Hz]", y="$\\mu$ of robust performance", title=f"{axis}, 1X")
    figures.legend_below(mu, panel, columns=1)

    size, panels = figures.axes(1, 2, size=(10.0, 4.4), sharex=True, sharey=True)
    for panel, which, title in zip(panels, (0, 1), ("$|W_c|$", "$|W_r|$"), strict=True):
        for name, one in zip(("narrowest", "together"), sizes, strict=True):
            dash, colour, _ = LOOKS[name]
            label = "narrowest" if name == "narrowest" else "for control"
            panel.loglog(answer["frequency"], one[which], dash, color=colour, label=label)
        figures.label(panel, x="frequency [Hz]", title=f"{axis}, {title}")
    figures.label(panels[0], y="relative to the nominal")
    figures.legend_below(size, panels[0])
    return {"mu": mu, "weights": size}
