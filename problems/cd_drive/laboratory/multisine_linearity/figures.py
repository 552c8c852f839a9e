"""Errors of both tests of linearity over their duration, and how often they detect
the distortion.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from workbench import figures
from workbench.types import DataArray, Dataset, Figure

SIGNIFICANCE = 0.01
"""p-value below which a distortion counts as found."""


def linearity_tests(answer: Dataset, errors: Mapping[str, DataArray], title: str) -> Figure:
    """Rms errors of the squared levels, shares of draws that find odd distortion, levels without
    noise.
    """
    drawn, (accuracy, found, levels) = figures.axes(1, 3, size=(11.0, 4.0))
    times = {"multisine": answer["time"].values, "sines": answer["series_time"].values}
    p = {"multisine": answer["by_multisine_p"], "sines": answer["by_sines_p"].isel(size=-1)}
    names = {"multisine": "multisine", "sines": "sines of four sizes, by the largest"}
    for n, method in enumerate(names):
        for kind, style in (("odd", "o-"), ("even", "s--")):
            rms = np.sqrt((errors[method].sel(kind=kind) ** 2).mean("draw"))
            look: Any = {"color": figures.CYCLE[n], "markersize": 3}
            accuracy.plot(times[method], 1e4 * rms, style, label=f"{kind}, {names[method]}", **look)
            share = 100 * (p[method].sel(kind=kind) < SIGNIFICANCE).mean("draw")
            found.plot(times[method], share, style, **look)
    for kind, style in (("odd", "o-"), ("even", "s--")):
        own = 100 * np.sqrt(abs(answer["sines_truth"].sel(kind=kind)))
        levels.plot(answer["size"], own, style, color=figures.ORANGE, markersize=3)
        mean = 100 * float(abs(answer["multisine_truth"].sel(kind=kind)).mean()) ** 0.5
        levels.plot([1.0], [mean], style[0], color=figures.BLUE, markersize=6)
    figures.label(
        accuracy, x="time [s]", y=r"rms error of the level's square [%$^2$]", title=title, log="y"
    )
    figures.label(found, x="time [s]", y="draws that find it [%]", title="at a p-value of 0.01")
    figures.label(
        levels,
        x="size over the largest",
        y="level [%]",
        title="without noise; dot: multisine",
        log="y",
    )
    found.set_ylim(-3.0, 103.0)
    levels.set_ylim(1e-6, 10.0)
    figures.legend_below(drawn, accuracy)
    return drawn
