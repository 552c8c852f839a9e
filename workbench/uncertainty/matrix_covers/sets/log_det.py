"""Slope and curvature of -log det(I - M M^*) when M moves to exp(A) (M - z) exp(B)."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench.uncertainty.matrix_covers.sets.shapes import ctranspose


def log_det_derivatives(
    M: Array, A: Array, B: Array, z: Array, moving: int
) -> tuple[RealArray, RealArray]:
    """Slope (F, a + b + c) and curvature (F, a + b + c, a + b + c) of the sum over matrices.

    Parameters
    ----------
    M
        Matrices (F, N, p, m) with norms below 1.
    A, B
        Hermitian directions (a, p, p) and (b, m, m).
    z, moving
        Directions (c, p, m) of z; z moves the first ``moving`` matrices, not those after them.
    """
    F, N, p, m = M.shape
    a, b, c = len(A), len(B), len(z)
    Mh = ctranspose(M)
    S = np.linalg.inv(np.eye(p) - M @ Mh)
    AM = np.einsum("dij,fkjl->fdkil", A, M)
    MB = np.einsum("fkij,djl->fdkil", M, B)
    minus = np.zeros((F, c, N, p, m), complex)
    minus[:, :, :moving] = -z[None, :, None]
    first = np.concatenate([AM, MB, minus], axis=1)
    root = ctranspose(np.linalg.cholesky(S))  # S = root^* root
    V = root[:, None] @ first
    SM = S @ M
    slope = 2 * np.einsum("fkij,fdkij->fd", SM.conj(), first).real
    K = V @ ctranspose((root @ M)[:, None])
    K = K + ctranspose(K)
    curvature = 2 * _gram(V, V) + _gram(K, K)
    # contribution of the second derivatives of M
    left = (SM @ Mh).sum(axis=1)
    right = (Mh @ SM).sum(axis=1)
    C = ctranspose(SM[:, :moving].sum(axis=1))
    AA = np.einsum("dij,ejk,fki->fde", A, A, left).real
    BB = np.einsum("dij,ejk,fki->fde", B, B, right).real
    SMB = np.einsum("fkij,djl->fdkil", SM, B)
    AB = 2 * _gram(AM, SMB)
    Az = -2 * np.einsum("fij,djk,eki->fde", C, A, z).real
    zB = -2 * np.einsum("fij,eik,dkj->fde", C.swapaxes(-2, -1), z, B).real
    more = np.zeros_like(curvature)
    more[:, :a, :a] = AA + AA.swapaxes(1, 2)
    more[:, a : a + b, a : a + b] = BB + BB.swapaxes(1, 2)
    more[:, :a, a : a + b] = AB
    more[:, :a, a + b :] = Az
    more[:, a : a + b, a + b :] = zB
    more[:, a : a + b, :a] = AB.swapaxes(1, 2)
    more[:, a + b :, :a] = Az.swapaxes(1, 2)
    more[:, a + b :, a : a + b] = zB.swapaxes(1, 2)
    return slope, curvature + more


def log_det_value(M: Array) -> RealArray:
    """Sum (F,) over the matrices (F, N, p, m); infinite where a norm is not below 1."""
    values = np.linalg.eigvalsh(np.eye(M.shape[-2]) - M @ ctranspose(M))
    inside = (values > 0).all(axis=(1, 2))
    value = -np.log(np.where(values > 0, values, 1.0)).sum(axis=(1, 2))
    found: RealArray = np.where(inside, value, np.inf)
    return found


def _gram(first: Array, second: Array) -> RealArray:
    """Real inner products (f, d, e) of complex matrices (f, d, ...) and (f, e, ...)."""
    rows, columns = (
        np.ascontiguousarray(each.reshape(*each.shape[:2], -1)).view(float)
        for each in (first, second)
    )
    found: RealArray = rows @ columns.swapaxes(1, 2)
    return found
