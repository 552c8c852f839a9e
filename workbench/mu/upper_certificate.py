"""What given multipliers prove: the least bound for D and G, rounded outward.

For fixed D and G the best bound is an eigenvalue,

    beta^2 = lambda_max( D_r^-1/2 (M^H D_l M + j (G M - M^H G^H)) D_r^-1/2 ),

computed in a frame where M is near 1 and D has a diagonal of ones. Powers of two take it there, so
that only the arithmetic inside the frame rounds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from workbench.structure import Full, Real, Structure

Array = NDArray[np.complex128]
EPS = float(np.finfo(float).eps)


def structured(
    structure: Structure, D_left: Array, D_right: Array, G: Array
) -> tuple[Array, Array, Array]:
    """The multipliers of the structure nearest to the given ones.

    Parameters
    ----------
    D_left, D_right, G
        Shapes (..., c, c), (..., r, r) and (..., r, c).

    Returns
    -------
    D_left and D_right with the same Hermitian block of every repeated scalar and the same multiple
    of the identity for every full block; G Hermitian in the blocks of real scalars, zero elsewhere.
    """
    parts = tuple(np.zeros_like(part, dtype=complex) for part in (D_left, D_right, G))
    for block, row, column in zip(
        structure, structure.row_slices, structure.column_slices, strict=True
    ):
        first, second = D_left[..., column, column], D_right[..., row, row]
        if isinstance(block, Full):
            # Their common multiple is read at one place: a mean of equal numbers may round.
            d = second[..., :1, :1].real
            parts[0][..., column, column] = d * np.eye(block.columns)
            parts[1][..., row, row] = d * np.eye(block.rows)
            continue
        mean = _hermitian((first + second) / 2)
        parts[0][..., column, column] = mean
        parts[1][..., row, row] = mean
        if isinstance(block, Real):
            parts[2][..., row, column] = _hermitian(G[..., row, column])
    return parts[0], parts[1], parts[2]


def certified(
    M: Array, structure: Structure, D_left: Array, D_right: Array, G: Array
) -> NDArray[np.float64]:
    """The least bound that the structured part of the multipliers proves, with rounding on top.

    Infinite where D is not positive definite or anything is not finite. Shape (...), that of the
    batch. The allowance for rounding is a bound of the errors of the products, the Cholesky factor
    and the eigenvalues (Higham, Accuracy and Stability of Numerical Algorithms, ch. 3, 8, 10).
    """
    D_left, D_right, G = structured(structure, D_left, D_right, G)
    with np.errstate(all="ignore"):
        size = _power(np.abs(M).max((-2, -1), initial=0.0))
        rows, columns = (_power(np.sqrt(_diagonal(D))) for D in (D_left, D_right))
        # Each factor has its turn, so that no product of two of them overflows.
        X = M / size[..., None, None] * rows[..., :, None] / columns[..., None, :]
        D = D_left / rows[..., :, None] / rows[..., None, :]
        R = D_right / columns[..., :, None] / columns[..., None, :]
        Y = G / size[..., None, None] / columns[..., :, None] / rows[..., None, :]
        # Again: where D has a wide range, what M is in its frame may be small.
        again = _power(np.maximum(_norm(X), np.sqrt(_norm(X) * _norm(Y))))
        X, Y = X / again[..., None, None], Y / again[..., None, None]

        proper = np.isfinite(X).all((-2, -1)) & np.isfinite(Y).all((-2, -1))
        proper &= np.isfinite(D).all((-2, -1)) & np.isfinite(R).all((-2, -1))
        X, Y, D, R = (
            np.where(proper[..., None, None], part, np.eye(*part.shape[-2:]))
            for part in (X, Y, D, R)
        )
        twisted = 1j * (Y @ X)
        A = X.conj().mT @ (D @ X) + twisted + twisted.conj().mT
        count = sum(M.shape[-2:]) + 8
        rounding = 4 * count * EPS * (_norm(X) ** 2 * _norm(D) + 2 * _norm(X) * _norm(Y))
        top, proper = _largest(A, rounding, R, D, structure, proper)
        value = np.sqrt(np.maximum(top, 0.0)) * (1 + 8 * EPS) * again * size
    return np.where(proper & np.isfinite(value), value, np.inf)


def _largest(
    A: Array,
    rounding: NDArray[np.float64],
    R: Array,
    D: Array,
    structure: Structure,
    proper: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """An upper bound of the largest eigenvalue of the pencil (A, R), and where D, R > 0."""
    count = sum(A.shape[-1:]) + 8
    allowance = 4 * count * EPS
    if all(isinstance(block, Full) or block.rows == 1 for block in structure):
        least = _diagonal(R).min(-1)  # diagonal, between 1/2 and 2
        root = np.sqrt(_diagonal(R))
        proper = proper & (least > 0)
        N = A / root[..., :, None] / root[..., None, :]
        stretch = np.ones_like(least)
    else:
        # What is positive in the frame of D_r is so in that of D_l: the blocks are the same.
        values, vectors = np.linalg.eigh(R)
        least = values[..., 0] - allowance * _norm(R)
        proper = proper & (least > 0)
        least = np.where(proper, least, 1.0)
        root = np.where(proper[..., None], values, 1.0) ** -0.5
        N = root[..., :, None] * (vectors.conj().mT @ A @ vectors) * root[..., None, :]
        stretch = 1 + _norm(R) / least
    least = np.where(proper, least, 1.0)
    N = np.where(proper[..., None, None], N, 0.0)
    top = np.linalg.eigvalsh(N)[..., -1]
    return top + rounding / least + allowance * stretch * _norm(N), proper


def _hermitian(matrix: Array) -> Array:
    return (matrix + matrix.conj().mT) / 2


def _diagonal(matrix: Array) -> NDArray[np.float64]:
    return np.diagonal(matrix, axis1=-2, axis2=-1).real


def _norm(matrix: Array) -> NDArray[np.float64]:
    """Frobenius norms, without overflow of the entries' squares."""
    size = _power(np.abs(matrix).max((-2, -1), initial=0.0))
    scaled = matrix / size[..., None, None]
    return np.sqrt((scaled.real**2 + scaled.imag**2).sum((-2, -1))) * size


def _power(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The power of two next below each positive value; 1 for zero."""
    exponent = np.frexp(values)[1] - 1
    return np.where(values > 0, np.ldexp(1.0, exponent), 1.0)
