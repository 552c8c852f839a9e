"""Events on a disc: where the diodes leave the linear area, and the features that tell kinds apart.

An event is a trace in the plane of d1n and d2n (figures 7.5, 7.10 of E. Vidal Sanchez, Robust and
Fault Tolerant Control of CD-players, 2003). R. van Helvoirt's clusters (section 7.1.3 there) look
at the shape of the sum signal; here the difference of the diodes is looked at beside it.
"""

from __future__ import annotations

import numpy as np

from workbench.arrays import RealArray
from workbench.diagnosis import hysteresis, intervals
from workbench.diagnosis.evaluation.performance import Interval
from workbench.simulation import play

from ..laboratory.bench_setup import PERIOD
from .defect_runs import DefectRun

FEATURES = ("log10 of duration [s]", "largest dist", "mean over largest dist", "log10 of swing")
"""Of an event; the swing is how far d1n - d2n goes from its mean, in either direction."""
APART = 35
"""Samples between two events; what is closer is one."""
LATE = 20
"""Samples after a defect in which filter and hysteresis may still show it."""


def events(dist: RealArray, dist_min: float) -> list[Interval]:
    """Where dist (N,) is above dist_min, until it is below half of it."""
    alarm = play(hysteresis(dist_min, 0.5 * dist_min), dist[:, None])[:, 0]
    joined: list[Interval] = []
    for start, end in intervals(alarm):
        if joined and start - joined[-1][1] < APART:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((start, end))
    return joined


def features(run: DefectRun, dist: RealArray, event: Interval) -> RealArray:
    """FEATURES of an event (4,)."""
    inside = slice(*event)
    difference = run.diodes[inside, 0] - run.diodes[inside, 1]
    # A step of the converter stands in for no swing at all.
    swing = max(float(abs(difference - difference.mean()).max()), 1e-3)
    largest = float(dist[inside].max())
    duration = (event[1] - event[0]) * PERIOD
    return np.array([np.log10(duration), largest, dist[inside].mean() / largest, np.log10(swing)])


def matched(found: list[Interval], faults: list[Interval]) -> list[int]:
    """Number of the event that touches each fault, -1 where none does; the first if several do."""
    numbers = []
    for start, end in faults:
        hits = [i for i, (a, b) in enumerate(found) if a < end + LATE and b > start]
        numbers.append(hits[0] if hits else -1)
    return numbers
