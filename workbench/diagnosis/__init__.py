"""Fault diagnosis: filters that estimate faults, robustly and certified."""

from workbench.diagnosis import estimation_basis, estimation_methods
from workbench.diagnosis.estimation import FaultEstimation, FaultFilter
from workbench.diagnosis.weighting import Requirement

__all__ = [
    "FaultEstimation",
    "FaultFilter",
    "Requirement",
    "estimation_basis",
    "estimation_methods",
]
