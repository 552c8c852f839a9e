"""Figures of the disc servo: a whole disc, and strategies by the error of what they are told."""

from __future__ import annotations

import numpy as np

from workbench import figures
from workbench.types import Dataset, Figure

from ...drive.tables import compact_disc
from ...tolerance.strategy_looks import titled


def whole_disc(answer: Dataset) -> Figure:
    """Rotation, and least and largest fill with the certified bounds, over the time of a disc."""
    drawn, (above, below) = figures.axes(2, 1, size=(7.0, 5.4), sharex=True)
    minutes = answer["stretch"] / 60
    above.plot(minutes, answer["shown_rotation"], color=figures.BLUE)
    figures.label(above, y="rotation [Hz]", title="a disc of 20 g at 1.3 m/s")
    rate = compact_disc().frame_rate
    low, high = (rate * answer[name] for name in ("shown_low", "shown_high"))
    below.fill_between(minutes, low, high, color=figures.GREEN, alpha=0.5, label="simulated")
    most = rate * answer["swing"].max(["mass", "velocity"])
    at = _times(answer)
    for sign in (-1.0, 1.0):
        label = "certified, all discs" if sign > 0 else None
        below.plot(at, sign * most, "o--", color=figures.BLACK, markersize=4, label=label)
    figures.label(below, x="time [min]", y="fill beyond its middle [frames]")
    figures.legend_below(drawn, below)
    return drawn


def by_error(answer: Dataset) -> Figure:
    """Excursions over the reference strategy's, by the error of the rotation that is told."""
    axes = answer["axis"].values.tolist()
    drawn, panels = figures.axes(1, len(axes), size=(10.0, 4.4), sharey=True)
    ratio = answer["excursion"] / answer["reference_excursion"]
    for panel, axis in zip(panels, axes, strict=True):
        for n, strategy in enumerate(answer["strategy"].values.tolist()):
            at = {"axis": axis, "strategy": strategy}
            wrong = np.maximum(100 * abs(answer["wrong"].sel(at).values.ravel()), 1e-3)
            over = ratio.sel(at).values.ravel()
            panel.plot(
                wrong, over, ".", color=figures.CYCLE[n], markersize=4, label=titled(strategy)
            )
        panel.axhline(1.0, color="0.4", linewidth=0.8, linestyle="--")
        bound = 100 * float(answer["turn_change"].max())
        panel.axvline(
            bound,
            color=figures.BLACK,
            linewidth=0.8,
            linestyle=":",
            label="certified from turn to turn",
        )
        figures.label(
            panel, x="error of the rotation that is told [%]", title=f"{axis}, 12 drives", log="xy"
        )
    figures.label(panels[0], y="excursion over the reference strategy's")
    figures.legend_below(drawn, panels[0])
    return drawn


def _times(answer: Dataset) -> np.ndarray:
    """Times [min] at which a disc at 1.3 m/s reaches the radii of the study."""
    radii = answer["radius"].values
    whole = float(answer["stretch"][-1] + answer["stretch"][0]) / 60
    passed = (radii**2 - radii[0] ** 2) / (radii[-1] ** 2 - radii[0] ** 2)
    return np.asarray(whole * passed)
