"""Static controllers of plants whose measurements tell every state, and perhaps the disturbance.

Dynamic controllers do no better there, and one Riccati equation gives the static ones (P. P.
Khargonekar, I. R. Petersen, M. A. Rotea, H-infinity optimal control with state feedback, IEEE
Trans. Automatic Control 33 (1988) 786-788).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from workbench.arrays import RealArray
from workbench.synthesis.h_infinity.levels import state_feedback
from workbench.synthesis.h_infinity.singular_plants.perturbed import costed
from workbench.systems.balancing import speed, state_units
from workbench.systems.realisation import Matrices
from workbench.systems.standard_plant import StandardPlant

TOLD = 1e-9
"""Largest entry, in balanced units, by which the measurements may miss a state or a disturbance."""


def static_controller(plant: StandardPlant, gamma: float, size: float) -> Matrices | None:
    """A static controller of a continuous plant, made for a level that its loop may yet miss.

    None where the measurements do not tell the states, or where no state feedback reaches the level
    with the costs of ``size`` that a singular plant needs.
    """
    rate = speed(plant.A, plant.B, plant.C)
    # Also the square root of time, whose unit B and C share.
    units = math.sqrt(rate) * state_units(plant.A / rate, plant.B, plant.C)
    n, m = plant.states, plant.controls
    seen = np.hstack([plant.C2 / units, plant.D21])
    state = _combination(seen, np.eye(n, seen.shape[1]))
    if state is None or not n:
        return None
    larger = costed(plant, size)
    whole, R = np.linalg.qr(larger.D12, mode="complete")
    Q, R = np.hstack([whole[:, m:], whole[:, :m]]), R[:m]
    B2 = np.asarray(np.linalg.solve(R.T, larger.B2.T).T)
    scaled = replace(
        larger,
        A=larger.A * units[:, None] / units / rate,
        B=np.hstack([larger.B1, B2]) * units[:, None] / rate,
        C=np.vstack([Q.T @ larger.C1, larger.C2]) / units,
        D=np.block([[Q.T @ larger.D11, Q.T @ larger.D12], [larger.D21, larger.D22]]),
    )
    found = state_feedback(scaled, gamma)
    if found is None:
        return None
    F1, F2 = np.split(found[1], [larger.D11.shape[1]])
    gain: RealArray = (
        F2 @ state
    )  # the best against a disturbance as bad as it can be, which is F1 x
    disturbance = _combination(seen, np.eye(seen.shape[1])[n:])
    if disturbance is not None:
        through = scaled.D11[-m:]
        gain = (F2 + through @ F1) @ state - through @ disturbance
    gain = np.asarray(np.linalg.solve(R, gain))
    gain = np.asarray(np.linalg.solve(np.eye(m) + gain @ plant.D22, gain))
    p = plant.measurements
    return np.zeros((0, 0)), np.zeros((0, p)), np.zeros((m, 0)), gain


def _combination(seen: RealArray, wanted: RealArray) -> RealArray | None:
    """A combination of the measurements that is what is wanted; None where there is none."""
    found = np.linalg.lstsq(seen.T, wanted.T, rcond=None)[0].T
    missed = np.abs(found @ seen - wanted).max(initial=0.0)
    return np.asarray(found) if missed <= TOLD else None
