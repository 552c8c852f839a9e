"""Statistics of a run at each sample; with a threshold each becomes a detector of defects."""

from __future__ import annotations

import math

from workbench.diagnosis import cusum, glr
from workbench.simulation import linear_controller, play
from workbench.types import RealArray

from ..laboratory.bench_setup import PERIOD
from ..laboratory.experiment import measurements
from .defect_events import LATE
from .defect_runs import DefectRun
from .quality import diode_quality

STATISTICS = ("sum", "quality", "error", "cusum", "glr")
"""Names of the statistics."""
ERROR_CORNER = 500.0
"""Corner [Hz] of the high-pass filter that removes disc deviation and shocks from the error."""
SUM_DRIFT = 0.05
"""Drift of the cumulative sum: half of the smallest relevant loss of light."""
RATIO_WINDOW = 64
"""Window of the likelihood ratio [samples]: 2.4 mm of the track."""


def high_passed(signal: RealArray) -> RealArray:
    """A series (N,) after a high-pass filter at ERROR_CORNER."""
    import control

    corner = 2 * math.pi * ERROR_CORNER
    return play(linear_controller(control.tf([1.0, 0.0], [1.0, corner]), PERIOD), signal[:, None])[
        :, 0
    ]


def statistics_of(run: DefectRun, dist_min: float, dist_max: float) -> dict[str, RealArray]:
    """The STATISTICS of a run by name, (N,) each: large where there is a defect.

    sum      share of the light that is lost, which the binary detector compares with its level;
    quality  1 - quality of eq. 7.13: the same light, clipped and in either direction;
    error    magnitude of the high-passed normalised error;
    cusum    Page's cumulative sum of the lost light; glr: likelihood ratio of any loss, over the
             noise's variance.
    """
    lost = 1.0 - run.diodes.sum(axis=1)
    signal = play(diode_quality(run.level, dist_min, dist_max), measurements(run.record))[:, 0]
    return {
        "sum": lost,
        "quality": 1.0 - signal,
        "error": abs(high_passed(run.record.f_en)),
        "cusum": play(cusum(SUM_DRIFT), lost[:, None])[:, 0],
        "glr": play(glr(RATIO_WINDOW, 1.0), lost[:, None])[:, 0],
    }


def peaks(statistic: RealArray, windows: list[tuple[int, int]]) -> list[float]:
    """The largest value in each window, including LATE samples after its end."""
    return [float(statistic[start : end + LATE].max()) for start, end in windows]
