"""Riccati equations by the stable subspace of their Hamiltonian."""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, matrix_balance, schur

from workbench.arrays import RealArray
from workbench.systems.realisation import EPS

ASYMMETRY = 1e-4
"""Of X1^T X2, relative: rounding errors make less, eigenvalues on the axis make it near 1."""
INDEFINITE = 1e-7
"""Negative eigenvalues of X, relative to the largest, that are rounding errors."""
NEAR_AXIS = 10.0
"""Multiple of the rounding error of a Hamiltonian up to which an eigenvalue may be imaginary."""
PAIRED = 1e-2
"""How far, relative, it may then be from its mirror image: rounding errors part imaginary ones."""
RUNAWAY = EPS**-0.5
"""Factors of a balance from here on say that a state is not coupled, not that it is large."""


def hamiltonian_solution(H: RealArray) -> RealArray | None:
    """Ric(H): X = X2 X1^-1 of the stable subspace of a Hamiltonian; None unless X >= 0."""
    n = len(H) // 2
    if n == 0:
        return np.zeros((0, 0))
    if not np.isfinite(H).all():
        return None
    if not H[n:, :n].any() and np.linalg.eigvals(H[:n, :n]).real.max() < 0.0:
        return np.zeros((n, n))  # what costs nothing and is stable is left alone
    # A balance that keeps the structure, as of SciPy's own equations.
    with np.errstate(invalid="ignore"):  # SciPy makes integers of the factors, which is not used
        factor = matrix_balance(H - np.diag(np.diag(H)), permute=False, separate=True)[1][0]
    half = np.exp2(np.round(np.log2(factor[:n] / factor[n:]) / 2))
    X = _balanced_solution(H, half)
    # States that only rounding errors couple to others may have been taken to any size.
    alone = (half >= RUNAWAY) | (half <= 1.0 / RUNAWAY)
    if X is None and alone.any():
        X = _balanced_solution(H, np.where(alone, 1.0, half))
    return X


def _balanced_solution(H: RealArray, half: RealArray) -> RealArray | None:
    """The same with states in units (n,)."""
    n = len(half)
    scale = np.concatenate([half, 1.0 / half])
    H = H / scale[:, None] * scale
    try:
        T, U, stable = schur(H, sort="lhp", check_finite=False)
    except LinAlgError:  # eigenvalues so near the axis that sorting moves them across
        return None
    if stable != n:
        return None
    # Of the real Schur form the diagonal has the real parts; eigenvalues have mirror images.
    left, right = -float(np.diag(T)[:n].max()), float(np.diag(T)[n:].min())
    rounding, nearest = EPS * float(np.linalg.norm(H)), min(left, right)
    known = nearest > NEAR_AXIS * rounding
    if not known and abs(left - right) > PAIRED * nearest:
        return None
    X1, X2 = U[:n, :n], U[n:, :n]
    product = X1.T @ X2
    largest = max(float(np.abs(product).max()), rounding / nearest if known else 0.0)
    if np.abs(product - product.T).max() > ASYMMETRY * largest:
        return None
    try:
        X = np.linalg.solve(X1.T, X2.T)
    except LinAlgError:
        return None
    error = rounding / nearest if known else float(np.abs(X - X.T).max())
    X = (X + X.T) / 2
    if not np.isfinite(X).all():
        return None
    values = np.linalg.eigvalsh(X)
    if values[0] < -INDEFINITE * max(values[-1], 0.0) - NEAR_AXIS * error:
        return None
    return X / half[:, None] / half
