"""Rows for the test of feedback: the past of inputs and outputs, and the outputs' new part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import BoolArray, RealArray
from workbench.identification.record_tests.loop.lags import growing, last_known, past, stretches
from workbench.identification.record_tests.record import RecordData

FEWEST_SAMPLES = 200
"""Fewest samples of a record that is tested; experiments shorter than a quarter of it
are not used.
"""
LONGEST_LAG = 4096
"""Longest lag [samples]."""
OF_A_PIECE = 8
"""Lags are at most this fraction of the shortest piece, since nothing is known before its first
sample.
"""
SINGLE_LAGS, SINGLE_LAGS_OF_Y = 32, 8
"""Number of single lags of all signals when predicting from their own past, and of y when
predicting u.
"""
SAMPLES_OF_A_LAG = 15
"""Fewest samples for each single lag and channel."""
ROWS_OF_A_COLUMN = 5
"""Fewest rows for each column of the inputs' past: with fewer, chance fits too much."""
VARIANCE_ROUNDING = 1e-10
"""Share of a signal's variance that counts as rounding."""


@dataclass(frozen=True, eq=False)
class Memory:
    """Rows of signals with their past.

    Parameters
    ----------
    u
        Inputs (N, nu).
    past_u
        Their past (N, p).
    noise
        Variance that white noise with u's own variance would cause in each column of `past_u`.
    past_y
        Past of the outputs (N, q), from `first_lag` on.
    new
        New part of the outputs (N, ny): what their past, the past of u, and u itself if it may act
        at once, do not predict; 0 for a missing sample.
    first_lag, longest_lag
        Shortest and longest lag [samples] of the outputs.
    """

    u: RealArray
    past_u: RealArray
    noise: RealArray
    past_y: RealArray
    new: RealArray
    first_lag: int
    longest_lag: int


def memory(record: RecordData) -> Memory | None:
    """The memory of a record; None if it is too short."""
    pieces = [p for p in stretches(record) if _is_long_enough(record.y[p])]
    total = sum(piece.stop - piece.start for piece in pieces)
    if total < FEWEST_SAMPLES:
        return None
    channels = record.u.shape[1] + record.y.shape[1]
    longest = min(min(p.stop - p.start for p in pieces) // OF_A_PIECE, LONGEST_LAG)
    lags = growing(min(SINGLE_LAGS, total // (SAMPLES_OF_A_LAG * channels)), longest)
    few = growing(SINGLE_LAGS_OF_Y, longest)
    rows = []
    for piece in pieces:
        y, missing = last_known(record.y[piece])
        u, y = record.u[piece] - record.u[piece].mean(axis=0), y - y.mean(axis=0)
        now = [] if record.direct else [y]
        columns = u, past(u, lags), np.hstack([*now, past(y, few)]), y, past(y, lags), missing
        rows.append([column[int(lags[-1]) - 1 :] for column in columns])
    u, past_u, past_y, y, own, missing = (
        np.concatenate(parts) for parts in zip(*rows, strict=True)
    )
    if len(u) < ROWS_OF_A_COLUMN * past_u.shape[1]:
        return None
    noise = np.repeat(1 / np.diff(lags), u.shape[1]) * np.tile(u.var(axis=0), len(lags) - 1)
    at_once = [u] if record.direct else []
    new = _regression_residual(
        y, np.hstack([past_u, own, *at_once]), np.logical_not(missing.any(axis=1))
    )
    return Memory(u, past_u, noise, past_y, new, int(record.direct), longest)


def _is_long_enough(y: RealArray) -> bool:
    """Whether the outputs of a piece are long enough, with at least one sample of each."""
    return 4 * len(y) >= FEWEST_SAMPLES and not np.isnan(y).all(axis=0).any()


def _regression_residual(y: RealArray, told: RealArray, there: BoolArray) -> RealArray:
    """Residual of y (N, ny) in a regression on the known signals, on the available rows."""
    scale = np.sqrt(np.mean(told**2, axis=0)) + np.finfo(float).tiny
    columns = told[there] / scale
    gram = columns.T @ columns + VARIANCE_ROUNDING * len(columns) * np.eye(columns.shape[1])
    left = np.zeros_like(y)
    left[there] = y[there] - columns @ np.linalg.solve(gram, columns.T @ y[there])
    return left
