"""Diagnosis: faults modelled, detected, told apart, estimated, and what to put in their place."""

from workbench.diagnosis import estimation_basis, estimation_methods
from workbench.diagnosis.changes import cusum, cusum_threshold, glr, hysteresis
from workbench.diagnosis.clusters import UNKNOWN, Clusters, confusion
from workbench.diagnosis.detectability import (
    Detectability,
    attainable_structures,
    detectability,
    isolability,
    masking,
    unattainable,
)
from workbench.diagnosis.disturbed import DisturbedPlant
from workbench.diagnosis.estimation import FaultEstimation, FaultFilter
from workbench.diagnosis.estimator import Estimate, Estimator, estimate, placed
from workbench.diagnosis.evaluation import moving_rms
from workbench.diagnosis.exact import fault_detection, fault_isolation
from workbench.diagnosis.fault_model import FaultModel
from workbench.diagnosis.generators import ResidualGenerator, structure_matrix, transfer
from workbench.diagnosis.kalman import KalmanEstimator, Noise
from workbench.diagnosis.matching import (
    ModelMatch,
    matching_bound,
    model_matching,
    null_space_generator,
)
from workbench.diagnosis.observers import observer_gain
from workbench.diagnosis.parameter_faults import multiplicative_lft
from workbench.diagnosis.parity_space import ParityRelation, parity_relation
from workbench.diagnosis.performance import Detection, Roc, detection, intervals, roc
from workbench.diagnosis.performance_index import PerformanceIndex, performance_index
from workbench.diagnosis.prototypes import prototype_poles
from workbench.diagnosis.rotation import Rotation
from workbench.diagnosis.signatures import AMBIGUOUS, NO_FAULT, isolable, isolate
from workbench.diagnosis.thresholds import (
    Threshold,
    above_noise,
    adaptive_alarm,
    bounded_threshold,
    quantile_threshold,
)
from workbench.diagnosis.weighting import Requirement
from workbench.diagnosis.whitening import WhitenedResidual, whitened_residual

__all__ = [
    "AMBIGUOUS",
    "NO_FAULT",
    "UNKNOWN",
    "Clusters",
    "Detectability",
    "Detection",
    "DisturbedPlant",
    "Estimate",
    "Estimator",
    "FaultEstimation",
    "FaultFilter",
    "FaultModel",
    "KalmanEstimator",
    "ModelMatch",
    "Noise",
    "ParityRelation",
    "PerformanceIndex",
    "Requirement",
    "ResidualGenerator",
    "Roc",
    "Rotation",
    "Threshold",
    "WhitenedResidual",
    "above_noise",
    "adaptive_alarm",
    "attainable_structures",
    "bounded_threshold",
    "confusion",
    "cusum",
    "cusum_threshold",
    "detectability",
    "detection",
    "estimate",
    "estimation_basis",
    "estimation_methods",
    "fault_detection",
    "fault_isolation",
    "glr",
    "hysteresis",
    "intervals",
    "isolability",
    "isolable",
    "isolate",
    "masking",
    "matching_bound",
    "model_matching",
    "moving_rms",
    "multiplicative_lft",
    "null_space_generator",
    "observer_gain",
    "parity_relation",
    "performance_index",
    "placed",
    "prototype_poles",
    "quantile_threshold",
    "roc",
    "structure_matrix",
    "transfer",
    "unattainable",
    "whitened_residual",
]
