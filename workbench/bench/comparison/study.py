"""A comparison as a Study: cells of problems by methods by accuracy levels, shown and counted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from workbench import figures
from workbench.certificate import Check
from workbench.errors import ResultError
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure
from workbench.solvers import ACCURACY
from workbench.study import Study
from workbench.tables import markdown

UNFIT = "unfit"
"""Outcome of a cell whose method cannot take its problem."""
METHOD = "by_method"
"""The dimension of methods; xarray's ``sel`` keeps the word method for itself."""
HEADS = [
    "problem", "method", "accuracy", "outcome", "claim", "success", "correct", "gap",
    "statement [s]", "solve [s]",
]  # fmt: skip
"""Heads of `rows`."""


@dataclass(frozen=True, eq=False)
class Comparison(Study):
    """The cells of a comparison. Its dataset has dims (problem, by_method, accuracy)."""

    cells: Callable[[Context], Dataset]

    headline = "certified_share"

    @property
    def quantifier(self) -> str:
        return "for these cells"

    @classmethod
    def stored(cls) -> Comparison:
        """One whose cells are known: it shows them, and answers no more."""

        def unknown(context: Context) -> Dataset:
            raise ResultError("a stored comparison cannot run again; call workbench.compare")

        return cls(unknown)

    def compute(self, context: Context) -> Dataset:
        return self.cells(context)

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        missing = 0
        return [Check("complete", "cells without an outcome", missing, 0)]

    def metrics(self, answer: Dataset) -> dict[str, float]:
        tried = answer["outcome"].values != UNFIT
        count = max(int(tried.sum()), 1)
        return {
            "certified_share": float(answer["certified"].values[tried].sum() / count),
            "cells": int(tried.sum()),
            "unfit": int((~tried).sum()),
        }

    def tables(self, answer: Dataset) -> dict[str, str]:
        reasons = "".join(f"\nUnfit: {text}\n" for text in unfit(answer))
        same = "".join(f"\nAlike: {text}\n" for text in alike(answer))
        return {"comparison": markdown(HEADS, rows(answer)) + reasons + same}

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return {"accuracy-against-time": accuracy_against_time(answer)}


def rows(data: Dataset) -> list[list[str]]:
    """A comparison's cells as text, a row each."""
    table = []
    for i, j, k in np.ndindex(*data["outcome"].shape):
        cell = {name: data[name].values[i, j, k] for name in data.data_vars}
        unfit = cell["outcome"] == UNFIT
        labels = (data["problem"].values[i], data[METHOD].values[j], data["accuracy"].values[k])
        table.append(
            [
                *map(str, labels),
                str(cell["outcome"]),
                "-" if unfit else str(cell["claim"]),
                "-" if unfit else ("yes" if cell["success"] else "no"),
                "-" if unfit else ("yes" if cell["correct"] else "no"),
                "-" if np.isnan(cell["gap"]) else f"{cell['gap']:.1e}",
                "-" if np.isnan(cell["statement"]) else f"{cell['statement']:.4f}",
                "-" if np.isnan(cell["solve"]) else f"{cell['solve']:.4f}",
            ]
        )
    return table


def unfit(data: Dataset) -> list[str]:
    """Why some methods cannot take some of the problems, a sentence each."""
    found = {}
    for i, j, k in np.ndindex(*data["outcome"].shape):
        if data["outcome"].values[i, j, k] == UNFIT:
            pair = f"{data['problem'].values[i]} by {data[METHOD].values[j]}"
            found[pair] = f"{pair}: {data['message'].values[i, j, k]}"
    return list(found.values())


def alike(data: Dataset) -> list[str]:
    """The methods that one computation answers for several levels, a sentence each."""
    if "served" not in data:  # made before methods said so
        return []
    found = []
    for i, j in np.ndindex(*data["outcome"].shape[:2]):
        levels, served = data["accuracy"].values, data["served"].values[i, j]
        for tolerance in dict.fromkeys(served.tolist()):
            same = levels[served == tolerance]
            if len(same) > 1 and (data["outcome"].values[i, j] != UNFIT).all():
                pair = f"{data['problem'].values[i]} by {data[METHOD].values[j]}"
                found.append(f"{pair}: one computation for {', '.join(same)}")
    return found


def accuracy_against_time(data: Dataset) -> Figure:
    """Certified gap over wall time, a panel per problem; hollow where no certificate holds."""
    names = data["problem"].values
    columns = min(2, len(names))
    lines = -(-len(names) // columns)
    figure, panels = figures.axes(
        lines, columns, size=(3.6 + 3.4 * columns, 0.8 + 3.2 * lines), sharex=True, sharey=True
    )
    floor = 1e-17  # an exact answer has no gap, a logarithmic axis no zero
    markers = dict(zip(ACCURACY, "osD", strict=True))
    for i, (panel, name) in enumerate(zip(panels, names, strict=False)):
        for j, method in enumerate(data[METHOD].values):
            colour = figures.CYCLE[j % len(figures.CYCLE)]
            seconds = (data["statement"] + data["solve"]).values[i, j]
            gap = np.maximum(data["gap"].values[i, j], floor)
            panel.plot(seconds, gap, color=colour, linewidth=0.7, alpha=0.6)
            for k, level in enumerate(data["accuracy"].values):
                held = bool(data["success"].values[i, j, k])
                panel.plot(
                    seconds[k],
                    gap[k],
                    markers[str(level)],
                    color=colour,
                    markerfacecolor=colour if held else "none",
                    label=str(method) if k == 0 else None,
                )
        if np.isfinite(data["gap"].values).any():
            panel.set_xscale("log")
            panel.set_yscale("log")
        panel.set_title(str(name))
        panel.set_xlabel("statement and solve [s]")
        panel.set_ylabel("certified gap, 0 at the bottom [relative]")
    for panel in panels[len(names) :]:
        panel.set_visible(False)
    for level in data["accuracy"].values:
        panels[0].plot([], [], markers[str(level)], color=figures.BLACK, label=str(level))
    panels[0].plot([], [], "o", color=figures.BLACK, markerfacecolor="none", label="no certificate")
    figures.legend_below(figure, panels[0], columns=8)
    return figure
