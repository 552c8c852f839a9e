"""Factors of Gramians, P = S S^T and Q = R^T R, and the projections that balance a system.

The Gramians themselves are never formed, because rounding would destroy their small eigenvalues
(S. Hammarling, Numerical solution of the stable, non-negative definite Lyapunov equation, IMA J.
Numerical Analysis 2 (1982) 303-323; SLICOT SB03OD).
"""

from __future__ import annotations

import warnings

import numpy as np

from workbench._core.arrays import EPS, RealArray
from workbench.errors import InputError
from workbench.solvers import slicot_routine


def gramian_factors(A: RealArray, B: RealArray, C: RealArray) -> tuple[RealArray, RealArray]:
    """Factors S and R of the Gramians P = S S^T and Q = R^T R of a stable system.

    Raises InputError if the Gramians do not exist.
    """
    if not len(A):
        return np.zeros((0, 0)), np.zeros((0, 0))
    return _hammarling(A.T, B.T).T, _hammarling(A, C)


def _hammarling(A: RealArray, C: RealArray) -> RealArray:
    """Upper triangular R with A^T R^T R + R^T R A = -C^T C."""
    sb03od = slicot_routine("sb03od")
    from slycot.exceptions import SlycotResultWarning

    n = len(A)
    # SLICOT overwrites its arguments: the factor replaces C, and slycot provides room for n rows.
    rows = np.asarray(np.linalg.qr(C, mode="r")) if len(C) > n else C
    place = np.zeros((n, n))
    place[: len(rows)] = rows
    with warnings.catch_warnings():
        warnings.simplefilter("error", SlycotResultWarning)
        try:
            U, scale, _ = sb03od(n, len(rows), A.copy(), np.zeros((n, n)), place, "C")
        except SlycotResultWarning as warning:
            raise InputError(
                f"the Gramians do not exist: {' '.join(str(warning).split())}"
            ) from None
    return np.asarray(U) / scale


def balancing_projections(S: RealArray, R: RealArray) -> tuple[RealArray, RealArray, RealArray]:
    """Left and right projections onto the minimal part, and its (weighted) Hankel singular values.

    S and R are factors of the Gramians, from `gramian_factors`.
    """
    if not S.size:
        return np.zeros((0, len(S))), np.zeros((len(S), 0)), np.zeros(0)
    product = R @ S
    if not np.isfinite(product).all():
        raise InputError("the Gramians overflow doubles; measure time or signals in other units")
    U, values, Vh = np.linalg.svd(product)
    rank = int((values > len(S) * EPS * values[0]).sum())
    values, root = values[:rank], np.sqrt(values[:rank])
    left = (U[:, :rank] / root).T @ R
    right = S @ Vh[:rank].T / root
    return left, right, values
