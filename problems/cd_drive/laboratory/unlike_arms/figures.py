"""Figures of unlike arms."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.types import Dataset, Figure

COLORS = {4: figures.ORANGE, 6: figures.GREEN, 10: figures.PURPLE}


def figure_4_5(answer: Dataset, title: str) -> Figure:
    """Responses of the first draw, relative to the free mass, with fits of every order."""
    drawn, panels = figures.axes(2, 3, size=(11.0, 6.2), sharex=True, sharey="row")
    frequency = answer["frequency"].values
    slope = (2 * np.pi * frequency) ** 2
    for n, bench in enumerate(answer["bench"].values.tolist()):
        one, (upper, lower) = answer.sel(bench=bench), panels[n::3]
        measured, exact, radius = (one[name].values for name in ("measured", "exact", "radius"))
        dots: Any = {"linestyle": "none", "marker": ".", "markersize": 2.0}
        upper.plot(
            frequency,
            abs(measured) * slope,
            color=figures.BLUE,
            label="measured, 99 % region",
            **dots,
        )
        low, high = np.maximum(abs(measured) - radius, 0.0), abs(measured) + radius
        upper.fill_between(
            frequency, low * slope, high * slope, color=figures.SKY, alpha=0.3, linewidth=0.0
        )
        look: Any = {"color": figures.BLACK, "linewidth": 0.9, "linestyle": "--"}
        upper.plot(frequency, abs(exact) * slope, label="noise-free", **look)
        for order, color in COLORS.items():
            fitted = one["fitted"].sel(order=order).values
            if np.isfinite(fitted).all():
                upper.plot(frequency, fitted * slope, color=color, label=f"order {order}")
                off = 20 * np.log10(fitted / abs(exact))
                lower.plot(frequency, off, color=color)
        words = {"alike": "arms alike", "halves": "two unlike halves", "four": "four unlike arms"}
        figures.label(upper, title=f"{title}, {words[bench]}", log="x")
        figures.label(lower, x="frequency [Hz]", log="x")
        middle = abs(exact) * slope
        if n == 0:
            upper.set_ylim(0.3 * middle.min(), 2.2 * middle.max())
    figures.label(panels[0], y=r"$\omega^2$ |x / coil voltage| [m/(s$^2$ V)]")
    figures.label(panels[3], y="fit over noise-free [dB]")
    ticks = [100, 200, 500, 1000, 2000]
    for panel in panels[3:]:
        panel.set_xticks(ticks, [str(tick) for tick in ticks])
        panel.minorticks_off()
    handles: dict[str, Any] = {}
    for panel in panels[:3]:
        handles |= dict(zip(*reversed(panel.get_legend_handles_labels()), strict=True))
    drawn.legend(
        handles.values(), handles.keys(), loc="outside lower center", ncols=5, frameon=False
    )
    drawn.suptitle("Parasitic resonances and fits of several orders (figure 4.5)", fontsize=11)
    return drawn


def shown_of(answer: Dataset, title: str) -> Figure:
    """Number of resonances that four random arms show, over the spread of their links."""
    drawn, (panel,) = figures.axes(1, 1, size=(6.0, 3.8))
    place, before = np.arange(answer.sizes["deviation"]), np.zeros(answer.sizes["deviation"])
    for n, count in enumerate(answer["count"].values.tolist()):
        share = answer["random_shown"].sel(count=count).values
        panel.bar(place, share, bottom=before, color=figures.CYCLE[n], label=f"{count}", width=0.6)
        before = before + share
    names = [f"{one:.0%}" for one in answer["deviation"].values.tolist()]
    panel.set_xticks(place, names)
    words = "standard deviation of the arms' links"
    figures.label(panel, x=words, y="share of random arms", title=f"{title}: resonances that show")
    figures.legend_below(drawn, panel)
    return drawn
