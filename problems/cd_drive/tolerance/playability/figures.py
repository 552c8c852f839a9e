"""Figures of `cd/playability`: the balloon, the scores, the search.

Figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.types import Dataset, Figure

from ..strategy_looks import COLOURS, titled
from .runs import REPAIRED

ARM_POWER = 0.25
"""Length of an arm, as a power of its share: that of `balloon_size`."""
RINGS = (1e-3, 1e-2, 0.1, 0.5)
"""Shares of time out of spec at which circles are drawn."""


def labels(answer: Dataset) -> list[str]:
    """Names of the strategies in figures."""
    return [titled(str(name)) for name in answer["strategy"].values]


def balloons(answer: Dataset) -> Figure:
    """Figure 2.15 with numbers: one arm per cause, one balloon per strategy."""
    figure, panels = figures.axes(1, 2, size=(11.0, 5.8), subplot_kw={"projection": "polar"})
    known = [str(name) for name in answer["known"].values]
    angle = 2 * np.pi * np.arange(len(known) + 1) / len(known)
    polar: list[Any] = panels  # matplotlib calls them axes of any kind
    for panel, axis in zip(polar, answer["axis"].values, strict=True):
        one = answer.sel(axis=axis)
        for name, label in zip(one["strategy"].values, labels(one), strict=True):
            own, colour = one.sel(strategy=name), COLOURS[str(name)]
            shares = own["arm"].values, *own["arm_interval"].transpose("end", "known").values
            length, low, high = (np.append(each, each[0]) ** ARM_POWER for each in shares)
            dashed = "--" if name == "tuned" else "-"
            panel.plot(angle, length, dashed, color=colour, marker="o", ms=3.0, label=label)
            panel.fill_between(angle, low, high, color=colour, alpha=0.12, lw=0)
        panel.set_xticks(angle[:-1], known)
        panel.tick_params(axis="x", pad=16)
        panel.set_theta_zero_location("N")
        panel.set_ylim(0.0, 1.0)
        panel.set_yticks(
            [ring**ARM_POWER for ring in RINGS], [f"{100 * ring:g} %" for ring in RINGS]
        )
        panel.set_rlabel_position(180.0 / len(known))
        panel.tick_params(axis="y", labelsize=7)
        panel.set_title(f"{axis}: share of time out of spec", pad=18)
    figures.legend_below(figure, panels[0], columns=6)
    return figures.with_figure_numbers(figure, "2.15")


def scores(answer: Dataset) -> Figure:
    """Losses and bursts over all circumstances."""
    figure, panels = figures.axes(1, 3, size=(11.0, 4.2))
    names = labels(answer)
    place = np.arange(len(names))
    for n, axis in enumerate(answer["axis"].values):
        one, colour = answer.sel(axis=axis), (figures.BLUE, figures.ORANGE)[n]
        beside = place + 0.2 * (2 * n - 1)
        lost = 100 * (one["losses"] > 0).mean(["drive", "circumstance"])
        unrepaired = 100 * (one["burst"] > REPAIRED).mean(["drive", "circumstance"])
        low, high = (one["balloon_interval"].sel(end=end) for end in ("low", "high"))
        error = abs(np.array([one["balloon"] - low, high - one["balloon"]]))
        panels[0].bar(
            beside, one["balloon"], 0.38, yerr=error, color=colour, capsize=2, label=str(axis)
        )
        panels[1].bar(beside, lost, 0.38, color=colour)
        panels[2].bar(beside, unrepaired, 0.38, color=colour)
    panels[0].set_ylabel("size of the balloon, 95 % interval [1]")
    panels[1].set_ylabel("runs that lose focus or track [%]")
    panels[2].set_ylabel(f"runs with a burst above {1e3 * REPAIRED:.1f} mm [%]")
    for panel in panels:
        panel.set_xticks(place, names, rotation=40, ha="right")
    figures.legend_below(figure, panels[0])
    return figure


def tuning(answer: Dataset, tuned: str) -> Figure:
    """Trials of the search, and the improvement on unseen discs."""
    figure, panels = figures.axes(1, 2, size=(9.5, 4.2))
    for n, axis in enumerate(answer["axis"].values):
        one, colour = answer.sel(axis=axis), (figures.BLUE, figures.ORANGE)[n]
        trial = 1 + np.arange(one.sizes["trial"])
        panels[0].plot(trial, one["cost"], "o", ms=3.5, color=colour, label=str(axis))
        panels[0].plot(trial, np.minimum.accumulate(one["cost"].values), color=colour)
        gained = one["gained"].sel(measure="balloon").item()
        low, high = one["gained_interval"].sel(measure="balloon").values
        panels[1].errorbar(
            [n], [gained], [[gained - low], [high - gained]], fmt="o", color=colour, capsize=4
        )
    y = "balloon, training discs; above 1: $|S|$ > 2 [1]"
    figures.label(panels[0], x="trial", y=y, title=f"{titled(tuned)}: search")
    panels[0].locator_params(axis="x", integer=True)
    panels[1].axhline(0.0, color=figures.BLACK, lw=0.8)
    panels[1].set_xlim(-0.6, 1.6)
    panels[1].set_xticks([0, 1], [str(axis) for axis in answer["axis"].values])
    gain, unseen = "tuned less untuned, 95 % [1]", "held-out discs and drives"
    figures.label(panels[1], y=gain, title=unseen)
    figures.legend_below(figure, panels[0])
    return figure
