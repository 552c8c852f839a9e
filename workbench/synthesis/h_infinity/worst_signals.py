"""Worst signals at the least level of H-infinity synthesis, and their energy over frequency.

At the least level no controller keeps ||z|| below gamma ||w||: for every controller there is a
disturbance w that reaches this level. The pair (w, z) is known from the Riccati solutions, T.
Basar, P. Bernhard, H-infinity Optimal Control and Related Minimax Design Problems (1995), chapter
5:

    until time 0 the measurement stays at zero, and w brings the state to v where Y X v = gamma^2 v;
    from time 0 on w is the worst disturbance for full information.

By the envelope theorem, the derivative of the least level by a parameter of the plant equals the
derivative of

z

/

w

for these signals.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workbench._core.arrays import RealArray
from workbench.synthesis.h_infinity.levels import Level
from workbench.synthesis.h_infinity.normalised import Scaled
from workbench.systems.frequency_response import frequency_response


class Densities(NamedTuple):
    """Energy densities of ``w`` (F, inputs) and ``z`` (F, outputs) per rad/s, as shares of the
    energy.
    """

    w: RealArray
    z: RealArray


def worst_densities(normal: Scaled, level: Level, omega: RealArray) -> Densities:
    """Energy densities of the worst signals at frequencies omega (F,) [rad/s], in the given plant's
    time.

    The level must be slightly above the least level.
    """
    plant = normal.plant
    values, vectors = np.linalg.eig(level.Y @ level.X)
    v = vectors[:, np.argmax(values.real)].real
    points = omega / normal.rate
    # From time 0: dx/dt = (A + B F) x, w = F1 x, z = (C1 + [D11 D12] F) x.
    inputs, outputs = plant.D11.shape[1], len(plant.D11)
    after = _state_response(
        plant.A + plant.B @ level.F,
        np.vstack([level.F[:inputs], plant.C1 + plant.D[:outputs] @ level.F]),
        v,
        1j * points,
    )
    # Until time 0, for the dual state l: dl/dt = -(A + L C)^T l, w = (B1 + L [D11; D21])^T l and
    # z = gamma^2 L1^T l; at time 0 it is X v / gamma^2.
    before = _state_response(
        (plant.A + level.L @ plant.C).T,
        np.vstack(
            [
                (plant.B1 + level.L @ plant.D[:, :inputs]).T,
                level.gamma**2 * level.L[:, :outputs].T,
            ]
        ),
        level.X @ v / level.gamma**2,
        -1j * points,
    )
    w, z = np.split(after + before, [inputs], axis=1)
    energies = (np.abs(w @ normal.turn_w.T) ** 2, np.abs(z @ normal.turn_z.T) ** 2)
    return Densities(*(each / np.trapezoid(each.sum(axis=1), omega) for each in energies))


def _state_response(A: RealArray, C: RealArray, x: RealArray, s: np.ndarray) -> np.ndarray:
    """C (s - A)^-1 x (F, outputs) at complex points s (F,)."""
    M = np.block([[A, x[:, None]], [C, np.zeros((len(C), 1))]])
    return frequency_response(M, len(A), s)[:, :, 0]
