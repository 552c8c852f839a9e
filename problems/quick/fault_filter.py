"""Fault filters."""

from __future__ import annotations

from typing import Literal

import numpy as np

from workbench import problem
from workbench.diagnosis import FaultEstimation, Requirement
from workbench.structure import Complex
from workbench.uncertainty import GeneralisedPlant, generalised_plant

from ..mass_spring.plant import SPRING, masses

NOISE = 0.05
"""Weight of the measurement noise n: noise of size 1 adds this much to a measurement."""


@problem("quick/{plant}/fault-filter", plant=("lag", "two-masses"))
def fault_filter(plant: Literal["lag", "two-masses"]) -> FaultEstimation:
    """The filter that estimates a fault best while disturbances leak in least.

    Plant "lag": a sensor fault behind an uncertain lag. Plant "two-masses": two masses joined by a
    spring, where the fault is a force on one mass, the disturbance a force on the other, and both
    positions are measured.
    """
    import control

    if plant == "lag":
        observed, slow = _lag(), control.tf([1.0], [1.0, 0.01])
        disturbances = ["d", "n"]
        weights = control.append(control.ss(slow), control.ss([], [], [], [[NOISE]]))
        fault = control.tf([1.0, 0.1], [1.0, 2.0])
    else:
        observed, disturbances = _two_masses(), ["d", "n1", "n2"]
        slow = control.tf([0.1], [1.0, 0.1])
        weights = control.append(control.ss(slow), control.ss([], [], [], NOISE * np.eye(2)))
        fault = control.tf([1.0], [1.0, 1.0])
    wanted = [
        Requirement("disturbances", disturbances, weight=weights),
        Requirement("faults", "f", weight=fault),
    ]
    return FaultEstimation(observed, "f", requirements=wanted)


def _lag() -> GeneralisedPlant:
    """Plant 1 / (s + 0.5) with 30 % uncertainty at its input; its sensor has a fault and noise."""
    import control

    return generalised_plant(
        [
            (control.tf([1.0], [1.0, 0.5]), "v", "x"),
            (control.tf([0.3], [1.0]), "d0", "y_d"),
        ],
        {"v": "d + u_d", "d0": "d", "y": "x + f + n"},
        perturbation=[(Complex(1), "y_d", "u_d")],
        exogenous=["d", "n", "f"],
        measurement="y",
    )


def _two_masses() -> GeneralisedPlant:
    """The two masses with the nominal spring. The fault is a force on the first, the disturbance on
    the second.
    """
    import control

    A, B, _, _ = masses(SPRING.nominal)
    system = control.ss(A, B, np.eye(2, 4), np.zeros((2, 2)))
    return generalised_plant(
        [(system, ["f", "d"], ["z1", "z2"])],
        {"y1": "z1 + n1", "y2": "z2 + n2"},
        exogenous=["d", "n1", "n2", "f"],
        measurement=["y1", "y2"],
    )
