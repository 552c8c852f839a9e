"""Parts of a record for estimation, validation and judgement, and the scoring of models."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from workbench._core.arrays import RealArray
from workbench.identification.experiments.several import Experiments
from workbench.identification.state_space.validation import nrmse_fit

VALIDATION_SHARE = 1 / 3
"""Share of the estimation part on which an order is validated: once its end, once its start.

So in both folds the rest is one unbroken record for estimation.
"""

Run = Callable[[RealArray, RealArray, int], RealArray]
"""Method of a model that predicts y (N, ny) of a record u, y after a washout."""


def validation_folds(record: Experiments) -> list[tuple[Experiments, Experiments]]:
    """Pairs of a part for estimation and a part for validation.

    A fold is dropped if an input that moves elsewhere is constant in its estimation part, which
    then says nothing about it, or if all inputs are constant in its validation part, which then
    says nothing about a plant. A record with a single step has no folds.
    """
    cut = round(len(record) * VALIDATION_SHARE)
    parts = (
        (record.part(0, len(record) - cut), record.part(len(record) - cut, len(record))),
        (record.part(cut, len(record)), record.part(0, cut)),
    )
    still = len(record.still_inputs())
    return [
        (used, left)
        for used, left in parts
        if len(used.still_inputs()) == still
        and len(left.still_inputs()) < record.u.shape[1]
        and _alive(used) and _alive(left)
    ]  # fmt: skip


def _alive(record: Experiments) -> bool:
    """Whether every output changes, as far as it was measured."""
    known = [column[np.isfinite(column)] for column in record.y.T]
    return all(len(values) > 1 and np.ptp(values) > 0 for values in known)


def scored_fit(run: Run, record: Experiments, washout: int) -> RealArray:
    """Fit [%] of each output (ny,) over experiments, without the washout of each.

    Experiments not longer than their washout do not count.
    """
    measured, modelled = scored_samples(run, record, washout)
    return nrmse_fit(measured, modelled)


def scored_samples(run: Run, record: Experiments, washout: int) -> tuple[RealArray, RealArray]:
    """Measured and modelled outputs of experiments, without the washout of each."""
    pairs = [
        (y[washout:], run(u, y, washout)[washout:]) for u, y in record.pieces() if len(u) > washout
    ]
    return _stacked(measured for measured, _ in pairs), _stacked(made for _, made in pairs)


def _stacked(parts: Iterable[RealArray]) -> RealArray:
    return np.vstack(list(parts))


def final_prediction_factor(parameters: int, samples: int) -> float:
    """Akaike's ratio of the expected errors on a new record to those on the fitted one.

    Source: L. Ljung, System Identification, 2nd ed., 1999, section 16.4.
    """
    share = min(parameters / max(samples, 1), 0.9)
    return float(np.sqrt((1 + share) / (1 - share)))
