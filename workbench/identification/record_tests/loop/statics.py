"""Inputs that are exact functions of the outputs at the same sample."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench.identification.record_tests.record import RecordData

ROUNDING = 1e-6
"""Rounding of a signal, relative to its standard deviation."""
FEWEST_LEVELS = 64
"""Levels of a signal from which on their distance is the step of a converter."""
OF_A_BEND = 0.1
"""Largest misfit relative to what a move differs from the one before: less is no coincidence, while
moves that go on (ramps) or are none fit what a plant makes of them, too."""
MOST = 0.75
"""Share of the samples that must fit: elsewhere set-points change, or experiments end."""
MOST_MOVES = 20_000
"""Moves that are looked at, from the begin of a record to its end."""
PASSES = 20
"""Passes of the regression with least absolute misfit."""


def static_input(record: RecordData, channel: int) -> bool:
    """Whether moves of an input are, to rounding, combinations of moves of the outputs.

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
    least = ROUNDING * u.std()
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
    """Step of the converter that a signal came through; 0 where it has only a few levels."""
    levels = np.unique(signal)
    return float(np.diff(levels).min()) if len(levels) >= FEWEST_LEVELS else 0.0
