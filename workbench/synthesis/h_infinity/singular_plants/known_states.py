"""Static controllers for plants whose measurements determine every state, and perhaps the
disturbance.

Dynamic controllers are not better there, and one Riccati equation gives the static controller. Its
least level is a lower bound for all plants that differ only in having fewer measurements (P. P.
Khargonekar, I. R. Petersen, M. A. Rotea, H-infinity optimal control with state feedback, IEEE
Trans. Automatic Control 33 (1988) 786-788).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from workbench._core.arrays import RealArray
from workbench.synthesis.h_infinity.levels import state_feedback
from workbench.synthesis.h_infinity.singular_plants.perturbed import costed
from workbench.systems.balancing import speed, state_units
from workbench.systems.realisation import Matrices
from workbench.systems.standard_plant import StandardPlant

TOLD = 1e-9
"""Largest error, in balanced units, for measurements that determine a state or a disturbance."""


def static_controller(plant: StandardPlant, gamma: float, size: float) -> Matrices | None:
    """A static controller of a continuous plant for a level; its loop may still exceed the level.

    None if the measurements do not determine the states, or if no state feedback reaches the level.
    A singular plant gets costs of size ``size``.
    """
    one = _ScaledPlant.of(costed(plant, size))
    n, m, p = plant.states, plant.controls, plant.measurements
    seen = np.hstack([plant.C2 / one.units, plant.D21])
    state = _combination(seen, np.eye(n, seen.shape[1]))
    found = None if state is None or not n else state_feedback(one.plant, gamma)
    if state is None or found is None:
        return None
    F1, F2 = np.split(found[1], [one.plant.D11.shape[1]])
    gain: RealArray = F2 @ state  # the best gain against the worst disturbance F1 x
    disturbance = _combination(seen, np.eye(seen.shape[1])[n:])
    if disturbance is not None:
        through = one.plant.D11[-m:]
        gain = (F2 + through @ F1) @ state - through @ disturbance
    gain = np.asarray(np.linalg.solve(one.controls, gain))
    gain = np.asarray(np.linalg.solve(np.eye(m) + gain @ plant.D22, gain))
    return np.zeros((0, 0)), np.zeros((0, p)), np.zeros((m, 0)), gain


def informed_level(plant: StandardPlant, reached: float, tolerance: float) -> float:
    """A level that no controller reaches, not even one that knows all states and disturbances.

    ``reached`` is the norm that some controller has. Only the Riccati equation of u -> z is used.
    The result is NaN if u -> z does not meet an assumption, or if the level is closer to 0 than the
    tolerance.
    """
    if not (reached > 0.0 and costed(plant, 1.0) is plant):
        return math.nan
    scaled = _ScaledPlant.of(plant).plant
    low, high = 0.0, reached
    while high > (1.0 + tolerance) * low:
        trial = math.sqrt(low * high) if low else high / 2.0
        if trial < tolerance * reached:
            return math.nan
        if state_feedback(scaled, trial) is None:
            low = trial
        else:
            high = trial
    return low


class _ScaledPlant(NamedTuple):
    """A plant with D12 = [0; I] in scaled units: scaled states are ``units`` x, scaled controls
    ``controls`` u.
    """

    plant: StandardPlant
    units: RealArray
    controls: RealArray

    @classmethod
    def of(cls, plant: StandardPlant) -> _ScaledPlant:
        """Scale a continuous plant whose D12 has full rank."""
        rate, m = speed(plant.A, plant.B, plant.C), plant.controls
        # The factor sqrt(rate) is the share of the unit of time in B and in C.
        units = math.sqrt(rate) * state_units(plant.A / rate, plant.B, plant.C)
        whole, R = np.linalg.qr(plant.D12, mode="complete")
        Q, R = np.hstack([whole[:, m:], whole[:, :m]]), R[:m]
        B2 = np.asarray(np.linalg.solve(R.T, plant.B2.T).T)
        scaled = replace(
            plant,
            A=plant.A * units[:, None] / units / rate,
            B=np.hstack([plant.B1, B2]) * units[:, None] / rate,
            C=np.vstack([Q.T @ plant.C1, plant.C2]) / units,
            D=np.block([[Q.T @ plant.D11, np.eye(len(Q))[:, -m:]], [plant.D21, plant.D22]]),
        )
        return cls(scaled, units, R)


def _combination(seen: RealArray, wanted: RealArray) -> RealArray | None:
    """The combination of the measurements that equals `wanted`; None if there is none."""
    found = np.linalg.lstsq(seen.T, wanted.T, rcond=None)[0].T
    missed = np.abs(found @ seen - wanted).max(initial=0.0)
    return np.asarray(found) if missed <= TOLD else None
