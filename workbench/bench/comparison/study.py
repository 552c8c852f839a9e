"""A comparison as a Study: cells of problems by methods by accuracy levels by repetitions."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from workbench._core.heavy_types import Dataset, Figure
from workbench.bench.comparison.accuracy_time import accuracy_against_time
from workbench.bench.comparison.agreement import agreement_matrix
from workbench.bench.comparison.layout import METHOD, asked_cells
from workbench.bench.comparison.numbers import badge, certified, counts, groups
from workbench.bench.comparison.profiles import (
    cactus,
    has_sizes,
    performance_profile,
    scaling_figure,
)
from workbench.bench.comparison.styles import Look, method_looks
from workbench.bench.comparison.tables import tables
from workbench.bench.comparison.verdicts import judged_cells
from workbench.certificate import Check
from workbench.errors import ResultError
from workbench.executor import Context
from workbench.study import Study


@dataclass(frozen=True, eq=False)
class Comparison(Study):
    """The cells of a comparison; `workbench.bench.comparison.layout` describes the dataset."""

    cells: Callable[[Context], Dataset]

    headline = "certified_share"

    @property
    def quantifier(self) -> str:
        return "for these cells"

    @classmethod
    def stored(cls) -> Comparison:
        """A comparison whose cells are stored: it can show them, but not compute any."""

        def unknown(context: Context) -> Dataset:
            raise ResultError("a stored comparison cannot run again; call workbench.compare")

        return cls(unknown)

    def compute(self, context: Context) -> Dataset:
        """The cells, with their verdicts."""
        return judged_cells(self.cells(context))

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        data = judged_cells(answer)
        stored = answer["verdict"].values if "verdict" in answer else data["outcome"].values
        excluded = counts(data)["contradictions"]
        other = int(np.sum(stored != data["verdict"].values))
        return [
            Check("cells", "1 if no method was asked", 1 - int(asked_cells(data).any()), 0),
            Check("verdicts", "verdicts that its cells do not give", other, 0),
            Check("contradictions", "cells whose certificates exclude each other", excluded, 0),
        ]

    def metrics(self, answer: Dataset) -> dict[str, float]:
        found = counts(judged_cells(answer))
        share = found["certified"] / found["cells"] if found["cells"] else float("nan")
        return {"certified_share": share, **found}

    def facts(self, answer: Dataset) -> list[str]:
        """Fact: if a comparison holds, its cells agree; that does not certify any of them."""
        return [badge(judged_cells(answer))]

    def tables(self, answer: Dataset) -> dict[str, str]:
        return tables(judged_cells(answer))

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return drawings(judged_cells(answer))


def drawings(data: Dataset) -> dict[str, Figure]:
    """The figures of a dataset with verdicts; with several Programs, separate ones for each."""
    known, parts = method_looks(data), list(groups(data))
    found: dict[str, Figure] = {}
    for program, one in parts:
        end = f"-{_stem(program)}" if len(parts) > 1 else ""
        found |= {f"{name}{end}": figure for name, figure in _program_figures(one, known).items()}
    return found


def _program_figures(data: Dataset, looks: dict[str, Look]) -> dict[str, Figure]:
    """The figures of one Program that have data, the most important one first.

    Profiles need many problems; for a single one the figure of accuracy against time shows
    everything.
    """
    found = {}
    if not np.isnan(data["gap"].values).all():
        found["accuracy-against-time"] = accuracy_against_time(data, looks)
    if certified(data).any():
        if data.sizes["problem"] > 1 or not found:
            found["performance-profile"] = performance_profile(data, looks)
            found["cactus"] = cactus(data, looks)
        if has_sizes(data):
            found["scaling"] = scaling_figure(data, looks)
    if data.sizes[METHOD] > 1 and np.isfinite(data["objective"].values).any():
        found["agreement"] = agreement_matrix(data)
    return found


def _stem(program: str) -> str:
    """A class name as part of a file name: MuUpperBound becomes mu-upper-bound."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "-", program).lower()
