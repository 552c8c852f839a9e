"""Quadratic functions V = x' P x compared, with the rounding errors on the safe side."""

from __future__ import annotations

import numpy as np

from workbench.arrays import RealArray


def _scaled(P: RealArray, units: RealArray) -> RealArray:
    """P with rows and columns divided by units."""
    return P / units[:, None] / units


def least_eigenvalue(P: RealArray) -> float:
    """Least eigenvalue of P scaled to unit diagonal; the least diagonal entry if not positive."""
    diagonal = np.diag(P)
    if diagonal.min() <= 0.0:
        return float(diagonal.min())
    return float(np.linalg.eigvalsh(_scaled((P + P.T) / 2, np.sqrt(diagonal)))[0])


def largest_ratio(M: RealArray, P: RealArray) -> float:
    """Largest ratio of x' M x to x' P x over x and a batch of M, rounded up."""
    units = np.sqrt(np.diag(P))
    L = np.linalg.cholesky(_scaled((P + P.T) / 2, units))
    inner = np.linalg.solve(L, np.linalg.solve(L, M / units[:, None] / units).mT)
    return outward(P) * float(np.linalg.eigvalsh((inner + inner.mT) / 2)[..., -1].max())


def outward(P: RealArray) -> float:
    """Factor that rounds ratios of quadratic functions to x' P x upward.

    For P of unit diagonal, the rounding error grows as its least eigenvalue falls.
    """
    return 1.0 + len(P) ** 2 * np.finfo(float).eps / max(least_eigenvalue(P), np.finfo(float).eps)
