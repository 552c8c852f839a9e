"""Past samples of signals: single lags first, then means over groups that double in length."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from workbench._core.arrays import BoolArray, IntegerArray, RealArray
from workbench.identification.record_tests.record import RecordData

MOST_NUMBERS = 120_000
"""Most numbers of a record that are used; from a longer one stretches from beginning to end are
taken.
"""
STRETCHES = 8
"""Number of stretches of a longer experiment."""


def growing(single: int, longest: int) -> IntegerArray:
    """First lag of each group, and one past the last: `single` lags, then groups of 2, 4, 8, ..."""
    firsts, width = list(range(1, min(single, longest) + 2)), 2
    while firsts[-1] + width - 1 <= longest:
        firsts.append(firsts[-1] + width)
        width *= 2
    return np.array(firsts)


def past(signal: RealArray, firsts: IntegerArray) -> RealArray:
    """Means of a signal (N, channels) over each group of lags (N, groups * channels).

    Before its first sample a signal is assumed to have the value of that sample.
    """
    longest = int(firsts[-1]) - 1
    before = np.concatenate([np.repeat(signal[:1], longest, axis=0), signal])
    sums = np.concatenate([np.zeros((1, signal.shape[1])), np.cumsum(before, axis=0)])
    # The sum over lags a to b - 1 of sample k is that of the samples k - b + 1 to k - a.
    ends = sums[np.arange(len(signal))[:, None] + longest + 1 - firsts]
    return ((ends[:, :-1] - ends[:, 1:]) / np.diff(firsts)[:, None]).reshape(len(signal), -1)


def last_known(signal: RealArray) -> tuple[RealArray, BoolArray]:
    """A signal (N, channels) with missing samples replaced by the last value; and their mask.

    Only earlier samples replace a missing one, so that no sample is known before its time.
    """
    missing = np.isnan(signal)
    first = np.argmin(missing, axis=0)
    at = np.where(missing, first, np.arange(len(signal))[:, None])
    at = np.maximum.accumulate(np.maximum(at, first), axis=0)
    return np.take_along_axis(signal, at, axis=0), missing


def stretches(record: RecordData) -> Sequence[slice]:
    """Samples of each experiment; from a long one, stretches from beginning to end."""
    pieces = list(record.pieces())
    share = MOST_NUMBERS / (record.u.size + record.y.size)
    if share >= 1.0:
        return pieces
    parts = []
    for piece in pieces:
        ends = np.linspace(piece.start, piece.stop, STRETCHES + 1).astype(int)
        parts += [slice(int(a), int(a + share * (b - a))) for a, b in pairwise(ends)]
    return parts
