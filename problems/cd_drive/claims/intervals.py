"""The 99 % interval of a number that comes from simulated draws."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import cached_property
from typing import Any

import numpy as np
from scipy import stats

from workbench import Run
from workbench.types import Dataset

from .items import Found, Quantity

DRAWN = ("draw", "circumstance")
"""Dimensions over which a study repeats an experiment."""
UNTOLD = (
    "cd/*/best-gains",
    "cd/*/two-controllers-switched",
    "cd/*/immunity",
    "cd/*/multisine-linearity",
    "cd/playability",
)
"""Simulations that store only the results over all circumstances, so no interval can be computed.
"""
GROUPS = 10
"""Number of groups of draws that are left out in turn."""
CONFIDENCE = 0.99


@dataclass(frozen=True)
class Resampled:
    """A run without some of its draws. A quantity reads it like a complete run."""

    run: Run
    data: Dataset

    @property
    def certificate(self) -> Any:
        """The certificate of the whole run."""
        return self.run.certificate

    @cached_property
    def metrics(self) -> Mapping[str, float]:
        """Metrics of the remaining draws."""
        return self.run.task.metrics(self.data)


@dataclass(frozen=True)
class Measured:
    """A stored run, with the parts of it that are needed for the intervals of its numbers.

    The method is the delete-a-group jackknife: the number is computed again without each of ten
    groups of draws (or without each draw, if there are fewer), and the spread gives the standard
    error.
    """

    run: Run

    @cached_property
    def without(self) -> list[Resampled]:
        """The run without each group of its draws in turn; empty if it has no draws."""
        data = self.run.data
        dimension = next((name for name in DRAWN if name in data.sizes), None)
        if dimension is None:
            return []
        parts = np.array_split(np.arange(data.sizes[dimension]), min(GROUPS, data.sizes[dimension]))
        every = np.arange(data.sizes[dimension])
        return [
            Resampled(self.run, data.isel({dimension: np.setdiff1d(every, part)})) for part in parts
        ]

    def found(self, quantity: Quantity) -> Found:
        """A number of the run with its interval."""
        value = quantity.of(self.run)
        if any(fnmatch(self.run.problem, one) for one in UNTOLD):
            return Found(value, -math.inf, math.inf)
        n = len(self.without)
        if not n:
            return Found(value, value, value)
        if n == 1:
            return Found(value, -math.inf, math.inf)
        others = np.array([quantity.of(one) for one in self.without])  # type: ignore[arg-type]
        if not np.ptp(others):  # it does not depend on single draws, or all draws agree
            return Found(value, -math.inf, math.inf)
        error = np.sqrt((n - 1) * np.mean((others - others.mean()) ** 2))
        reach = float(stats.t.ppf(0.5 + CONFIDENCE / 2, n - 1) * error)
        return Found(value, value - reach, value + reach)
