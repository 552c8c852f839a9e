"""Events on a disc, where the diodes leave the linear area, and the features that distinguish
kinds.

An event is a trace in the plane of d1n and d2n (figures 7.5, 7.10 of E. Vidal Sanchez, Robust and
Fault Tolerant Control of CD-players, 2003). R. van Helvoirt's clusters (section 7.1.3 there) use
the shape of the sum signal; here the difference of the diodes is used, too.
"""

from __future__ import annotations

import numpy as np

from workbench.diagnosis import events
from workbench.types import RealArray

from ..laboratory.bench_setup import PERIOD
from .defect_runs import DefectRun

FEATURES = ("log10 of duration [s]", "largest dist", "mean over largest dist", "log10 of swing")
"""Features of an event. The swing is the largest distance of d1n - d2n from its mean, in either
direction.
"""
APART = 35
"""Least number of samples between two events; closer events are joined into one."""
LATE = 20
"""Number of samples after the end of a defect in which filter and hysteresis may still show it."""


def defect_events(dist: RealArray, dist_min: float) -> list[tuple[int, int]]:
    """Events: each begins where dist (N,) rises above dist_min and ends where it is below half of
    that.
    """
    return events(dist, dist_min, 0.5 * dist_min, apart=APART)


def features(run: DefectRun, dist: RealArray, event: tuple[int, int]) -> RealArray:
    """The FEATURES (4,) of an event."""
    inside = slice(*event)
    difference = run.diodes[inside, 0] - run.diodes[inside, 1]
    # One converter step replaces a swing of zero.
    swing = max(float(abs(difference - difference.mean()).max()), 1e-3)
    largest = float(dist[inside].max())
    duration = (event[1] - event[0]) * PERIOD
    return np.array([np.log10(duration), largest, dist[inside].mean() / largest, np.log10(swing)])
