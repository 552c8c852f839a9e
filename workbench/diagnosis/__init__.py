"""Fault diagnosis: what a residual says of a fault, how soon, how surely, and of which one."""

from workbench.diagnosis.changes import cusum, cusum_threshold, glr, hysteresis
from workbench.diagnosis.clusters import UNKNOWN, Clusters, confusion
from workbench.diagnosis.evaluation import moving_rms
from workbench.diagnosis.performance import Detection, Roc, detection, intervals, roc
from workbench.diagnosis.signatures import AMBIGUOUS, NO_FAULT, isolable, isolate
from workbench.diagnosis.thresholds import (
    Threshold,
    above_noise,
    adaptive_alarm,
    bounded_threshold,
    quantile_threshold,
)

__all__ = [
    "AMBIGUOUS",
    "NO_FAULT",
    "UNKNOWN",
    "Clusters",
    "Detection",
    "Roc",
    "Threshold",
    "above_noise",
    "adaptive_alarm",
    "bounded_threshold",
    "confusion",
    "cusum",
    "cusum_threshold",
    "detection",
    "glr",
    "hysteresis",
    "intervals",
    "isolable",
    "isolate",
    "moving_rms",
    "quantile_threshold",
    "roc",
]
