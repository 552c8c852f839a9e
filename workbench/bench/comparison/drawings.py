"""Every figure of a comparison, by file stem."""

from __future__ import annotations

import re

import numpy as np

from workbench._core.heavy_types import Dataset, Figure
from workbench.bench.comparison.accuracy_time import accuracy_against_time
from workbench.bench.comparison.agreement import agreement_matrix
from workbench.bench.comparison.layout import METHOD
from workbench.bench.comparison.numbers import certified, groups
from workbench.bench.comparison.profiles import cactus, performance_profile
from workbench.bench.comparison.scaling import has_sizes, scaling_figure
from workbench.bench.comparison.styles import Look, method_looks


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
