"""Diagnosis: faults modelled, told apart by residuals, estimated and judged."""

from workbench.diagnosis.detectability import (
    Detectability,
    attainable_structures,
    detectability,
    isolability,
    masking,
    unattainable,
)
from workbench.diagnosis.exact import fault_detection, fault_isolation
from workbench.diagnosis.fault_model import FaultModel
from workbench.diagnosis.generators import ResidualGenerator, structure_matrix, transfer
from workbench.diagnosis.matching import (
    ModelMatch,
    matching_bound,
    model_matching,
    null_space_generator,
)
from workbench.diagnosis.parameter_faults import multiplicative_lft
from workbench.diagnosis.parity_space import ParityRelation, parity_relation
from workbench.diagnosis.performance_index import PerformanceIndex, performance_index
from workbench.diagnosis.whitening import WhitenedResidual, whitened_residual

__all__ = [
    "Detectability",
    "FaultModel",
    "ModelMatch",
    "ParityRelation",
    "PerformanceIndex",
    "ResidualGenerator",
    "WhitenedResidual",
    "attainable_structures",
    "detectability",
    "fault_detection",
    "fault_isolation",
    "isolability",
    "masking",
    "matching_bound",
    "model_matching",
    "multiplicative_lft",
    "null_space_generator",
    "parity_relation",
    "performance_index",
    "structure_matrix",
    "transfer",
    "unattainable",
    "whitened_residual",
]
