"""The H2 controller from the solution X of the control problem and Y of the estimation problem.

In continuous time D11 and D22 are 0 and D12' D12, D21 D21' invertible (Zhou, Doyle, Glover, Robust
and Optimal Control (1996), section 14.5). In sampled time D22 is 0, and the controller uses the
newest measurement without delay (T. Chen, B. Francis, Optimal Sampled-Data Control Systems (1995),
section 6.4).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import RealArray
from workbench.systems.standard_plant import StandardPlant


class Separated(NamedTuple):
    """A controller K = (A, B, C, D), and the H2 norm of its loop computed from X and Y.

    Unlike an `H2Controller`, it has arrays and is not certified yet.
    """

    K: tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]
    norm: float


def separated_controller(plant: StandardPlant, X: RealArray, Y: RealArray) -> Separated:
    """The controller u = K y from X and Y."""
    return _sampled_controller(plant, X, Y) if plant.dt else _continuous_controller(plant, X, Y)


def _continuous_controller(plant: StandardPlant, X: RealArray, Y: RealArray) -> Separated:
    R = plant.D12.T @ plant.D12
    F = -np.linalg.solve(R, plant.B2.T @ X + plant.D12.T @ plant.C1)
    V = plant.D21 @ plant.D21.T
    L = -np.linalg.solve(V, plant.C2 @ Y + plant.D21 @ plant.B1.T).T
    energy = np.trace(plant.B1.T @ X @ plant.B1) + np.trace(R @ F @ Y @ F.T)
    none = np.zeros((plant.controls, plant.measurements))
    K = plant.A + plant.B2 @ F + L @ plant.C2, -L, F, none
    return Separated(K, _root(energy))


def _sampled_controller(plant: StandardPlant, X: RealArray, Y: RealArray) -> Separated:
    A, B1, B2, C1, C2 = plant.A, plant.B1, plant.B2, plant.C1, plant.C2
    D11, D12, D21 = plant.D11, plant.D12, plant.D21
    R = B2.T @ X @ B2 + D12.T @ D12
    F = -np.linalg.solve(R, B2.T @ X @ A + D12.T @ C1)
    F0 = -np.linalg.solve(R, B2.T @ X @ B1 + D12.T @ D11)
    V = C2 @ Y @ C2.T + D21 @ D21.T
    L = -np.linalg.solve(V, C2 @ Y @ A.T + D21 @ B1.T).T
    L0 = np.linalg.solve(V, C2 @ Y @ F.T + D21 @ F0.T).T
    K = A + B2 @ F + L @ C2 - B2 @ L0 @ C2, B2 @ L0 - L, F - L0 @ C2, L0
    # z with full information, and the difference between full information's control and the given
    # one
    informed = np.trace(B1.T @ X @ B1) + np.sum(D11**2) - np.trace(R @ F0 @ F0.T)
    apart = F0 - L0 @ D21, F - L0 @ C2
    missed = np.trace(R @ (apart[0] @ apart[0].T + apart[1] @ Y @ apart[1].T))
    return Separated(K, _root(informed + missed))


def _root(energy: float) -> float:
    return math.sqrt(max(float(energy), 0.0))
