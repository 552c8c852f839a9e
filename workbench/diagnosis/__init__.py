"""Faults: models of them, detection, isolation, estimation, and signals that replace faulty ones.

Takes: plants with faults and disturbances, requirements, records of residuals.
Gives: residual generators, fault filters for every plant of a set, thresholds, estimators.
Rests on: null spaces of rational matrices (exact decoupling), H-infinity and mu for filters, and
    the laws of CUSUM and likelihood-ratio tests.
"""

from typing import TYPE_CHECKING

from workbench._core.on_demand import on_demand

if TYPE_CHECKING:
    from workbench.diagnosis.estimation.fault_loop import EstimationDemands, FaultLoop
    from workbench.diagnosis.estimation.front import FaultFront, FrontPoint
    from workbench.diagnosis.estimation.front_bound import least_total_error
    from workbench.diagnosis.estimation.front_filters import (
        FrontFilter,
        full_order_filter,
        low_order_filter,
    )
    from workbench.diagnosis.estimation.laguerre import LaguerreBasis
    from workbench.diagnosis.estimation.program import FaultEstimation, FaultFilter
    from workbench.diagnosis.estimation.reached import DemandReached, best_design
    from workbench.diagnosis.estimation.weighting import Requirement
    from workbench.diagnosis.estimators.disturbed import DisturbedPlant
    from workbench.diagnosis.estimators.estimator import (
        Estimate,
        Estimator,
        estimate,
        placed_estimator,
    )
    from workbench.diagnosis.estimators.kalman import KalmanEstimator, Noise
    from workbench.diagnosis.estimators.observers import observer_gain
    from workbench.diagnosis.estimators.prototypes import prototype_poles
    from workbench.diagnosis.estimators.rotation import Rotation
    from workbench.diagnosis.evaluation.changes import cusum, cusum_threshold, glr, hysteresis
    from workbench.diagnosis.evaluation.clusters import UNKNOWN, Clusters, confusion_matrix
    from workbench.diagnosis.evaluation.events import events, matched_events
    from workbench.diagnosis.evaluation.performance import Detection, Roc, detection, intervals, roc
    from workbench.diagnosis.evaluation.quality import clean_level, drop_detector, quality_signal
    from workbench.diagnosis.evaluation.residual_size import moving_rms
    from workbench.diagnosis.evaluation.signatures import AMBIGUOUS, NO_FAULT, isolable, isolate
    from workbench.diagnosis.evaluation.thresholds import (
        Threshold,
        adaptive_alarm,
        bounded_threshold,
        quantile_threshold,
    )
    from workbench.diagnosis.generators.exact import fault_detection, fault_isolation
    from workbench.diagnosis.generators.generator import (
        ResidualGenerator,
        residual_response,
        structure_matrix,
    )
    from workbench.diagnosis.generators.matching import (
        ModelMatch,
        matching_bound,
        model_matching,
        null_space_generator,
    )
    from workbench.diagnosis.generators.parity_space import ParityRelation, parity_relation
    from workbench.diagnosis.generators.performance_index import (
        PerformanceIndex,
        index_checker,
        performance_index,
    )
    from workbench.diagnosis.generators.whitening import WhitenedResidual, whitened_residual
    from workbench.diagnosis.models.detectability import (
        Detectability,
        attainable_structures,
        detectability,
        isolability,
        masking_inputs,
        unattainable_faults,
    )
    from workbench.diagnosis.models.fault_model import FaultModel
    from workbench.diagnosis.models.parameter_faults import multiplicative_lft
else:
    __getattr__, __dir__ = on_demand(__name__)

__all__ = [
    "AMBIGUOUS",
    "NO_FAULT",
    "UNKNOWN",
    "Clusters",
    "DemandReached",
    "Detectability",
    "Detection",
    "DisturbedPlant",
    "Estimate",
    "EstimationDemands",
    "Estimator",
    "FaultEstimation",
    "FaultFilter",
    "FaultFront",
    "FaultLoop",
    "FaultModel",
    "FrontFilter",
    "FrontPoint",
    "KalmanEstimator",
    "LaguerreBasis",
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
    "adaptive_alarm",
    "attainable_structures",
    "best_design",
    "bounded_threshold",
    "clean_level",
    "confusion_matrix",
    "cusum",
    "cusum_threshold",
    "detectability",
    "detection",
    "drop_detector",
    "estimate",
    "events",
    "fault_detection",
    "fault_isolation",
    "full_order_filter",
    "glr",
    "hysteresis",
    "index_checker",
    "intervals",
    "isolability",
    "isolable",
    "isolate",
    "least_total_error",
    "low_order_filter",
    "masking_inputs",
    "matched_events",
    "matching_bound",
    "model_matching",
    "moving_rms",
    "multiplicative_lft",
    "null_space_generator",
    "observer_gain",
    "parity_relation",
    "performance_index",
    "placed_estimator",
    "prototype_poles",
    "quality_signal",
    "quantile_threshold",
    "residual_response",
    "roc",
    "structure_matrix",
    "unattainable_faults",
    "whitened_residual",
]
