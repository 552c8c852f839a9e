"""Figures and tables of bench/synthesis."""

from __future__ import annotations

import numpy as np

from workbench import figures
from workbench.study import Rows
from workbench.types import Dataset, Figure


def times_and_norms(answer: Dataset) -> Figure:
    """Figure: times of synthesis, and norms of the loops relative to our level."""
    figure, (times, norms) = figures.axes(1, 2, size=(10.0, 4.4))
    place = np.arange(answer["case"].size)
    own, theirs = (answer.sel(by=name) for name in answer["by"].values)
    times.plot(own["seconds"], place, "o", label="workbench, certified")
    times.plot(answer["riccati_seconds"], place, "|", ms=10, label="its Riccati method alone")
    times.plot(theirs["seconds"], place, "s", label="hinfsyn", color=figures.GREEN)
    times.set_yticks(place, list(answer["case"].values))
    level = own["claim"].values
    norms.plot(
        theirs["claim"] / level, place, "s", mfc="none", label="its claim", color=figures.GREEN
    )
    ratio = theirs["norm"].values / level
    norms.plot(ratio, place, "s", color=figures.GREEN)  # an unstable loop has no norm
    norms.plot(own["norm"] / level, place, "o", ms=4, color=figures.BLUE)
    norms.set_yticks(place, [""] * len(place))
    figures.label(times, x="time of a controller [s]", log="x")
    figures.label(norms, x="norm of the loop over our level", log="x")
    for panel in (times, norms):
        panel.invert_yaxis()
    handles = [panel.get_legend_handles_labels() for panel in (times, norms)]
    figure.legend(
        *(a + b for a, b in zip(*handles, strict=True)),
        loc="outside lower center",
        ncols=3,
        frameon=False,
    )
    return figure


def of_plants(answer: Dataset) -> Rows:
    """Table of times [s] and norms for each plant."""
    heads = ["plant", "time [s]", "Riccati method [s]", "hinfsyn's [s]"]
    rows = []
    for case in answer["case"].values:
        one = answer.sel(case=case)
        own, theirs = (one.sel(by=name) for name in answer["by"].values)
        times = own["seconds"], one["riccati_seconds"], theirs["seconds"]
        norms = own["norm"], theirs["norm"], theirs["claim"]
        cells = [f"{float(value):.3g}" for value in times]
        rows.append([str(case), *cells, *(f"{float(value):.6g}" for value in norms)])
    return [*heads, "norm", "hinfsyn's", "it claims"], rows


def of_packages(answer: Dataset) -> Rows:
    """Table of D-K iteration of the distillation column by each package."""
    rows = [
        [
            str(package),
            f"{float(one['dk_seconds']):.3g}",
            str(int(one["dk_rounds"])),
            str(int(one["dk_states"])),
            f"{float(one['dk_peak']):.4f}",
            f"{float(one['dk_lower']):.4f}",
        ]
        for package, one in ((name, answer.sel(package=name)) for name in answer["package"].values)
    ]
    heads = ["package", "time [s]", "controllers made", "states", "peak claimed", "mu attained"]
    return heads, rows
