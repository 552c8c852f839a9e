"""Parts of a Newton step along the central path of the upper bound."""

from __future__ import annotations

import numpy as np

from workbench._core.compiled import compiled, unchecked_kernel
from workbench.mu.upper.linear_algebra import factor, make_hermitian, multiply, multiply_adjoint
from workbench.mu.upper.pattern import IM, RE, Pattern

BOUNDARY_SHARE = 0.95
"""Share of the distance to the boundary that a step covers. On the boundary itself nothing can be
inverted. Half of the distance from 1 goes nearer, and later steps may be shorter; double takes more
iterations.
"""


@compiled
def square(n: int) -> np.ndarray:
    """A square complex matrix of zeros."""
    return np.zeros((n, n), np.complex128)


@unchecked_kernel
def reach(
    A: np.ndarray,
    first: np.ndarray,
    second: np.ndarray,
    trial: np.ndarray,
    L: np.ndarray,
    blur: float,
) -> float:
    """A step a <= 1 for which A + a first + a^2 second stays positive definite.

    The step is `BOUNDARY_SHARE` of the longest one, which is found to a relative accuracy of
    ``blur``. ``trial`` and ``L`` are work space.
    """
    low, high = 0.0, 1.0 / BOUNDARY_SHARE
    step = high
    for _ in range(60):
        for i in range(A.shape[0]):
            for j in range(i + 1):
                trial[i, j] = A[i, j] + step * (first[i, j] + step * second[i, j])
        if factor(trial, L):
            low = step
        else:
            high = step
        if low > 0.0 and high - low < blur * high:
            break
        step = 0.5 * (low + high)
    return BOUNDARY_SHARE * low


@compiled
def hessian(
    pattern: Pattern, t: float, T: np.ndarray, U: np.ndarray, H: np.ndarray, value: np.ndarray
) -> None:
    """Set the upper half of H[k, l] = Re trace(E_k T E_l U), E_k the sparse derivatives of K.

    K is the matrix of the inequality in `Pattern`; ``value`` is work space for its entries. The
    real and the imaginary part of an entry have the same products of T and U.
    """
    for e in range(value.size):
        value[e] = pattern.fixed[e] + t * pattern.growing[e]
    first, at, to, turn, kind = pattern.first, pattern.at, pattern.to, pattern.turn, pattern.kind
    for other in range(H.shape[0]):
        if kind[other] == IM:
            continue
        for k in range(other, H.shape[0]):
            if kind[k] == IM:
                continue
            both, left, right, none = 0.0, 0.0, 0.0, 0.0
            for e in range(first[k], first[k + 1]):
                for f in range(first[other], first[other + 1]):
                    part = value[e] * value[f] * (T[to[e], at[f]] * U[to[f], at[e]])
                    none += part.real
                    left -= turn[e] * part.imag
                    right -= turn[f] * part.imag
                    both -= turn[e] * turn[f] * part.real
            H[other, k] = none
            if kind[k] == RE:
                H[other, k + 1] = left
            if kind[other] == RE:
                H[other + 1, k] = right  # for k = other, this is below the diagonal
            if kind[k] == RE and kind[other] == RE:
                H[other + 1, k + 1] = both


@unchecked_kernel
def add_positivity(pattern: Pattern, D_inverse: np.ndarray, W: np.ndarray, H: np.ndarray) -> None:
    """Add Re trace(e_k D^-1 e_l W) to the upper half of H, e_k the basis of the compact D."""
    row, column, kind = pattern.row, pattern.column, pattern.kind
    for k in range(H.shape[0]):
        if pattern.skew[k]:
            break
        a, b = row[k], column[k]
        v = 1j if kind[k] == IM else 1.0 + 0j
        for other in range(k + 1):
            p, q = row[other], column[other]
            w = 1j if kind[other] == IM else 1.0 + 0j
            total = v * D_inverse[b, p] * w * W[q, a]
            if p != q:
                total += v * D_inverse[b, q] * np.conj(w) * W[p, a]
            if a != b:
                total += np.conj(v) * D_inverse[a, p] * w * W[q, b]
                if p != q:
                    total += np.conj(v) * D_inverse[a, q] * np.conj(w) * W[p, b]
            H[other, k] += total.real


@unchecked_kernel
def sandwich(M: np.ndarray, X: np.ndarray, MX: np.ndarray, MXM: np.ndarray, T: np.ndarray) -> None:
    """Set T = P X P^H with P = [M; I] and a Hermitian X; MX and MXM receive M X and M X M^H."""
    c, r = M.shape
    multiply(M, X, MX)
    multiply_adjoint(MX, M, MXM)
    for i in range(c):
        for j in range(c):
            T[i, j] = MXM[i, j]
        for j in range(r):
            T[i, c + j] = MX[i, j]
            T[c + j, i] = np.conj(MX[i, j])
    for i in range(r):
        for j in range(r):
            T[c + i, c + j] = X[i, j]


@unchecked_kernel
def multiplier_step(
    S_inverse: np.ndarray, dS: np.ndarray, Z: np.ndarray, work: np.ndarray, dZ: np.ndarray
) -> None:
    """Set dZ to -Z minus the Hermitian part of S^-1 dS Z."""
    multiply(dS, Z, work)
    multiply(S_inverse, work, dZ)
    make_hermitian(dZ)
    for i in range(Z.shape[0]):
        for j in range(Z.shape[0]):
            dZ[i, j] = -Z[i, j] - dZ[i, j]
