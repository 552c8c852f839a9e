"""Figures of one jump by every law, and of the landings of many."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench.study import share_interval
from workbench.types import Dataset, Figure


def one_jump(answer: Dataset, tracks: int, volts: float) -> Figure:
    """Position, error, sum and voltage of every law, one record on CD1."""
    laws = answer["law"].values.tolist()
    drawn, panels = figures.axes(4, len(laws), size=(12.0, 7.0), sharex=True, sharey="row")
    time = 1e3 * answer["moment"]
    rows = (
        ("shown_place", "tracks passed", figures.BLUE),
        ("shown_read", "error [units]", figures.SKY),
        ("shown_sum", "sum / on the track", figures.GREEN),
        ("shown_u", "u [V]", figures.ORANGE),
    )
    for n, (name, text, colour) in enumerate(rows):
        for m, law in enumerate(laws):
            panel = panels[n * len(laws) + m]
            panel.plot(time, answer[name].sel(law=law), color=colour)
            if not n:
                panel.axhline(tracks, color="0.4", linewidth=0.8, linestyle=":")
                panel.set_title(f"{law}, {tracks} tracks, {volts:g} V")
            if n == len(rows) - 1:
                figures.label(panel, x="time [ms]")
        figures.label(panels[n * len(laws)], y=text)
    return drawn


def by_tracks(answer: Dataset, countable: float) -> Figure:
    """Share of jumps that land on their track, over the number of tracks."""
    drawn, panels = figures.axes(2, 2, size=(9.0, 6.0), sharex=True, sharey=True)
    landed = (answer["off"] == 0.0) & (answer["held"] == 1.0)
    tracks, laws = answer["tracks"].values, answer["law"].values.tolist()
    place = np.arange(len(tracks))
    speeds = answer["speed"].sel(law=laws[0]).median(["share", "drive", "draw"])
    cells = [(volts, share) for volts in answer["volts"].values for share in answer["share"].values]
    for panel, (volts, share) in zip(panels, cells, strict=True):
        for n, law in enumerate(laws):
            one = landed.sel(volts=volts, share=share, law=law)
            mean, low, high = 100 * share_interval(one, "tracks").transpose("summary", ...).values
            look: Any = {"color": figures.CYCLE[n], "capsize": 2, "marker": "o", "markersize": 3}
            beside = place + 0.1 * (n - 1.5)
            panel.errorbar(beside, mean, [mean - low, high - mean], label=law, **look)
        fast = np.flatnonzero(speeds.sel(volts=volts).values > countable)
        if len(fast):
            panel.axvspan(fast[0] - 0.5, place[-1] + 0.5, color="0.9", zorder=0)
        panel.set_xticks(place, [str(one) for one in tracks])
        panel.set_title(f"{volts:g} V, eccentricity {share:g} of the Red Book")
    for panel in panels[2:]:
        figures.label(panel, x="tracks; grey: half a track or more from sample to sample")
    for panel in panels[::2]:
        figures.label(panel, y="share that lands [%], 99 %")
    figures.legend_below(drawn, panels[0])
    return drawn
