"""Gramians by their factors, P = S S^T and Q = R^T R, and the projections that balance them.

The Gramians themselves are never formed: of their small eigenvalues nothing would be left (S.
Hammarling, Numerical solution of the stable, non-negative definite Lyapunov equation, IMA J.
Numerical Analysis 2 (1982) 303-323; SLICOT SB03OD).
"""

from __future__ import annotations

import warnings

import numpy as np

from workbench.arrays import RealArray
from workbench.errors import InputError
from workbench.systems.realisation import EPS


def factors(A: RealArray, B: RealArray, C: RealArray) -> tuple[RealArray, RealArray]:
    """S and R with P = S S^T and Q = R^T R the Gramians of a stable system."""
    if not len(A):
        return np.zeros((0, 0)), np.zeros((0, 0))
    return _hammarling(A.T, B.T).T, _hammarling(A, C)


def _hammarling(A: RealArray, C: RealArray) -> RealArray:
    """Upper triangular R with A^T R^T R + R^T R A = -C^T C."""
    from slycot import sb03od
    from slycot.exceptions import SlycotResultWarning

    n = len(A)
    # SLICOT works in the arrays that it is given, puts the factor where C was, and slycot gives it
    # room for n rows.
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


def balancing(S: RealArray, R: RealArray) -> tuple[RealArray, RealArray, RealArray]:
    """Left and right projection on the minimal part, and its (weighted) Hankel singular values."""
    if not S.size:
        return np.zeros((0, len(S))), np.zeros((len(S), 0)), np.zeros(0)
    U, values, Vh = np.linalg.svd(R @ S)
    rank = int((values > len(S) * EPS * values[0]).sum())
    values, root = values[:rank], np.sqrt(values[:rank])
    left = (U[:, :rank] / root).T @ R
    right = S @ Vh[:rank].T / root
    return left, right, values
