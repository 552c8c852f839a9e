"""Missing outputs, filled by prediction so that regressions on lagged samples have enough rows.

A row of such a regression needs every sample of its past. Isolated missing samples all over a
record leave hardly any row. Then the missing samples are predicted by a subspace model of the
record as filled before, repeatedly. Models that start from there are refined on measured samples
only.

Source: R. Shumway, D. Stoffer, "An approach to time series smoothing and forecasting using the EM
algorithm", Journal of Time Series Analysis 3(4), 1982 (the alternation).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench._core.arrays import RealArray
from workbench.identification.experiments.several import Experiments
from workbench.identification.state_space.selection import order_fits
from workbench.identification.state_space.subspace import SubspaceModels

COMPLETE_SHARE = 0.5
"""Share of complete windows from which the measured rows are sufficient."""
WINDOW = 15
"""Length of such a window [samples]."""
STATES, PAST = 8, 10
"""Most states of the models that predict missing samples, and the usual length of their past
[samples].
"""
ROUNDS = 20
"""Number of times that missing samples are predicted again."""
WASHOUT = 50
"""Number of samples from which the initial state of a prediction is estimated."""


def bridged(record: Experiments, direct: bool = True, past: int = PAST) -> Experiments:
    """The experiments, with missing outputs predicted if too few windows are complete.

    The round whose model predicts the measured samples best is kept. The models use ``past``
    samples of the past, which must exceed the delays of the inputs.
    """
    if not record.missing or _complete_share(record) >= COMPLETE_SHARE:
        return record
    nu, ny = record.u.shape[1], record.y.shape[1]
    sizes = [n for n in range(STATES, 0, -1) if order_fits(n, past, len(record), nu, ny)]
    filled = best = replace(record, y=_interpolated(record))
    if not sizes:
        return best
    known, least = np.isfinite(record.y), np.inf
    spread = np.nanstd(record.y, axis=0)
    for _ in range(ROUNDS):
        model = SubspaceModels(filled, (past,), direct).model(sizes[0], past)
        with np.errstate(all="ignore"):  # a poor model's prediction may overflow
            made = np.vstack([model.one_step(u, y, WASHOUT) for u, y in record.pieces()])
            errors = np.where(known, (made - record.y) / spread, 0.0)
            size = float(np.sum(errors**2))
        if not np.isfinite(made).all():
            break
        filled = replace(record, y=np.where(known, record.y, made))
        if size < least:
            best, least = filled, size
    return best


def _complete_share(record: Experiments) -> float:
    """Share of windows in the experiments without a missing output."""
    whole = total = 0
    for _, y in record.pieces():
        count = len(y) - WINDOW + 1
        if count > 0:
            missing = np.concatenate([[0], np.cumsum(np.isnan(y).any(axis=1))])
            whole += int(np.sum(missing[WINDOW:] == missing[:-WINDOW]))
            total += count
    return whole / max(total, 1)


def _interpolated(record: Experiments) -> RealArray:
    """Outputs (N, ny) with gaps interpolated linearly; 0 if nothing was measured."""
    found = []
    for _, y in record.pieces():
        at, columns = np.arange(len(y)), []
        for column in y.T:
            known = np.isfinite(column)
            line = np.interp(at, at[known], column[known]) if known.any() else np.zeros(len(y))
            columns.append(line)
        found.append(np.column_stack(columns))
    return np.vstack(found)
