"""Small perturbations that make plants meet the assumptions of H-infinity synthesis.

Every control, and if needed every state, becomes a small performance output. Every measurement, and
if needed every state, gets a small disturbance. A plant that can be stabilised then meets every
assumption, because every nonzero (x, u) has a cost. The perturbed loop contains the loop of the
given plant, so its norm is at least as large. As the perturbation goes to zero, its least norm
tends to that of the given plant, since this holds for the norm with each fixed controller. All
proofs are about the controller's loop with the given plant.

A. A. Stoorvogel, The H-infinity Control Problem (1992), section 5.4 (singular problems as limits of
regular ones).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from workbench._core.arrays import RealArray
from workbench.synthesis.h_infinity.axis_zeros import axis_zeros
from workbench.synthesis.h_infinity.levels import MIDDLE_POINT
from workbench.synthesis.h_infinity.normalised import has_rank
from workbench.systems.balancing import speed, state_units
from workbench.systems.frequency_response import frequency_response
from workbench.systems.standard_plant import StandardPlant

SLOW_SHARE, ROUNDED_POLE = 1e-6, 1e-8
"""Least share of the response at the slowest pole that is used; poles below the second share of the
fastest pole count as zero.
"""
DEFAULT_SIZE = 1e-3
"""Default size of the perturbation, relative to the signals of the plant."""


def made_regular(plant: StandardPlant, size: float = DEFAULT_SIZE) -> StandardPlant:
    """A continuous plant with small costs and disturbances, if an assumption fails.

    A plant that meets the assumptions is returned unchanged. Controls and measurements stay the
    same, so both plants have the same controllers.
    """
    return _with_disturbances(costed(plant, size), size)


def wholly_perturbed(plant: StandardPlant, size: float) -> StandardPlant:
    """A continuous plant with a cost on every control and state, and a disturbance on every
    measurement and state.
    """
    return _with_all_costs(_with_all_costs(plant, size).dual, size).dual


def _with_disturbances(plant: StandardPlant, size: float) -> StandardPlant:
    """The plant with added disturbances if D21 lacks rank or w -> y has zeros on the axis."""
    dual = plant.dual
    larger = costed(dual, size)
    return plant if larger is dual else larger.dual


def costed(plant: StandardPlant, size: float) -> StandardPlant:
    """The plant with added costs if D12 lacks rank or u -> z has zeros on the axis."""
    if not has_rank(plant.D12):
        plant = with_outputs(plant, *control_costs(plant, size))
    if zeros_of(plant):
        plant = with_outputs(plant, *state_costs(plant, size))
    return plant


def _with_all_costs(plant: StandardPlant, size: float) -> StandardPlant:
    C, D = control_costs(plant, size)
    C_x, D_x = state_costs(plant, size)
    return with_outputs(plant, np.vstack([C, C_x]), np.vstack([D, D_x]))


def control_costs(plant: StandardPlant, size: float) -> tuple[RealArray, RealArray]:
    """Rows of C1 and D12 for a cost on u, `size` times the response of u -> z at a middle
    frequency.

    Long chains of states have almost no response at a middle frequency. So the cost is also at
    least a small share of the response at a low frequency.
    """
    A, B, C, _, _ = _in_units(plant)
    M = np.block([[A, B[:, -plant.controls :]], [C[: len(plant.C1)], plant.D12]])
    poles = np.abs(np.linalg.eigvals(A))
    slowest = poles[poles > ROUNDED_POLE * poles.max(initial=0.0)].min(initial=1.0)
    points = [MIDDLE_POINT, slowest * MIDDLE_POINT]
    middle, slow = np.abs(frequency_response(M, plant.states, points)).max(axis=1)
    response = np.maximum(middle, SLOW_SHARE * slow)
    weight = np.where(response > 0.0, response, response.max(initial=0.0) or 1.0)
    return np.zeros((plant.controls, plant.states)), size * np.diag(weight)


def state_costs(plant: StandardPlant, size: float) -> tuple[RealArray, RealArray]:
    """Rows of C1 and D12 for a cost on the balanced states, `size` times the largest entry of
    C1.
    """
    _, _, C, rate, factor = _in_units(plant)
    largest = float(np.abs(C[: len(plant.C1)]).max(initial=0.0)) or 1.0
    return (
        size * largest * math.sqrt(rate) * np.diag(factor),
        np.zeros((plant.states, plant.controls)),
    )


def _in_units(
    plant: StandardPlant,
) -> tuple[RealArray, RealArray, RealArray, float, RealArray]:
    """A, B and C in balanced units of time and states, the rate [rad/s] and the states' factors."""
    rate = speed(plant.A, plant.B, plant.C)
    root = math.sqrt(rate)
    A, B, C = plant.A / rate, plant.B / root, plant.C / root
    factor = state_units(A, B, C)
    return A * factor[:, None] / factor, B * factor[:, None], C / factor, rate, factor


def with_outputs(plant: StandardPlant, C: RealArray, D12: RealArray) -> StandardPlant:
    """The plant with further performance outputs C x + D12 u, after the others."""
    z = len(plant.C1)
    D = np.hstack([np.zeros((len(D12), plant.D11.shape[1])), D12])
    return replace(
        plant,
        C=np.vstack([plant.C[:z], C, plant.C[z:]]),
        D=np.vstack([plant.D[:z], D, plant.D[z:]]),
    )


def zeros_of(plant: StandardPlant) -> bool:
    """Whether u -> z of a continuous plant with D12 of full rank has zeros on the axis."""
    A, B, C, _, _ = _in_units(plant)
    Q, R = np.linalg.qr(plant.D12)
    B2 = np.linalg.solve(R.T, B[:, -plant.controls :].T).T
    return bool(axis_zeros(A, B2, C[: len(plant.C1)], Q))
