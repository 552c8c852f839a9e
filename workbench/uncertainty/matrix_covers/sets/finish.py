"""Sets from inverse weights: scaled until they contain the matrices, with triangular weights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench.uncertainty.matrix_covers.sets.program import FoundSets, MatrixSets
from workbench.uncertainty.matrix_covers.sets.shapes import ctranspose


def containing_sets(
    program: MatrixSets,
    P: Array,
    S: Array,
    Z: Array,
    weights: RealArray,
    of_loop: tuple[RealArray, RealArray] | None = None,
) -> FoundSets:
    """Sets with these inverse weights, scaled to contain the deviations and the floor.

    ``of_loop`` holds the scaling (F,) of a loop and its multipliers (F, rank).
    """
    M = P[:, None] @ program.away(Z) @ S[:, None]
    norm = np.linalg.norm(M, 2, axis=(2, 3)).max(axis=1)[:, None, None]
    # W = T Q with T lower triangular for the left weight, W = Q T for the right one
    left = ctranspose(np.linalg.qr(ctranspose(np.linalg.inv(P)))[1]) * norm
    right = np.linalg.qr(np.linalg.inv(S))[1]
    size = np.exp(np.linalg.slogdet(right)[1] / right.shape[-1])[:, None, None]
    found = FoundSets(
        left * size / _diagonal_phases(left)[:, None],
        right / size / _diagonal_phases(right)[:, :, None],
        Z,
        weights,
    )
    beyond = 1 + max(program.checks(found, 0.0)[0].value, 0.0)
    if of_loop is not None:
        delta, multipliers = of_loop
        factor = np.log(norm[:, 0, 0] * beyond)
        parts = (factor[:, None], (delta + np.log(size[:, 0, 0]))[:, None], multipliers)
        found = replace(found, of_loop=np.concatenate(parts, axis=1))
    return replace(found, left=found.left * beyond)


def _diagonal_phases(triangular: Array) -> Array:
    """Numbers (F, n) of magnitude 1 that make the diagonal real."""
    diagonal = np.einsum("fii->fi", triangular)
    turn: Array = diagonal / np.abs(diagonal)
    return turn
