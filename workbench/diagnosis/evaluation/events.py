"""Events: stretches in which a signal is large, and the fault that each event belongs to."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from workbench.diagnosis.evaluation.changes import hysteresis
from workbench.diagnosis.evaluation.performance import Interval, intervals
from workbench.diagnosis.evaluation.residual_size import as_series
from workbench.errors import InputError
from workbench.input_checks import need_whole
from workbench.simulation import play


def events(signal: ArrayLike, on: float, off: float, *, apart: int = 1) -> list[Interval]:
    """Events of a signal (N,): from where it rises above `on` until it is below `off`.

    apart: events with fewer samples than this between them are joined into one. Returns first
    sample and one after the last of each. Raises InputError for a signal that is empty or not
    finite, and unless off <= on and apart >= 0.

    Examples
    --------
    >>> from workbench.diagnosis import events
    >>> events([0, 3, 1.5, 0, 3, 0], on=2.0, off=1.0)
    [(1, 3), (4, 5)]
    """
    values = as_series("signal", signal)
    _check_count("apart", apart)
    alarm = play(hysteresis(on, off), values[:, None])[:, 0]
    joined: list[Interval] = []
    for start, end in intervals(alarm):
        if joined and start - joined[-1][1] < apart:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((start, end))
    return joined


def matched_events(
    found: Sequence[Interval], faults: Sequence[Interval], *, tail: int = 0
) -> list[int]:
    """Number of the first event that overlaps each fault (F,); -1 if there is none.

    tail: number of samples after a fault's end in which an event still belongs to it. Raises
    InputError for a negative tail.

    Examples
    --------
    >>> from workbench.diagnosis import matched_events
    >>> matched_events([(2, 4), (9, 12)], faults=[(10, 11), (20, 22)])
    [1, -1]
    """
    _check_count("tail", tail)
    numbers = []
    for start, end in faults:
        hits = [i for i, (a, b) in enumerate(found) if a < end + tail and b > start]
        numbers.append(hits[0] if hits else -1)
    return numbers


def _check_count(name: str, samples: int) -> None:
    need_whole(samples, name)
    if samples < 0:
        raise InputError(f"{name} is {samples} samples; it must be 0 or more")
