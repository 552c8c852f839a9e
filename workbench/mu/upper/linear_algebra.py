"""Dense linear algebra for the many small systems of the upper bound.

The functions are plain loops, because a call of LAPACK takes longer than the work on matrices this
small. They write their results into arrays of the caller. None of them raises an error: a matrix
that is not positive definite is reported by the return value.
"""

from __future__ import annotations

import numpy as np

from workbench._core.compiled import compiled, unchecked_kernel

UNSEEN_PIVOT = 1e100
"""Pivot used for an unknown without influence on H; its step then becomes zero. The step is divided
by its square, 1e200. Half or double changes nothing.
"""
LOST_PIVOT = 1e-14
"""A pivot below this share of the original diagonal entry is lost in rounding. It is 45 roundings,
as a sum over some dozens of unknowns has. With half of it rounding may be taken for a pivot; with
double of it paths end an iteration earlier.
"""
DAMPINGS = (0.0, 1e-12, 1e-10, 1e-8, 1e-6)
"""Shares by which the diagonal of H is raised, one after the other, until no pivot is lost."""


@unchecked_kernel
def factor(A: np.ndarray, L: np.ndarray) -> bool:
    """Write the Cholesky factor of a Hermitian A to the lower half of L; False unless A > 0."""
    n = A.shape[0]
    for i in range(n):
        for j in range(i + 1):
            L[i, j] = A[i, j]
    for k in range(n):
        pivot = L[k, k].real
        if not 0.0 < pivot < np.inf:
            return False
        root = np.sqrt(pivot)
        L[k, k] = root
        scale = 1.0 / root
        for i in range(k + 1, n):
            L[i, k] *= scale
        for i in range(k + 1, n):
            entry = L[i, k]
            for j in range(k + 1, i + 1):
                L[i, j] -= entry * np.conj(L[j, k])
    return True


@unchecked_kernel
def inverse_from_factor(L: np.ndarray, work: np.ndarray, X: np.ndarray) -> None:
    """Write the inverse (L L^H)^-1 to X; ``work`` receives L^-1."""
    n = L.shape[0]
    for j in range(n):
        for i in range(j):
            work[i, j] = 0.0
        work[j, j] = 1.0 / L[j, j].real
        for i in range(j + 1, n):
            total = L[i, j] * work[j, j]
            for k in range(j + 1, i):
                total += L[i, k] * work[k, j]
            work[i, j] = total * (-1.0 / L[i, i].real)
    for i in range(n):
        for j in range(i + 1):
            total = np.conj(work[i, i]) * work[i, j]
            for k in range(i + 1, n):
                total += np.conj(work[k, i]) * work[k, j]
            X[i, j] = total
            X[j, i] = np.conj(total)


@unchecked_kernel
def multiply(A: np.ndarray, B: np.ndarray, X: np.ndarray) -> None:
    """Write the product A B to X; zeros of A are skipped."""
    X[:] = 0.0
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            entry = A[i, k]
            if entry != 0.0:
                for j in range(B.shape[1]):
                    X[i, j] += entry * B[k, j]


@unchecked_kernel
def multiply_adjoint(A: np.ndarray, B: np.ndarray, X: np.ndarray) -> None:
    """Write the product A B^H to X."""
    for i in range(A.shape[0]):
        for j in range(B.shape[0]):
            total = A[i, 0] * np.conj(B[j, 0])
            for k in range(1, A.shape[1]):
                total += A[i, k] * np.conj(B[j, k])
            X[i, j] = total


@unchecked_kernel
def copy(x: np.ndarray, y: np.ndarray) -> None:
    """Set y = x for vectors, entry by entry: copying slices would make Numba compile their error
    messages too.
    """
    for k in range(x.size):
        y[k] = x[k]


@unchecked_kernel
def inner(A: np.ndarray, B: np.ndarray) -> float:
    """The real part of trace(A^H B), which for Hermitian A and B is their inner product."""
    total = 0.0
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            total += A[i, j].real * B[i, j].real + A[i, j].imag * B[i, j].imag
    return total


@unchecked_kernel
def make_hermitian(A: np.ndarray) -> None:
    """Replace A by (A + A^H) / 2."""
    for i in range(A.shape[0]):
        for j in range(i + 1):
            mean = 0.5 * (A[i, j] + np.conj(A[j, i]))
            A[i, j] = mean
            A[j, i] = np.conj(mean)


@compiled
def factor_normal(H: np.ndarray) -> None:
    """Replace the upper half of a symmetric real H >= 0 by the R of its factors R^T R.

    The lower half is overwritten. Near the end of a path, H varies steeply in few directions, and
    the rounding in these hides the other directions, in which the bound hardly changes. Then the
    diagonal is raised, which holds back steps in flat directions, as a proximal term would. A pivot
    that is still lost, or an unknown without influence on H, gets a nearly infinite pivot, so that
    a solution leaves that unknown unchanged.
    """
    m = H.shape[0]
    diagonal = np.empty(m)
    for i in range(m):
        diagonal[i] = H[i, i]
        for k in range(i):
            H[i, k] = H[k, i]
    for attempt in range(len(DAMPINGS)):
        for i in range(m):
            H[i, i] = (1.0 + DAMPINGS[attempt]) * diagonal[i]
            for j in range(i + 1, m):
                H[i, j] = H[j, i]
        if _factored(H, diagonal, attempt == len(DAMPINGS) - 1):
            return


@unchecked_kernel
def _factored(H: np.ndarray, diagonal: np.ndarray, last: bool) -> bool:
    """Replace the upper half of H by R, row by row; stop at a lost pivot unless it is the last
    attempt. Return whether R is complete. Four rows above are subtracted at once, to save reads and
    writes.
    """
    m = H.shape[0]
    for i in range(m):
        fours = i - i % 4
        for k in range(0, fours, 4):
            one, two, three, four = H[k, i], H[k + 1, i], H[k + 2, i], H[k + 3, i]
            for j in range(i, m):
                upper = one * H[k, j] + two * H[k + 1, j]
                H[i, j] -= upper + (three * H[k + 2, j] + four * H[k + 3, j])
        for k in range(fours, i):
            entry = H[k, i]
            for j in range(i, m):
                H[i, j] -= entry * H[k, j]
        seen = H[i, i] > LOST_PIVOT * diagonal[i]
        if not (seen or last or diagonal[i] == 0.0):
            return False
        root = np.sqrt(H[i, i]) if seen else UNSEEN_PIVOT
        H[i, i] = root
        scale = 1.0 / root
        for j in range(i + 1, m):
            H[i, j] *= scale
    return True


@compiled
def solve_normal(R: np.ndarray, b: np.ndarray, x: np.ndarray) -> None:
    """Solve R^T R x = b."""
    m = R.shape[0]
    for i in range(m):
        x[i] = b[i]
    for k in range(m):
        x[k] /= R[k, k]
        for i in range(k + 1, m):
            x[i] -= R[k, i] * x[k]
    for i in range(m - 1, -1, -1):
        total = x[i]
        for k in range(i + 1, m):
            total -= R[i, k] * x[k]
        x[i] = total / R[i, i]
