"""Figures of the sum in white dots and in jumps."""

from __future__ import annotations

import numpy as np

from workbench import figures
from workbench.types import Dataset, Figure


def sums_of_kinds(answer: Dataset) -> Figure:
    """The sum in every kind of defect, over all draws, axes and drives."""
    drawn, (panel,) = figures.axes(1, 1, size=(7.2, 3.8))
    kinds = answer["kind"].values.tolist()
    values = [answer["raised"].sel(kind=kind).values.ravel() for kind in kinds]
    panel.boxplot(values, whis=(5, 95), showfliers=False, medianprops={"color": figures.ORANGE})
    panel.set_xticks(np.arange(len(kinds)) + 1, kinds)
    panel.axhline(1.0, color="0.4", linestyle=":", linewidth=1.0)
    figures.label(panel, y="sum over that of the clean disc", title="Boxes 50 %, whiskers 90 %")
    return drawn


def one_jump(answer: Dataset) -> Figure:
    """Radial error and focus sum of one shaken drive."""
    drawn, (error, total) = figures.axes(2, 1, size=(7.2, 4.8), sharex=True)
    time = 1e3 * answer["time"]
    error.plot(time, 1e6 * answer["shown_error"])
    total.plot(time, answer["shown_sum"], color=figures.GREEN)
    figures.label(error, y=r"radial error [$\mu$m]", title="CD1, a shock that makes it jump")
    figures.label(total, x="time from the shock on [ms]", y="focus sum / on the track")
    return drawn
