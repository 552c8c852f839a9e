"""Performance of a detector on records: false alarms, missed faults, delays, ROC curves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import RealArray
from workbench.diagnosis.evaluation.residual_size import as_series
from workbench.errors import InputError
from workbench.input_checks import as_array, need_numbers, need_whole

Interval = tuple[int, int]
"""The number of the first sample, and of the one after the last."""


def intervals(flags: ArrayLike) -> list[Interval]:
    """The stretches in which a series (N,) is true.

    Examples
    --------
    >>> from workbench.diagnosis import intervals
    >>> intervals([False, True, True, False, True])
    [(1, 3), (4, 5)]
    """
    as_series("flags", flags)
    edges = np.flatnonzero(np.diff(np.asarray(flags, bool).astype(int), prepend=0, append=0))
    return [(int(start), int(end)) for start, end in edges.reshape(-1, 2)]


@dataclass(frozen=True, eq=False)
class Detection:
    """The performance of a detector on a record.

    delays            (F,) [s], from the start of each fault to its alarm; NaN if it was missed;
    false_alarms      the number of alarms that overlap no fault;
    fault_free        the time without a fault [s];
    false_alarm_share the share of the fault-free samples with an alarm.

    Examples
    --------
    >>> from workbench.diagnosis import detection
    >>> found = detection([0, 1, 0, 0, 0, 1, 1, 0], faults=[(4, 7)], dt=0.1)
    >>> found.missed, round(found.false_alarm_rate, 6)  # one in the 0.5 s without a fault
    (0.0, 2.0)
    """

    delays: RealArray
    false_alarms: int
    fault_free: float
    false_alarm_share: float

    @property
    def missed(self) -> float:
        """The share of the faults that were missed; NaN without faults."""
        return float(np.isnan(self.delays).mean()) if self.delays.size else float("nan")

    @property
    def false_alarm_rate(self) -> float:
        """False alarms per second of fault-free time; NaN without such time."""
        return self.false_alarms / self.fault_free if self.fault_free else float("nan")


def detection(
    alarm: ArrayLike, faults: Sequence[Interval], dt: float, *, tail: int = 0
) -> Detection:
    """The performance of an alarm (N,), given the faults of the record.

    faults: their stretches, in order. An alarm belongs to a fault if it falls between the start of
    the fault and `tail` samples after its end; the tail is for detectors that lag and for effects
    that last. The delay is 0 if the alarm was already raised when the fault came. period: sample
    time [s].

    Raises InputError for faults that are outside the record, empty, or overlap (tails included),
    and for a record that is empty or not finite.

    Examples
    --------
    >>> from workbench.diagnosis import detection
    >>> alarm = [0, 1, 0, 0, 0, 1, 1, 0]
    >>> found = detection(alarm, faults=[(4, 7)], dt=0.1)
    >>> found.delays.tolist(), found.false_alarms
    ([0.1], 1)
    """
    raised = as_series("alarm", alarm) != 0.0
    need_numbers(dt=dt)
    need_whole(tail, "tail")
    if not 0.0 < dt < math.inf or tail < 0:
        raise InputError(f"dt is {dt} and tail {tail}; dt must be positive, and tail 0 or more")
    end_before = 0
    pairs = as_array(faults, "faults")
    if pairs.size and (pairs.ndim != 2 or pairs.shape[1] != 2 or (pairs % 1 != 0.0).any()):
        raise InputError(f"faults are {faults!r}; give whole numbers, (first, one after the last)")
    faults = [(int(start), int(end)) for start, end in pairs.reshape(-1, 2)]
    for start, end in faults:
        if not end_before <= start < end <= len(raised):
            raise InputError(
                f"fault ({start}, {end}) in a record of {len(raised)} samples, after one that ends "
                f"at {end_before}: faults must be ordered, within it, not empty, and apart"
            )
        end_before = end + tail
    free = np.ones(len(raised), bool)
    delays = np.full(len(faults), np.nan)
    for i, (start, end) in enumerate(faults):
        free[start : end + tail] = False
        hits = np.flatnonzero(raised[start : end + tail])
        if hits.size:
            delays[i] = hits[0] * dt
    false = sum(bool(free[start:end].all()) for start, end in intervals(raised))
    share = float(raised[free].mean()) if free.any() else float("nan")
    return Detection(delays, false, float(free.sum()) * dt, share)


@dataclass(frozen=True, eq=False)
class Roc:
    """Receiver operating characteristic: detection rate over false-alarm rate as the level falls.

    levels       (K,), falling from infinity;
    false_alarm  (K,), the share of fault-free scores at or above the level, rising from 0 to 1;
    detection    (K,), the share of faulty scores at or above the level, rising from 0 to 1;
    area         under the curve: the probability that a faulty score is above a fault-free one,
                 ties counting half;
    deviation    standard error of the area (J. A. Hanley and B. J. McNeil, Radiology 143, 1982).

    Examples
    --------
    >>> from workbench.diagnosis import roc
    >>> curve = roc(clean=[0.1, 0.2], faulty=[0.5, 0.9])
    >>> curve.area, curve.detection.tolist()[-1]
    (1.0, 1.0)
    """

    levels: RealArray
    false_alarm: RealArray
    detection: RealArray
    area: float
    deviation: float


def roc(clean: ArrayLike, faulty: ArrayLike) -> Roc:
    """The ROC curve of fault-free scores (N,) and faulty ones (M,); a large score means a fault.

    Raises InputError if there are no scores, or some are not finite.

    Examples
    --------
    >>> from workbench.diagnosis import roc
    >>> round(roc(clean=[0.1, 0.2, 0.3], faulty=[0.25, 0.5, 0.9]).area, 4)  # 8 pairs of 9
    0.8889
    """
    without, given = np.sort(as_series("clean", clean)), np.sort(as_series("faulty", faulty))
    levels = np.concatenate([[np.inf], np.unique(np.concatenate([without, given]))[::-1]])
    n, m = len(without), len(given)
    false_alarm = 1.0 - np.searchsorted(without, levels, side="left") / n
    detected = 1.0 - np.searchsorted(given, levels, side="left") / m
    area = float(np.trapezoid(detected, false_alarm))
    q1, q2 = area / (2.0 - area), 2.0 * area**2 / (1.0 + area)
    square = area**2
    variance = (area * (1 - area) + (m - 1) * (q1 - square) + (n - 1) * (q2 - square)) / (n * m)
    return Roc(levels, false_alarm, detected, area, max(variance, 0.0) ** 0.5)
