"""What may be compared with a threshold to find a defect: statistics of a run, sample by sample."""

from __future__ import annotations

import math

from workbench.arrays import RealArray
from workbench.diagnosis import cusum, glr
from workbench.diagnosis.evaluation.performance import Interval
from workbench.simulation import linear, play

from ..laboratory.bench_setup import PERIOD
from ..laboratory.experiment import measurements
from .defect_events import LATE
from .defect_runs import DefectRun
from .quality import diode_quality

STATISTICS = ("sum", "quality", "error", "cusum", "glr")
CORNER = 500.0
"""Of the high-pass [Hz] that takes disc deviation and shocks out of the error."""
DRIFT = 0.05
"""Of the cumulative sum: half of the smallest share of light lost that is of interest."""
MEMORY = 64
"""Window of the likelihood ratio [samples]: 2.4 mm of the track."""


def high_passed(signal: RealArray) -> RealArray:
    """A series (N,) without what is below CORNER."""
    import control

    corner = 2 * math.pi * CORNER
    return play(linear(control.tf([1.0, 0.0], [1.0, corner]), PERIOD), signal[:, None])[:, 0]


def statistics_of(run: DefectRun, dist_min: float, dist_max: float) -> dict[str, RealArray]:
    """Each of STATISTICS over a run (N,), large when there is a defect.

    sum      share of the light that is lost: what the binary detector compares with its level;
    quality  1 - quality of eq. 7.13: the same light, clipped and in either direction;
    error    the normalised error, high-passed, its size;
    cusum    Page's sum of the lost light; glr: likelihood ratio of any loss, in units of the
             noise's variance.
    """
    lost = 1.0 - run.diodes.sum(axis=1)
    signal = play(diode_quality(run.level, dist_min, dist_max), measurements(run.record))[:, 0]
    return {
        "sum": lost,
        "quality": 1.0 - signal,
        "error": abs(high_passed(run.record.f_en)),
        "cusum": play(cusum(DRIFT), lost[:, None])[:, 0],
        "glr": play(glr(MEMORY, 1.0), lost[:, None])[:, 0],
    }


def peaks(statistic: RealArray, windows: list[Interval]) -> list[float]:
    """The largest value in each window, LATE samples behind its end included."""
    return [float(statistic[start : end + LATE].max()) for start, end in windows]
