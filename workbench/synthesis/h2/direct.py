"""The direct term of w -> z. In continuous time a gain must cancel it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench._core.arrays import EPS, RealArray
from workbench.errors import InputError
from workbench.synthesis.h_infinity.normalised import SINGULAR_CONDITION
from workbench.systems.realisation import Matrices
from workbench.systems.standard_plant import StandardPlant

DIRECT_TERM_ROUNDING = 1e3 * EPS
"""A direct term below this share of the terms that it is the sum of counts as rounding."""


def cancelling_gain(plant: StandardPlant) -> RealArray:
    """The smallest gain Dk with D11 + D12 Dk D21 = 0, where D22 is ignored.

    Raises
    ------
    InputError
        There is no such gain: white noise passes directly to the performance with every controller.
    """
    if not plant.D11.any():
        return np.zeros((plant.controls, plant.measurements))
    Dk: RealArray = -_inverse(plant.D12) @ plant.D11 @ _inverse(plant.D21.T).T
    if direct_term(without_D22(plant), Dk) > DIRECT_TERM_ROUNDING:
        left = np.abs(plant.D11 + plant.D12 @ Dk @ plant.D21)
        row, column = np.unravel_index(np.argmax(left), left.shape)
        raise InputError(
            f"the H2 norm of every loop is infinite: exogenous input {column + 1} passes directly "
            f"to performance output {row + 1}, and no control cancels that; let one of them pass "
            "through a weight that rolls off"
        )
    return Dk


def _inverse(D12: RealArray) -> RealArray:
    """The pseudoinverse, computed with columns of norm 1."""
    sizes = np.linalg.norm(D12, axis=0)
    sizes = np.where(sizes > 0.0, sizes, 1.0)
    found: RealArray = np.linalg.pinv(D12 / sizes) / sizes[:, None]
    return found


def direct_term(plant: StandardPlant, Dk: RealArray) -> float:
    """Largest direct term w -> z of the loop, relative to the sum of its terms; 0 without terms.

    Raises LinAlgError where the loop through D22 and Dk is singular.
    """
    through = Dk @ np.linalg.inv(np.eye(plant.measurements) - plant.D22 @ Dk)
    terms = np.abs(plant.D11) + np.abs(plant.D12) @ np.abs(through) @ np.abs(plant.D21)
    left = np.abs(plant.D11 + plant.D12 @ through @ plant.D21)
    return float(np.max(left[terms > 0] / terms[terms > 0], initial=0.0))


def without_direct(plant: StandardPlant, Dk: RealArray) -> StandardPlant:
    """The plant with u = Dk y + u' and without D22, where Dk cancels D11."""
    A = plant.A + plant.B2 @ Dk @ plant.C2
    B, C, D = plant.B.copy(), plant.C.copy(), without_D22(plant).D
    z, w = plant.D11.shape
    B[:, :w] += plant.B2 @ Dk @ plant.D21
    C[:z] += plant.D12 @ Dk @ plant.C2
    D[:z, :w] = 0.0
    return replace(plant, A=A, B=B, C=C, D=D)


def without_D22(plant: StandardPlant) -> StandardPlant:
    """The plant without its direct term of u -> y."""
    D = plant.D.copy()
    D[len(plant.D11) :, plant.D11.shape[1] :] = 0.0
    return replace(plant, D=D)


def with_D22(K: Matrices, D22: RealArray) -> Matrices:
    """The controller for a plant with D22, from the controller for the plant without D22.

    Raises LinAlgError where the loop through both direct terms is singular.
    """
    A, B, C, D = K
    loop = np.eye(len(D22)) + D22 @ D
    if np.linalg.cond(loop) > SINGULAR_CONDITION:
        raise np.linalg.LinAlgError("the loop through D22 and the controller found is singular")
    inside = np.linalg.inv(loop)
    return A - B @ inside @ D22 @ C, B @ inside, C - D @ inside @ D22 @ C, D @ inside
