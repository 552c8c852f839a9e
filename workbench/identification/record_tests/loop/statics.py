"""Inputs that are exact functions of the outputs at the same sample."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench.identification.record_tests.record import RecordData

SIGNAL_ROUNDING = 1e-6
"""Rounding error of a signal, relative to its standard deviation."""
FEWEST_LEVELS = 64
"""With at least this many levels, the distance between the levels of a signal is the step of a
converter.
"""
OF_A_BEND = 0.1
"""Largest misfit, relative to the difference between a move and the one before. A smaller misfit is
no coincidence. Constant or absent moves (ramps) are excluded so, since they fit the plant's
response too.
"""
MOST = 0.75
"""Share of the samples that must fit: at others set-points change, or experiments end."""
MOST_MOVES = 20_000
"""Most moves that are examined, over the whole record."""
PASSES = 20
"""Number of passes of the regression with least absolute misfit."""


def static_input(record: RecordData, channel: int) -> bool:
    """Whether moves of an input are combinations of moves of the outputs, up to rounding.

    Between changes of a set-point r, u = K (r - y) moves as -K y does.
    """
    there = ~np.isnan(record.y).any(axis=1)
    u, y = record.u[there, channel], record.y[there]
    if len(u) <= 4 * (y.shape[1] + 1):
        return False
    scale = y.std(axis=0) + np.finfo(float).tiny
    some = slice(None, None, len(u) // MOST_MOVES + 1)
    moves, columns = np.diff(u)[1:][some], (np.diff(y, axis=0) / scale)[1:][some]
    bends = np.abs(np.diff(u, 2))[some]
    least = SIGNAL_ROUNDING * u.std()
    weight = np.ones(len(moves))
    for _ in range(PASSES):
        gains = np.linalg.lstsq(columns * weight[:, None], moves * weight, rcond=None)[0]
        misfit = np.abs(moves - columns @ gains)
        weight = 1.0 / np.sqrt(np.maximum(misfit, least))
    outputs = zip(gains / scale, y.T, strict=True)
    steps = (abs(gain) * _step(channel[some]) for gain, channel in outputs)
    rounding = least + _step(u[some]) + sum(steps)
    fits = misfit <= rounding
    return bool(np.mean(fits) >= MOST and rounding <= OF_A_BEND * np.median(bends[fits]))


def _step(signal: RealArray) -> float:
    """Step of a signal's converter; 0 if the signal has only a few levels."""
    levels = np.unique(signal)
    return float(np.diff(levels).min()) if len(levels) >= FEWEST_LEVELS else 0.0
