"""Figures of the sledge: its jerks, and what becomes of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.study import share_interval
from workbench.types import Dataset, Figure

from ...drive.photo_diodes import CAPTURE
from ...drive.red_book import ACCEPTABLE_ERROR
from .bounds import moved_loop


def jerks(answer: Dataset) -> Figure:
    """Way and speed of the carriage, and the radial error, for three frictions on CD1."""
    rods = answer["shown_rods"].values
    drawn, panels = figures.axes(3, len(rods), size=(10.0, 6.4), sharex=True, sharey="row")
    time = 1e3 * (answer["moment"] - answer["moment"][0])
    rows = (
        ("shown_carriage", 1e6, r"carriage [$\mu$m]", figures.BLUE),
        ("shown_speed", 1e3, "its speed [mm/s]", figures.GREEN),
        ("shown_error", 1e6, r"radial error [$\mu$m]", figures.ORANGE),
    )
    for n, (name, factor, text, colour) in enumerate(rows):
        for m, friction in enumerate(rods):
            panel = panels[n * len(rods) + m]
            panel.plot(time, factor * answer[name].sel(shown_rods=friction), color=colour)
            if n == 0:
                panel.set_title(f"rods {friction:g} N, CD1")
            if name == "shown_error":
                for sign in (-1.0, 1.0):
                    limit = 1e6 * sign * ACCEPTABLE_ERROR["radial"]
                    panel.axhline(limit, color="0.4", linewidth=0.8, linestyle="--")
                panel.set_yscale("symlog", linthresh=0.5)
                panel.set_yticks([-10.0, -1.0, 0.0], ["-10", "-1", "0"])
                figures.label(panel, x="time [ms]")
        figures.label(panels[n * len(rods)], y=text)
    return drawn


def outcomes(answer: Dataset) -> Figure:
    """Quiet errors over the carriage's speed with the certified bound, and shares of rides."""
    drawn, (left, right) = figures.axes(1, 2, size=(11.0, 4.4))
    for n, rods in enumerate(answer["rods"].values):
        one = answer.sel(rods=rods)
        speed, error = 1e3 * one["quiet_speed"], 1e6 * one["quiet_largest"]
        left.plot(speed, error, ".", color=figures.CYCLE[n], label=f"rods {rods:g} N")
    per, kept = answer["per_speed"].sel(axis="radial"), answer["kept_speed"]
    worst = str(per.idxmax().values)
    certified = moved_loop("radial", worst)
    to = 0.999 * float(kept.sel(axis="radial", share=0.0, drive=worst))
    speeds = np.geomspace(0.03e-3, to, 80)
    left.plot(
        1e3 * speeds,
        1e6 * np.array([certified.bound(v) for v in speeds]),
        color=figures.BLACK,
        label="certified, worst drive",
    )
    left.axhline(1e6 * ACCEPTABLE_ERROR["radial"], color="0.4", linewidth=0.8, linestyle="--")
    left.axhline(1e6 * CAPTURE["radial"], color="0.4", linewidth=0.8, linestyle=":")
    figures.label(
        left,
        x="largest speed of the carriage [mm/s]",
        y=r"largest radial error [$\mu$m]",
        title="no noise, centred disc",
        log="xy",
    )
    figures.legend_below(drawn, left)
    at: Any = np.arange(answer.sizes["rods"])
    for n, share in enumerate(answer["share"].values):
        found = share_interval((answer["lost"] == 1.0).sel(share=share), "rods")
        mean, low, high = (found.sel(summary=end).values for end in ("mean", "low", "high"))
        look: Any = {"color": figures.CYCLE[n], "capsize": 2, "marker": "o", "markersize": 4}
        right.errorbar(
            at + 0.08 * (n - 1),
            mean,
            [mean - low, high - mean],
            label=f"{share:g}",
            **look,
        )
    right.set_xticks(at, [f"{one:g}" for one in answer["rods"].values])
    right.set_ylim(-0.03, 1.03)
    figures.label(
        right,
        x="static friction of the rods [N]",
        y="share of rides that lose the track",
        title="12 drives, 99 % intervals",
    )
    right.legend(loc="lower right", title="eccentricity / Red Book's")
    return drawn
