"""What given multipliers prove: the least bound for D and G, rounded outward.

For fixed D and G the best bound is an eigenvalue,

    beta^2 = lambda_max( D_r^-1/2 (M^H D_l M + j (G M - M^H G^H)) D_r^-1/2 ),

computed in a frame where M is near 1 and D has a diagonal near 1. Powers of two take it there, so
that only the arithmetic inside the frame rounds. Where a bound of those errors is not small, as
with a D that is nearly singular, beta is searched for with a test that does not mind: the matrix
beta^2 D_r - A with its rows and columns scaled, and an error bound for every entry.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import ComplexArray
from workbench.structure import Full, Real, Structure

EPS = float(np.finfo(float).eps)
CHUNK = 4096
"""Matrices at a time: what is computed on the way is many times larger than they are."""
CLEAR = 1e-9
"""Rounding, relative to beta^2, that is not worth a search."""
SEARCH = 45


def structured(
    structure: Structure, D_left: ComplexArray, D_right: ComplexArray, G: ComplexArray
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
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
    M: ComplexArray,
    structure: Structure,
    D_left: ComplexArray,
    D_right: ComplexArray,
    G: ComplexArray,
) -> NDArray[np.float64]:
    """The least bound that the structured part of the multipliers proves, with rounding on top.

    Infinite where D is not positive definite or anything is not finite. Shape (...), that of the
    batch. The allowance for rounding is a bound of the errors of the products, the Cholesky factor
    and the eigenvalues (Higham, Accuracy and Stability of Numerical Algorithms, ch. 3, 8, 10).
    """
    batch = M.shape[:-2]
    parts = [np.reshape(part, (-1, *part.shape[-2:])) for part in (M, D_left, D_right, G)]
    value = np.empty(len(parts[0]))
    for start in range(0, len(value), CHUNK):
        some = slice(start, start + CHUNK)
        M, *multipliers = (part[some] for part in parts)
        value[some] = _certified(M, structure, *structured(structure, *multipliers))
    return value.reshape(batch)


def _certified(
    M: ComplexArray,
    structure: Structure,
    D_left: ComplexArray,
    D_right: ComplexArray,
    G: ComplexArray,
) -> NDArray[np.float64]:
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

        proper = np.logical_and.reduce([_finite(part) for part in (X, Y, D, R)])
        X, Y, D, R = (
            np.where(proper[..., None, None], part, np.eye(*part.shape[-2:]))
            for part in (X, Y, D, R)
        )
        A, spread = _products(X, Y, D)
        proper, top, error = _largest(A, spread, R, structure, proper)
        square = np.maximum(top + error, 0.0)
        doubtful = proper & (error > CLEAR * square)
        if doubtful.any():
            square = np.array(square)
            square[doubtful] = np.minimum(
                square[doubtful], _searched(A[doubtful], spread[doubtful], R[doubtful])
            )
        value = np.sqrt(square) * (1 + 8 * EPS) * again * size
    return np.where(proper & np.isfinite(value), value, np.inf)


def _products(
    X: ComplexArray, Y: ComplexArray, D: ComplexArray
) -> tuple[ComplexArray, NDArray[np.float64]]:
    """A = X^H D X + j (Y X - X^H Y^H), and a bound of its entries' rounding in units of eps."""
    twisted = 1j * (Y @ X)
    size = np.abs(X)
    twisted_size = np.abs(Y) @ size
    count = 4 * (sum(X.shape[-2:]) + 8)
    spread = size.mT @ (np.abs(D) @ size) + twisted_size + twisted_size.mT
    return X.conj().mT @ (D @ X) + twisted + twisted.conj().mT, count * spread


def _largest(
    A: ComplexArray,
    spread: NDArray[np.float64],
    R: ComplexArray,
    structure: Structure,
    proper: NDArray[np.bool_],
) -> tuple[NDArray[np.bool_], NDArray[np.float64], NDArray[np.float64]]:
    """Where R > 0, the largest eigenvalue of the pencil (A, R), and a bound of its error."""
    allowance = 4 * (2 * A.shape[-1] + 8) * EPS
    if all(isinstance(block, Full) or block.rows == 1 for block in structure):
        least = _diagonal(R).min(-1)
        proper = proper & (least > 0)
        root = np.where(proper[..., None], _diagonal(R), 1.0) ** -0.5
        N = A * root[..., :, None] * root[..., None, :]
        stretch = np.ones_like(least)
    else:
        # What is positive in the frame of D_r is so in that of D_l: the blocks are the same.
        values, vectors = np.linalg.eigh(R)
        least = values[..., 0] - allowance * _norm(R)
        proper = proper & (least > 0)
        root = np.where(proper[..., None], values, 1.0) ** -0.5
        N = root[..., :, None] * (vectors.conj().mT @ A @ vectors) * root[..., None, :]
        stretch = 1 + _norm(R) / np.where(proper, least, 1.0)
    N = np.where(proper[..., None, None], N, 0.0)
    rounding = EPS * _norm(spread) / np.where(proper, least, 1.0)
    top = np.asarray(np.linalg.eigvalsh(N)[..., -1], dtype=float)
    return proper, top, rounding + allowance * stretch * _norm(N)


def _searched(A: ComplexArray, spread: NDArray[np.float64], R: ComplexArray) -> NDArray[np.float64]:
    """The least t, nearly, for which t R - A is positive beyond rounding; infinite without one."""
    count = 4 * (2 * A.shape[-1] + 8)

    def holds(t: NDArray[np.float64]) -> NDArray[np.bool_]:
        scaled = t[:, None, None] * R
        bound = spread + count * (np.abs(scaled) + np.abs(A))
        root = np.where(_diagonal(bound) > 0, _diagonal(bound) / count, 1.0) ** -0.5
        S = (scaled - A) * root[:, :, None] * root[:, None, :]
        S = np.where(np.isfinite(S), S, 0.0)
        rounding = EPS * (_norm(bound * root[:, :, None] * root[:, None, :]) + count * _norm(S))
        return np.linalg.eigvalsh(S)[:, 0] > rounding

    high = np.full(len(A), 2.0**-100)
    found = holds(np.zeros(len(A)))
    low = np.where(found, -1.0, 0.0)
    high[found] = 0.0
    for _ in range(25):  # by 2^8 each, to 2^100
        found = found | holds(high)
        low = np.where(found, low, high)
        high = np.where(found, high, 256.0 * high)
    low, top = np.maximum(low, high / 256.0), high
    for _ in range(SEARCH):  # of the exponent first, then of what is left of it
        middle = np.sqrt(low * high)
        passed = holds(middle)
        low, high = np.where(passed, low, middle), np.where(passed, middle, high)
    return np.where(found, np.where(top > 0, high, 0.0), np.inf)


def _hermitian(matrix: ComplexArray) -> ComplexArray:
    return (matrix + matrix.conj().mT) / 2


def _finite(matrix: NDArray[Any]) -> NDArray[np.bool_]:
    return np.asarray(np.isfinite(matrix).all((-2, -1)))


def _diagonal(matrix: NDArray[Any]) -> NDArray[np.float64]:
    return np.diagonal(matrix, axis1=-2, axis2=-1).real


def _norm(matrix: NDArray[Any]) -> NDArray[np.float64]:
    """Frobenius norms, without overflow of the entries' squares."""
    size = _power(np.abs(matrix).max((-2, -1), initial=0.0))
    scaled = matrix / size[..., None, None]
    return np.sqrt((scaled.real**2 + scaled.imag**2).sum((-2, -1))) * size


def _power(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The power of two next below each positive value; 1 for zero."""
    exponent = np.frexp(values)[1] - 1
    return np.where(values > 0, np.ldexp(1.0, exponent), 1.0)
