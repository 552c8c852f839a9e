"""The plants of bench/synthesis: random ones, and those of the CD drive in SI units."""

from __future__ import annotations

import math

import numpy as np

from workbench.synthesis import regularise
from workbench.uncertainty import GeneralisedPlant

from ..cd_drive.control.control_problem import generalised
from ..cd_drive.drive.tables import Axis
from ..cd_drive.uncertainty.parametric_model import parametric_plant

REGULARISATION = 1e-4
"""Relative size of the signals that `regularise` adds to the CD drive's plants."""


def random_plant(rng: np.random.Generator, states: int) -> GeneralisedPlant:
    """A random stable plant with two controls and two measurements, and its rightmost pole at -0.1
    rad/s.

    z = (C1 x, u) and y = C2 x + w2, so that every assumption of H-infinity synthesis holds.
    """
    import control

    A = rng.normal(size=(states, states)) / math.sqrt(states)
    A -= (np.linalg.eigvals(A).real.max() + 0.1) * np.eye(states)
    B, C = rng.normal(size=(states, 6)), rng.normal(size=(6, states))
    C[2:4], B[:, 2:4] = 0.0, 0.0
    D = np.zeros((6, 6))
    D[2:4, 4:], D[4:, 2:4] = np.eye(2), np.eye(2)
    return GeneralisedPlant(control.ss(A, B / states**0.5, C / states**0.5, D), None, 2, 2)


def drive_plants() -> dict[str, GeneralisedPlant]:
    """The control problems of both axes after `regularise`, nominal and with parametric
    uncertainty.
    """
    found = {}
    axes: tuple[Axis, ...] = ("focus", "radial")
    for axis in axes:
        plant = generalised(axis, parametric_plant(axis))
        nominal = plant.channel(performance=["z_p", "z_u"], exogenous="w_p").nominal()
        for name, one in (("nominal", nominal), ("parametric", plant)):
            found[f"{axis} {name}"] = regularise(one, REGULARISATION)
    return found
