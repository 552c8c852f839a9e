"""Multipliers of a minimum, made to meet its equations to the last digits."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from workbench.arrays import Array, RealArray
from workbench.uncertainty.matrix_sets.sets import MatrixSets
from workbench.uncertainty.matrix_sets.shapes import (
    ctranspose,
    directions,
    entry_directions,
)
from workbench.uncertainty.matrix_sets.size import size_derivatives

CORRECTIONS = 10
"""Corrections of the multipliers."""
TOUCHING = 1e-5
"""Distance of a norm from the largest one, relative, at which a set touches what it contains."""


def balanced_multipliers(
    program: MatrixSets, P: Array, S: Array, Z: Array, weights: RealArray
) -> RealArray:
    """Multipliers (F, N, r) changed so little that they meet the equations of a minimum.

    A solver leaves an error in them, which is larger the nearer its sets come to what they contain.
    The change is the least relative to the multipliers.
    """
    equations, wanted, _ = _equations(program, P, S, Z)
    steps = -np.diff(weights, axis=-1, append=0.0).reshape(len(wanted), -1)
    reached = np.einsum("fdk,fk->fd", equations, steps)
    steps = steps * (wanted.max(axis=1) / reached.max(axis=1))[:, None]
    for _ in range(CORRECTIONS):
        reached = np.einsum("fdk,fk->fd", equations, steps)
        change = np.linalg.pinv(equations * steps[:, None]) @ (wanted - reached)[..., None]
        steps = steps * np.maximum(1 + change[..., 0], 0.0)
    return _summed(steps.reshape(weights.shape))


def touching_multipliers(program: MatrixSets, P: Array, S: Array, Z: Array) -> RealArray:
    """Multipliers (F, N, r) that meet the equations of a minimum best, of what the sets touch."""
    equations, wanted, slack = _equations(program, P, S, Z)
    steps = np.zeros(slack.shape)
    for f, (columns, target) in enumerate(zip(equations, wanted, strict=True)):
        active = slack[f] <= TOUCHING
        steps[f, active] = nnls(columns[:, active], target)[0]
    F, N, p, m = len(P), program.deviations.shape[1], len(P[0]), len(S[0])
    return _summed(steps.reshape(F, N + p * m, min(p, m)))


def _equations(
    program: MatrixSets, P: Array, S: Array, Z: Array
) -> tuple[RealArray, RealArray, RealArray]:
    """Equations (F, d, N r) and right sides (F, d) of multipliers, and by how little none touches.

    The unknowns are the steps of the multipliers from one singular value to the next smaller one,
    which must not be negative. What they multiply is how far their singular values are from the
    largest of all (F, N r).
    """
    F, moving, p, m = program.deviations.shape
    A, B = directions(program.left, p), directions(program.right, m)
    M = P[:, None] @ program.away(Z) @ S[:, None]
    u, s, vh = np.linalg.svd(M, full_matrices=False)
    v = ctranspose(vh)
    values = [
        np.einsum("fkir,dij,fkjr->fdkr", u.conj(), A, u).real,
        np.einsum("fkir,dij,fkjr->fdkr", v.conj(), B, v).real,
    ]
    if program.centre == "free":
        across = np.einsum("fkir,dij,fkjr->fdkr", u.conj(), entry_directions(p, m), v).real
        across[:, :, moving:] = 0.0  # the floor moves with the centre
        values.append(across)
    equations = np.concatenate(values, axis=1).cumsum(axis=-1).reshape(F, -1, s[0].size)
    slope, _ = size_derivatives(program, P, S, A, B)
    wanted = np.zeros(equations.shape[:2])
    wanted[:, : slope.shape[1]] = -slope
    slack = 1 - s / s.max(axis=(1, 2), keepdims=True)
    return equations, wanted, slack.reshape(F, -1)


def _summed(steps: RealArray) -> RealArray:
    """Multipliers whose steps from one singular value to the next smaller one are given."""
    found: RealArray = steps[..., ::-1].cumsum(axis=-1)[..., ::-1]
    return found
