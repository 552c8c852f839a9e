"""Plants that miss an assumption of H-infinity synthesis, made regular by a small perturbation.

Every control, and where needed every state, becomes a performance output of a small size; every
measurement, and where needed every state, gets a small disturbance. A plant that can be stabilised
then meets every assumption: no x and u that are not both zero are free of cost. The loop contains
that of the given plant, so its norm is at least as large, and its least norm tends to that of the
given plant as the size falls: the norm of any one controller does. What is proven of a controller
is proven of the given plant.

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
"""Share of a response at the slowest pole that counts, and of the fastest pole that is none."""
DEFAULT_SIZE = 1e-3
"""Size of the perturbation where none is given, relative to the signals of the plant."""


def made_regular(plant: StandardPlant, size: float = DEFAULT_SIZE) -> StandardPlant:
    """A continuous plant with small costs and disturbances where an assumption fails.

    A plant that meets the assumptions is returned unchanged. The controls and measurements are the
    same, so a controller of the one is a controller of the other.
    """
    return _disturbed(costed(plant, size), size)


def wholly_perturbed(plant: StandardPlant, size: float) -> StandardPlant:
    """A continuous plant with a cost on every control and state, and a disturbance of each."""
    return _all_costed(_all_costed(plant, size).dual, size).dual


def _disturbed(plant: StandardPlant, size: float) -> StandardPlant:
    """The plant with disturbances where D21 lacks rank or w -> y has zeros on the axis."""
    dual = plant.dual
    larger = costed(dual, size)
    return plant if larger is dual else larger.dual


def costed(plant: StandardPlant, size: float) -> StandardPlant:
    """The plant with costs where D12 lacks rank or u -> z has zeros on the axis."""
    if not has_rank(plant.D12):
        plant = with_outputs(plant, *control_costs(plant, size))
    if zeros_of(plant):
        plant = with_outputs(plant, *state_costs(plant, size))
    return plant


def _all_costed(plant: StandardPlant, size: float) -> StandardPlant:
    C, D = control_costs(plant, size)
    C_x, D_x = state_costs(plant, size)
    return with_outputs(plant, np.vstack([C, C_x]), np.vstack([D, D_x]))


def control_costs(plant: StandardPlant, size: float) -> tuple[RealArray, RealArray]:
    """Rows of C1 and D12: u times `size` times the response of u -> z at a middle frequency.

    Long chains of states leave nothing there of what they pass on slowly: at least a small share of
    the response at a slow frequency counts.
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
    """Rows of C1 and D12: balanced states times `size` times the largest entry of C1."""
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
