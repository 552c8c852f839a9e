"""The answer of a rational model fit, and the storage of its models as labelled arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.heavy_types import Dataset, StateSpace
from workbench.answer import ProgramAnswer
from workbench.fitting.rational import Rational
from workbench.identification.rational_models.model import CommonPoleModel


@dataclass(frozen=True, eq=False, repr=False)
class RationalModels(ProgramAnswer):
    """Fitted models of rising order, and the index of the chosen one.

    Unlike a `StateSpace`, it holds the models of all orders that were tried.

    Examples
    --------
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.identification import RationalModelFit
    >>> rng, omega = np.random.default_rng(0), np.geomspace(0.2, 30, 60)
    >>> noise = 1e-3 * rng.standard_normal((60, 2)) @ [1, 1j]
    >>> program = RationalModelFit(
    ...     omega, 3 / (1j * omega + 2) + noise, np.full((60, 1, 1), 2e-6), orders=[1, 2], excess=1
    ... )
    >>> answer = wb.solve(program).answer
    >>> [model.order for model in answer.models], answer.chosen
    ([1, 2], 0)
    """

    models: tuple[CommonPoleModel, ...]
    chosen: int

    @property
    def model(self) -> CommonPoleModel:
        """The chosen model."""
        return self.models[self.chosen]

    @property
    def lti(self) -> StateSpace:
        """A realisation of the chosen model without its delays."""
        return self.model.lti


def stored_model(model: CommonPoleModel) -> dict[str, Any]:
    """Variables of a model of some order; missing zeros are NaN."""
    n = model.order
    p, m = model.shape
    zeros = np.full((p, m, n), np.nan + 0j)
    gains = np.empty((p, m))
    for i, j in np.ndindex(p, m):
        entry = model.entries[i][j]
        zeros[i, j, : entry.zeros.size] = entry.zeros
        gains[i, j] = entry.gain
    unit = {"units": "rad/s" if model.dt is None else "1"}
    return {
        f"poles_{n}": (f"pole_{n}", model.poles, unit),
        f"zeros_{n}": (("output", "input", f"pole_{n}"), zeros, unit),
        f"gain_{n}": (
            ("output", "input"),
            gains,
            about_response("factor of the products of x - root"),
        ),
        f"delay_{n}": (("output", "input"), np.array(model.delay), {"units": "s"}),
    }


def restored_model(data: Dataset, order: int, sample_time: float | None) -> CommonPoleModel:
    """A model from its variables."""
    poles, zeros = data[f"poles_{order}"].values, data[f"zeros_{order}"].values
    gains, delay = data[f"gain_{order}"].values, data[f"delay_{order}"].values
    entries = [
        [Rational(z[~np.isnan(z)], poles, float(k)) for z, k in zip(row, gain, strict=True)]
        for row, gain in zip(zeros, gains, strict=True)
    ]
    return CommonPoleModel(entries, delay, dt=sample_time)


def about_response(long_name: str) -> dict[str, str]:
    """Attributes of an array in the unit of the response."""
    return {"units": "1", "long_name": long_name}
