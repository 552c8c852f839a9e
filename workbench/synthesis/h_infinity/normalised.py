"""Scaling of a plant to entries near 1, and the way back for its controller."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.systems.balancing import balanced, speed
from workbench.systems.hidden_states import visible_matrices
from workbench.systems.realisation import Matrices
from workbench.systems.standard_plant import StandardPlant

RANK_TOLERANCE = 1e-10
"""Singular values below this count as zero, for D12 and D21 with columns of norm 1."""

SINGULAR_CONDITION = 1e12
"""Condition number above which the loop through D22 and the controller counts as singular."""


class SingularPlantError(InputError):
    """The plant does not meet an assumption, but a small perturbation of it does."""


@dataclass(frozen=True, eq=False)
class Scaled:
    """A continuous plant with D12 = [0; I], D21 = [0 I], D22 = 0, and with scaled states and time.

    Scaled quantities have the index s: u = control u_s, y_s = measurement (y - D22 u) and t_s =
    rate t. z = turn_z z_s and w = turn_w w_s are rotations, which do not change the norm. ``given``
    is the original plant.
    """

    given: StandardPlant
    plant: StandardPlant
    control: RealArray
    measurement: RealArray
    rate: float
    turn_z: RealArray
    turn_w: RealArray

    def controller(self, K: Matrices) -> Matrices:
        """The controller of the original plant from that of the scaled plant.

        Raises LinAlgError where the loop through its direct term and D22 is singular.
        """
        A, B, C, D = K
        # K_s (1 + D22 K_s)^-1 in scaled signals, for which the condition number is meaningful.
        D22 = self.measurement @ self.given.D22 @ self.control
        loop = np.eye(len(D22)) + D22 @ D
        if np.linalg.cond(loop) > SINGULAR_CONDITION:
            raise np.linalg.LinAlgError(
                "the loop through D22 and the direct term of the controller found is singular"
            )
        feedback = np.linalg.solve(loop, np.hstack([D22 @ C, np.eye(len(loop))]))
        through, B_new = np.split(B @ feedback, [len(A)], axis=1)
        direct, D_new = np.split(D @ feedback, [len(A)], axis=1)
        root = math.sqrt(self.rate)
        return (
            self.rate * (A - through),
            root * B_new @ self.measurement,
            root * self.control @ (C - direct),
            self.control @ D_new @ self.measurement,
        )


def normalised_plant(plant: StandardPlant) -> Scaled:
    """Normalise the signals, balance the states, remove hidden states, and scale time.

    Raises
    ------
    SingularPlantError
        D12 does not have full column rank, or D21 does not have full row rank.
    InputError
        An unstable mode is hidden.
    """
    turn_z, control = _normalising(plant.D12, "D12")
    turn_w, measurement = _normalising(plant.D21.T, "D21")
    outputs, inputs = plant.D11.shape
    M = np.block([[plant.B1 @ turn_w, plant.B2 @ control]])
    N = np.block([[turn_z.T @ plant.C1], [measurement.T @ plant.C2]])
    D = np.zeros((outputs + plant.measurements, inputs + plant.controls))
    D[:outputs, :inputs] = turn_z.T @ plant.D11 @ turn_w
    D[outputs - plant.controls : outputs, inputs:] = np.eye(plant.controls)
    D[outputs:, inputs - plant.measurements : inputs] = np.eye(plant.measurements)
    A, B, C = visible_matrices(*balanced(plant.A, M, N))
    A, B, C = balanced(A, B, C)
    rate = speed(A, B, C)
    root = math.sqrt(rate)
    A, B, C = A / rate, B / root, C / root
    normal = replace(plant, A=A, B=B, C=C, D=D)
    return Scaled(plant, normal, control, measurement.T, rate, turn_z, turn_w)


def _normalising(D12: RealArray, name: str) -> tuple[RealArray, RealArray]:
    """An orthogonal Q and an S with Q^T D12 S = [0; I]; `name` is for messages."""
    if not has_rank(D12):
        raise SingularPlantError(rank_advice(name, D12))
    # Scale first: with very different units of signals, rounding would hide small singular values.
    sizes = np.linalg.norm(D12, axis=0)
    U, values, Vh = np.linalg.svd(D12 / sizes)
    rank = len(values)
    Q = np.hstack([U[:, rank:], U[:, :rank]])
    return Q, Vh.T / values / sizes[:, None]


def has_rank(D12: RealArray) -> bool:
    """Whether D12 (outputs, inputs) has full column rank, in any units of its columns."""
    rows, columns = D12.shape
    sizes = np.linalg.norm(D12, axis=0)
    if rows < columns or not (sizes > 0.0).all():
        return False
    return bool(np.linalg.svd(D12 / sizes, compute_uv=False)[-1] > RANK_TOLERANCE)


def rank_advice(name: str, D12: RealArray) -> str:
    """Message about a direct term without full rank and its remedy; D21 is given transposed."""
    sizes = np.linalg.norm(D12, axis=0)
    values = np.linalg.svd(D12 / np.where(sizes > 0.0, sizes, 1.0), compute_uv=False)
    rank = int((values > RANK_TOLERANCE).sum())
    if name == "D12":
        return (
            f"D12 (u -> z) has rank {rank} and must have full column rank {D12.shape[1]}: some "
            "control costs nothing at high frequencies; add a weight on u, or ask regularised()"
        )
    return (
        f"D21 (w -> y) has rank {rank} and must have full row rank {D12.shape[1]}: some "
        "measurement is perfect at high frequencies; add noise on the measurement, or ask "
        "regularised()"
    )
