"""Times of several calls made in turn, so that a busy moment of the computer affects them all."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from workbench.types import RealArray


def interleaved(
    calls: Sequence[Callable[[], Any]],
    rounds: int,
    clock: Callable[[], float] = time.perf_counter,
) -> RealArray:
    """Times [s] (rounds, calls) of calls made in turn, by the given clock."""
    times = np.empty((rounds, len(calls)))
    for row in times:
        for place, call in enumerate(calls):
            start = clock()
            call()
            row[place] = clock() - start
    return times
