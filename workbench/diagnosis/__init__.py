"""Diagnosis: faults detected and estimated, and what to put in a faulty measurement's place."""

from workbench.diagnosis import estimation_basis, estimation_methods
from workbench.diagnosis.disturbed import DisturbedPlant
from workbench.diagnosis.estimation import FaultEstimation, FaultFilter
from workbench.diagnosis.estimator import Estimate, Estimator, estimate, placed
from workbench.diagnosis.kalman import KalmanEstimator, Noise
from workbench.diagnosis.observers import observer_gain
from workbench.diagnosis.prototypes import prototype_poles
from workbench.diagnosis.rotation import Rotation
from workbench.diagnosis.weighting import Requirement

__all__ = [
    "DisturbedPlant",
    "Estimate",
    "Estimator",
    "FaultEstimation",
    "FaultFilter",
    "KalmanEstimator",
    "Noise",
    "Requirement",
    "Rotation",
    "estimate",
    "estimation_basis",
    "estimation_methods",
    "observer_gain",
    "placed",
    "prototype_poles",
]
