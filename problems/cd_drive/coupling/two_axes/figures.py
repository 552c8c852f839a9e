"""Figures of the limits of couplings, of kicks, and of the identified cross responses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from workbench import figures
from workbench.types import Dataset, Figure


def by_frequency(answer: Dataset, drive: str) -> Figure:
    """Couplings of guessed sizes and the largest allowed ones, and how the tracks fade."""
    drawn, (left, right) = figures.axes(1, 2, size=(11.0, 4.4))
    for n, path in enumerate(("electrical", "magnetic", "springs", "tilt", "together")):
        colour = figures.BLACK if path == "together" else figures.CYCLE[n]
        left.plot(answer["frequency"], answer["coupled"].sel(path=path), color=colour, label=path)
    for place, style in (("force", "--"), ("reading", ":")):
        text = f"allowed, as a {place}"
        left.plot(
            answer["frequency"], answer["allowed"].sel(place=place), style, color="0.4", label=text
        )
    left.set_xscale("log")
    left.set_yscale("log")
    left.set_ylim(1e-4, 3.0)
    figures.label(left, x="frequency [Hz]", y="share of the focus coil's action [1]")
    left.set_title(f"from focus to radial, {drive}")
    left.legend(fontsize="x-small", ncols=2)
    right.plot(1e6 * answer["distance"], answer["contrast"], color=figures.BLUE)
    right.axvline(2.0, color="0.4", linewidth=0.8, linestyle=":")
    right.axhline(0.0, color="0.4", linewidth=0.8)
    figures.label(right, x=r"focus error [$\mu$m]", y="contrast of the tracks over that in focus")
    right.set_title("slope of the radial error out of focus")
    return drawn


def by_size(answer: Dataset, guessed: Mapping[str, float]) -> Figure:
    """Limits of all drives over the guessed sizes, and the certified limits of any coupling."""
    drawn, (left, right) = figures.axes(1, 2, size=(11.0, 4.2))
    paths = answer["path"].values.tolist()
    for n, path in enumerate(paths):
        size = answer["limit"].sel(path=path).min("sign").values / guessed.get(path, 1.0)
        spread = n + np.linspace(-0.25, 0.25, len(size))
        left.plot(spread, size, "o", color=figures.CYCLE[n % len(figures.CYCLE)], markersize=4)
    left.axhline(1.0, color="0.4", linewidth=0.8, linestyle="--")
    left.set_yscale("log")
    left.set_xticks(range(len(paths)), paths, rotation=20)
    figures.label(left, x="", y="limit over the guessed size", title="single paths, 12 drives")
    names = answer["drive"].values.tolist()
    for n, place in enumerate(answer["place"].values.tolist()):
        kept = 100 * answer["kept"].sel(place=place).values
        lost = 100 * abs(answer["worst"].sel(place=place)).max("entry").values
        at = np.arange(len(names)) + 0.3 * (n - 0.5)
        reach: Any = {"color": figures.CYCLE[n], "capsize": 3, "fmt": "none", "label": place}
        right.errorbar(at, (kept + lost) / 2, (lost - kept) / 2, **reach)
    right.set_xticks(range(len(names)), names, rotation=60)
    right.set_ylim(bottom=0.0)
    figures.label(right, x="", y="gain of any coupling [%]", title="from certified kept to lost")
    right.legend()
    return drawn


def by_kick(answer: Dataset) -> Figure:
    """Errors of both loops after a kick of either."""
    drawn, panels = figures.axes(1, 2, size=(10.0, 4.2), sharey=True)
    looks = (("none", "o", 3), ("alike", "x", 4))
    for panel, kick in zip(panels, answer["kick"].values, strict=True):
        for case, marker, size in looks:
            one = answer.sel(kick=kick, case_kicked=case)
            for n, axis in enumerate(("focus", "radial")):
                middle = 1e6 * one[axis].median(["drive", "draw"])
                low, high = (1e6 * one[axis].quantile(q, ["drive", "draw"]) for q in (0.0, 1.0))
                text = f"{axis} error, coupling {case}"
                colour = figures.CYCLE[n]
                panel.plot(
                    one["pulse"], middle, marker + "-", markersize=size, color=colour, label=text
                )
                panel.fill_between(one["pulse"], low, high, color=colour, alpha=0.15)
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_title(f"{kick} loop kicked by 10 V")
        figures.label(panel, x="length of the kick [samples]")
    figures.label(panels[0], y=r"largest error after it [$\mu$m]")
    figures.legend_below(drawn, panels[0], columns=2)
    return drawn


def identified_shares(answer: Dataset) -> Figure:
    """Identified cross responses over the own ones, with and without coupling."""
    drawn, panels = figures.axes(1, 2, size=(10.0, 4.0), sharex=True)
    for panel, entry in zip(panels, answer["entry"].values, strict=True):
        for n, case in enumerate(answer["case_kicked"].values):
            one = answer.sel(entry=entry, case_kicked=case)
            look: Any = {"color": figures.CYCLE[n], "fmt": "o", "markersize": 3, "capsize": 2}
            text = f"coupling {case}"
            low = np.minimum(one["share_radius"], one["share"])
            panel.errorbar(
                one["line"], one["share"], [low, one["share_radius"]], label=text, **look
            )
        panel.set_xscale("log")
        panel.set_title(f"{entry}, CD1")
        figures.label(panel, x="frequency [Hz]")
    figures.label(panels[0], y="cross response over the own one [1]")
    panels[1].legend()
    return drawn
