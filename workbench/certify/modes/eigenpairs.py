"""Approximate eigenvalues and eigenvectors to many digits.

LAPACK finds them in doubles. Newton's method adds digits: with the residual R = A V - V L in many
digits, the part X of V^-1 R between modes vanishes to first order if V becomes V (I + E), where
E_ij = X_ij / (L_jj - L_ii). The eigenvalues of a cluster share a block of L and are not separated.
If Newton's method does not converge, the QR iteration in many digits is used, which takes ten times
as long. Nothing here is a proof.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from workbench._core.arrays import Array, ComplexArray

CLUSTER = 2.0**-16
"""Poles closer than this share of their size are kept together in one mode. The correction between
two poles is divided by their distance, which has 37 of the 53 bits of a double at this limit. With
half of it Newton's method fails more often; with double of it modes are larger.
"""
STEPS = 12
"""Largest number of steps of Newton's method. Each adds the digits of a double, less the digits
that nearly dependent eigenvectors cost. For 512 bits it takes ten steps without a loss. With half
of them the slow QR iteration is used for many digits; double helps only where eigenvectors are
nearly dependent.
"""
LOST_DIGITS = 24
"""Number of bits, fewer than those of the balls, to which eigenvectors are corrected. Rounding of
products with sizes of up to 2^24 hides smaller corrections. With half of them Newton's method is
given up more often; with double of them enclosures have 24 bits less. None of the nearest tests
feels either.
"""
CONVERGING = 0.1
"""Newton's method is given up unless each correction is below this share of the one before. Slower
steps, of less than a digit, would not reach the precision within `STEPS`. Half or double changes
how soon the slow QR iteration is used.
"""


def eigenpairs(A: Any, bits: int) -> tuple[list[complex], Any]:
    """Eigenvalues of a real matrix of balls (n, n), and eigenvectors as columns of an `acb_mat`."""
    import flint

    found = _refined(A.mid(), bits)
    if found is None:
        values, vectors = flint.acb_mat(A).eig(right=True, algorithm="approx", nonstop=True)
        return [complex(value.mid()) for value in values], vectors
    return found


def _refined(A: Any, bits: int) -> tuple[list[complex], Any] | None:
    """The eigenpairs by Newton's method from those in doubles; None if it does not converge."""
    import flint

    try:
        values, start = np.linalg.eig(_doubles(A).real)
        back = np.linalg.inv(start)
    except np.linalg.LinAlgError:  # true for entries that are not finite, too
        return None
    values = values.astype(complex)
    distance = values - values[:, None]
    size = np.abs(values)
    together = np.abs(distance) < CLUSTER * np.maximum.outer(size, size)
    np.fill_diagonal(together, True)
    distance[together] = 1.0
    if not distance.all():
        return None
    start = start.astype(complex)
    A, V, L = flint.acb_mat(A), _balls(start), _balls(np.diag(values))
    pairs = np.argwhere(together).tolist()
    before = np.inf
    for _ in range(STEPS):
        X = back @ _doubles(A * V - _times_blocks(V, L, pairs))
        E = np.where(together, 0.0, X) / distance
        change = float(np.abs(E).max(initial=0.0))
        if not change < CONVERGING * before:
            return None
        if change < 2.0 ** (LOST_DIGITS - bits):
            return values.tolist(), V
        before = change
        V = (V + _balls(start @ E)).mid()
        L = L + _balls(np.where(together, X, 0.0))
    return None


def _times_blocks(V: Any, L: Any, pairs: Sequence[Sequence[int]]) -> Any:
    """V L of an L with entries at pairs (i, j) only."""
    import flint

    n = V.nrows()
    product = flint.acb_mat(n, n)
    for i, j in pairs:
        factor = L[i, j]
        for k in range(n):
            product[k, j] += V[k, i] * factor
    return product


def _doubles(matrix: Any) -> ComplexArray:
    """The midpoints of a matrix of balls."""
    shape = matrix.nrows(), matrix.ncols()
    return np.array([complex(entry.mid()) for entry in matrix.entries()]).reshape(shape)


def _balls(matrix: Array) -> Any:
    """A matrix of numbers as complex balls of radius 0."""
    import flint

    rows, columns = matrix.shape
    return flint.acb_mat(rows, columns, matrix.astype(complex).ravel().tolist())
