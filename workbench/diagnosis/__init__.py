"""Diagnosis of faulty measurements: what to believe of them, and what to put in their place."""

from workbench.diagnosis.disturbed import DisturbedPlant
from workbench.diagnosis.estimator import Estimate, Estimator, estimate, placed
from workbench.diagnosis.kalman import KalmanEstimator, Noise
from workbench.diagnosis.observers import observer_gain
from workbench.diagnosis.prototypes import prototype_poles
from workbench.diagnosis.rotation import Rotation

__all__ = [
    "DisturbedPlant",
    "Estimate",
    "Estimator",
    "KalmanEstimator",
    "Noise",
    "Rotation",
    "estimate",
    "observer_gain",
    "placed",
    "prototype_poles",
]
