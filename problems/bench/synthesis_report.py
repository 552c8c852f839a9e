"""Figures and tables of bench/synthesis."""

from __future__ import annotations

import numpy as np

from workbench import figures
from workbench.heavy_types import Dataset, Figure


def times_and_norms(answer: Dataset) -> Figure:
    """Times of controllers, and norms of their loops over our level."""
    figure, (times, norms) = figures.axes(1, 2, size=(10.0, 4.4))
    place = np.arange(answer["case"].size)
    own, theirs = (answer.sel(by=name) for name in answer["by"].values)
    times.plot(own["seconds"], place, "o", label="workbench, certified")
    times.plot(answer["riccati_seconds"], place, "|", ms=10, label="its Riccati method alone")
    times.plot(theirs["seconds"], place, "s", label="hinfsyn", color=figures.GREEN)
    times.set_xlabel("time of a controller [s]")
    times.set_yticks(place, list(answer["case"].values))
    level = own["claim"].values
    norms.plot(
        theirs["claim"] / level, place, "s", mfc="none", label="its claim", color=figures.GREEN
    )
    ratio = theirs["norm"].values / level
    norms.plot(ratio, place, "s", color=figures.GREEN)  # an unstable loop has none
    norms.plot(own["norm"] / level, place, "o", ms=4, color=figures.BLUE)
    norms.set_xlabel("norm of the loop over our level")
    norms.set_yticks(place, [""] * len(place))
    for panel in (times, norms):
        panel.set_xscale("log")
        panel.invert_yaxis()
    handles = [panel.get_legend_handles_labels() for panel in (times, norms)]
    figure.legend(
        *(a + b for a, b in zip(*handles, strict=True)),
        loc="outside lower center",
        ncols=3,
        frameon=False,
    )
    return figure


def of_plants(answer: Dataset) -> str:
    """Times and norms of each plant, in Markdown."""
    lines = [
        "| plant | time | Riccati method | hinfsyn's | norm | hinfsyn's | it claims |",
        "| :--- |" + " ---: |" * 6,
    ]
    for case in answer["case"].values:
        one = answer.sel(case=case)
        own, theirs = (one.sel(by=name) for name in answer["by"].values)
        times = own["seconds"], one["riccati_seconds"], theirs["seconds"]
        cells = [f"{float(value):.3g} s" for value in times]
        values = own["norm"], theirs["norm"], theirs["claim"]
        cells += [f"{float(value):.6g}" for value in values]
        lines.append(f"| {case} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def of_packages(answer: Dataset) -> str:
    """D-K iteration of the distillation column by each package, in Markdown."""
    lines = [
        "| package | time | controllers made | states | peak claimed | mu attained |",
        "| :--- |" + " ---: |" * 5,
    ]
    for package in answer["package"].values:
        one = answer.sel(package=package)
        lines.append(
            f"| {package} | {float(one['dk_seconds']):.3g} s | {int(one['dk_rounds'])} | "
            f"{int(one['dk_states'])} | {float(one['dk_peak']):.4f} | "
            f"{float(one['dk_lower']):.4f} |"
        )
    return "\n".join(lines) + "\n"
