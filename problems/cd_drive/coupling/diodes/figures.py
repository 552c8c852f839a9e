"""Figures of the diodes' signals over both errors, of the gains, and of the pits in HF."""

from __future__ import annotations

from workbench import figures
from workbench.types import Dataset, Figure


def maps(answer: Dataset) -> Figure:
    """Focus error, radial error, D3 over D1 + D2, and HF, over both errors."""
    drawn, panels = figures.axes(2, 2, size=(9.0, 6.4), sharex=True, sharey=True)
    one = answer["signal"].sel(split="along")
    d1, d2, s1, s2, d3 = (one.sel(diode=name) for name in answer["diode"].values)
    shown = {
        "(D1 - D2) / (D1 + D2)": (d1 - d2) / (d1 + d2),
        "(S1 - S2) / (S1 + S2)": (s1 - s2) / (s1 + s2),
        "D3 / (D1 + D2), parted along the track": d3 / (d1 + d2),
        "HF = D1 + D2 + D3, over the focus sum": d1 + d2 + d3,
    }
    x, y = 1e6 * answer["focus"], 1e6 * answer["radial"]
    for panel, (name, values) in zip(panels, shown.items(), strict=True):
        lines = panel.contourf(x, y, values.transpose("radial", "focus"), 12, cmap="viridis")
        drawn.colorbar(lines, ax=panel)
        panel.set_title(name, fontsize="small")
    for panel in panels[2:]:
        figures.label(panel, x=r"focus error [$\mu$m]")
    for panel in panels[::2]:
        figures.label(panel, y=r"radial error [$\mu$m]")
    return drawn


def gains_drawn(answer: Dataset) -> Figure:
    """Focus gain beside the track by normaliser, and radial gain out of focus."""
    drawn, (left, right) = figures.axes(1, 2, size=(10.0, 3.8))
    y = 1e6 * answer["radial"]
    looks = (
        ("sum", "across", "-"),
        ("D3", "across", ":"),
        ("D3", "along", "-"),
        ("none", "across", "-"),
    )
    for n, (normaliser, split, style) in enumerate(looks):
        text = {"sum": "by D1 + D2", "D3": f"by D3, parted {split}", "none": "not normalised"}
        one = answer["gain_beside"].sel(normaliser=normaliser, split=split)
        left.plot(y, one, style, color=figures.CYCLE[n], label=text[normaliser])
    left.axvspan(-0.2, 0.2, color="0.92", zorder=0)
    left.legend(fontsize="small")
    figures.label(
        left, x=r"radial error [$\mu$m]; grey: allowed", y="focus gain over that on the track"
    )
    right.plot(1e6 * answer["focus"], answer["radial_gain_off"], color=figures.BLUE)
    right.axvspan(-2.0, 2.0, color="0.92", zorder=0)
    figures.label(
        right, x=r"focus error [$\mu$m]; grey: linear", y="radial gain over that in focus"
    )
    return drawn


def pits_drawn(answer: Dataset) -> Figure:
    """Modulation of HF by pits of each length out of focus, and between two tracks."""
    drawn, panels = figures.axes(1, 2, size=(10.0, 3.8), sharey=True)
    for panel, place in zip(panels, answer["place"].values, strict=True):
        for n, bits in enumerate(answer["bits"].values):
            one = answer["pits"].sel(place=place, bits=bits)
            colour = figures.CYCLE[n % len(figures.CYCLE)]
            panel.plot(1e6 * answer["defocus"], one, color=colour, label=f"{bits}T")
        panel.set_title(f"HF, {place}")
        figures.label(panel, x=r"focus error [$\mu$m]")
    figures.label(panels[0], y="amplitude over mean")
    panels[1].legend(ncols=2)
    return drawn
