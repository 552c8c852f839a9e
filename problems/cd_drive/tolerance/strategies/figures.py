"""Figures 8.7-8.9 and A.1-A.6, and the errors of all drives.

Figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.study import draws_summary
from workbench.types import Axes, Dataset, Figure

from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis
from ..strategy_looks import COLOURS, titled
from .runs import ENGAGED

STEMS = {"A": "figure-8-7", "B": "figure-8-8", "C": "figure-8-9", "K_prime": "figure-8-6"}
SIMULATED = {"A": ("A.1", "A.4"), "B": ("A.2", "A.5"), "C": ("A.3", "A.6"), "K_prime": ()}
"""Figures of the appendix that show the same by simulation: signals and true error."""


def strategy_figures(answer: Dataset, axis: Axis) -> dict[str, Figure]:
    """A figure of each strategy with the reference strategy, and one of all drives, by name."""
    found = {stem: _comparison(answer, name, axis) for name, stem in STEMS.items()}
    return found | {"drives": _drives(answer, axis)}


def _comparison(answer: Dataset, name: str, axis: Axis) -> Figure:
    figure, panels = figures.axes(3, 2, size=(8.4, 8.6))
    one, colour = answer.sel(strategy=name), COLOURS[name]
    for panel, signal, label in zip(
        panels, ("u", "f_en"), ("control $u$ [V]", f"error {_seen(axis)} [1]"), strict=False
    ):
        low, high = one["whole"].sel(wide_signal=signal).transpose("side", "time").values
        time = one["time"].values
        for part, shade in ((time <= ENGAGED, COLOURS["reference"]), (time >= ENGAGED, colour)):
            panel.fill_between(time[part], low[part], high[part], color=shade, linewidth=0.4)
        panel.axvline(ENGAGED, color="0.5", linestyle="--", linewidth=0.9)
        figures.label(panel, x="time [s]", y=label)
    rows = (("f_en", 1.0, f"error {_seen(axis)} [1], mean taken out"), ("error", 1e6, _true(axis)))
    for row, (signal, unit, label) in enumerate(rows, start=1):
        pair = panels[2 * row : 2 * row + 2]
        for panel, stage in zip(pair, ("before", "after"), strict=True):
            values = unit * one["zoom"].sel(stage=stage, signal=signal).values
            if signal == "f_en":
                values = values - values.mean()
            shade = COLOURS["reference"] if stage == "before" else colour
            _shade(panel, one, stage)
            panel.plot(one["zoomed"], values, color=shade)
            title = "reference strategy" if stage == "before" else _title(name)
            figures.label(panel, x="time from the start of the scratch [ms]", y=label, title=title)
        low = min(panel.get_ylim()[0] for panel in pair)
        high = max(panel.get_ylim()[1] for panel in pair)
        for panel in pair:
            panel.set_ylim(low, high)
    figure.suptitle(
        f"One record: reference strategy, from {ENGAGED:g} s on {_title(name)}; "
        "shaded: quality $w_Q$ below 1",
        fontsize=11,
    )
    return figures.with_figure_numbers(figure, *figures.numbers_in(STEMS[name]), *SIMULATED[name])


def _shade(panel: Axes, one: Dataset, stage: str) -> None:
    """Shade where the quality w_Q is below 1."""
    bad = one["zoom"].sel(stage=stage, signal="w_Q").values < 1.0
    look: dict[str, Any] = {"color": "0.88", "linewidth": 0.0}
    panel.fill_between(
        one["zoomed"].values, 0.0, 1.0, where=bad, transform=panel.get_xaxis_transform(), **look
    )


def _title(name: str) -> str:
    return "controller $K'$" if name == "K_prime" else f"strategy {titled(name)}"


def _seen(axis: Axis) -> str:
    return "$f_{en}$" if axis == "focus" else "$r_{en}$"


def _true(axis: Axis) -> str:
    return f"true error ${'e_x' if axis == 'focus' else 'e_y'}$ [$\\mu$m]"


def _drives(answer: Dataset, axis: Axis) -> Figure:
    figure, panels = figures.axes(2, 1, size=(8.4, 6.4), sharex=True)
    names = [str(name) for name in answer["strategy"].values]
    for panel, what, label in zip(
        panels,
        ("excursion", "periodic"),
        (
            "largest true error [$\\mu$m]\n5 ms after the scratch",
            "true error [$\\mu$m]\nat the rotation",
        ),
        strict=True,
    ):
        for k, name in enumerate(names):
            places = np.arange(answer.sizes["drive"]) + 0.1 * (k - (len(names) - 1) / 2)
            every = draws_summary(1e6 * answer[what].sel(strategy=name))
            mean, *ends = every.transpose("summary", "drive").values
            panel.vlines(places, *ends, color=COLOURS[name], linewidth=1.2)
            panel.plot(places, mean, "os^vD"[k], color=COLOURS[name], label=titled(name))
        panel.set_ylabel(label)
    panels[0].set_ylim(bottom=0.0)
    figure.suptitle(
        f"Mean and 90 % of {answer.sizes['draw']} draws of noise and scratch on each drive",
        fontsize=11,
    )
    limit = 1e6 * ACCEPTABLE_ERROR[axis]
    panels[0].axhline(limit, color="0.4", linestyle="--", linewidth=0.9, label="allowed (Red Book)")
    panels[1].set_xticks(range(answer.sizes["drive"]), answer["drive"].values)
    figures.label(panels[1], x="drive", log="y")
    figures.legend_below(figure, panels[0], columns=6)
    return figure
