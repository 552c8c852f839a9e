"""Shapes of weights, and the directions in which weights of a shape move.

Weights of one shape are closed under products, inverses and powers. So geodesics between weights of
a shape have the same shape.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from workbench._core.arrays import Array

WeightShape = Literal["full", "diagonal", "scalar"]
"""Shape of a weight: any matrix, one function per channel, or one function for all."""


def directions(shape: WeightShape, size: int) -> Array:
    """Orthonormal Hermitian matrices (d, size, size) along which the logarithm of a weight moves.

    There are size^2 directions for a full weight, size for a diagonal one, and 1 for a scalar one.
    """
    unit = np.eye(size, dtype=complex)
    if shape == "scalar":
        return unit[None] / np.sqrt(size)
    found = [np.outer(unit[i], unit[i]) for i in range(size)]
    if shape == "full":
        for i in range(size):
            for j in range(i):
                for turn in (1.0, 1j):
                    entry = turn * np.outer(unit[i], unit[j])
                    found.append((entry + entry.conj().T) / np.sqrt(2))
    return np.array(found)


def of_shape(matrices: Array, shape: WeightShape) -> Array:
    """Orthogonal projection of Hermitian matrices (..., n, n) on the directions of a shape."""
    basis = directions(shape, matrices.shape[-1])
    parts = np.einsum("dij,...ij->...d", basis.conj(), matrices).real
    projected: Array = np.einsum("...d,dij->...ij", parts, basis)
    return projected


def entry_directions(p: int, m: int) -> Array:
    """Directions (2 p m, p, m) in which the real and imaginary parts of a complex matrix's entries
    move.
    """
    unit = np.eye(p * m).reshape(p * m, p, m)
    return np.concatenate([unit, 1j * unit])


def ctranspose(matrices: Array) -> Array:
    """Conjugate transposes of matrices (..., p, m)."""
    return matrices.conj().swapaxes(-2, -1)


def between_weights(left: Array, X: Array, right: Array) -> Array:
    """W_1^-1 X W_2^-1 (F, N, p, m) of matrices X (F, N, p, m), for W_1 (F, p, p), W_2 (F, m, m)."""
    found: Array = np.linalg.solve(left[:, None], X) @ np.linalg.inv(right)[:, None]
    return found
