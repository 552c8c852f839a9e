"""Riccati equations solved by the stable subspace of their Hamiltonian, and coprime factors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import (
    LinAlgError,
    matrix_balance,
    schur,
    solve_continuous_are,
    solve_discrete_are,
)

from workbench._core.arrays import EPS, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError, SolverError
from workbench.systems.balancing import balanced, singular, speed, state_units
from workbench.systems.bilinear import to_continuous
from workbench.systems.realisation import Matrices, realisation

ASYMMETRY_TOLERANCE = 1e-4
"""Largest asymmetry of X1^T X2, relative to its largest entry. Rounding errors cause less than
this; eigenvalues on the imaginary axis cause an asymmetry near 1."""
NEGATIVE_EIGENVALUE_TOLERANCE = 1e-7
"""Negative eigenvalues of X up to this share of the largest eigenvalue count as rounding errors of
zero.
"""
AXIS_ROUNDING = 10.0
"""An eigenvalue may be imaginary if its real part is below this multiple of the Hamiltonian's
rounding error.
"""
MIRROR_TOLERANCE = 1e-2
"""Largest relative distance of such an eigenvalue from its mirror image about the axis. Rounding
errors move truly imaginary eigenvalues farther apart.
"""
DECOUPLED_FACTOR = EPS**-0.5
"""A balancing factor beyond this, or below its reciprocal, means that a state is not coupled to
others; it says nothing about the state's size."""


def hamiltonian_solution(H: RealArray) -> RealArray | None:
    """Ric(H) = X2 X1^-1 where [X1; X2] spans the stable subspace of H; None unless Ric(H) >= 0."""
    n = len(H) // 2
    if n == 0:
        return np.zeros((0, 0))
    if not np.isfinite(H).all():
        return None
    if not H[n:, :n].any() and np.linalg.eigvals(H[:n, :n]).real.max() < 0.0:
        return np.zeros((n, n))  # a stable system without cost needs no feedback
    # Balance in a way that keeps the structure of H, as SciPy's Riccati solvers do.
    with np.errstate(invalid="ignore"):  # SciPy also casts the factors to integers, unused here
        factor = matrix_balance(H - np.diag(np.diag(H)), permute=False, separate=True)[1][0]
    half = np.exp2(np.round(np.log2(factor[:n] / factor[n:]) / 2))
    X = _balanced_solution(H, half)
    # Balancing gives arbitrary factors to states that only rounding errors couple to others.
    alone = (half >= DECOUPLED_FACTOR) | (half <= 1.0 / DECOUPLED_FACTOR)
    if X is None and alone.any():
        X = _balanced_solution(H, np.where(alone, 1.0, half))
    return X


def _balanced_solution(H: RealArray, half: RealArray) -> RealArray | None:
    """Solution of `hamiltonian_solution`, computed with states scaled by `half` (n,)."""
    n = len(half)
    scale = np.concatenate([half, 1.0 / half])
    H = H / scale[:, None] * scale
    try:
        T, U, stable = schur(H, sort="lhp", check_finite=False)
    except LinAlgError:  # eigenvalues so near the axis that sorting moves them to the other side
        return None
    if stable != n:
        return None
    # The diagonal of a real Schur form holds the real parts; eigenvalues come in mirrored pairs.
    left, right = -float(np.diag(T)[:n].max()), float(np.diag(T)[n:].min())
    rounding, nearest = EPS * float(np.linalg.norm(H)), min(left, right)
    known = nearest > AXIS_ROUNDING * rounding
    if not known and abs(left - right) > MIRROR_TOLERANCE * nearest:
        return None
    X1, X2 = U[:n, :n], U[n:, :n]
    product = X1.T @ X2
    largest = max(float(np.abs(product).max()), rounding / nearest if known else 0.0)
    if np.abs(product - product.T).max() > ASYMMETRY_TOLERANCE * largest:
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
    if values[0] < -NEGATIVE_EIGENVALUE_TOLERANCE * max(values[-1], 0.0) - AXIS_ROUNDING * error:
        return None
    return X / half[:, None] / half


def sampled_solution(A: RealArray, B: RealArray, C: RealArray, D: RealArray) -> RealArray:
    """The stabilising X (n, n): u minimises the sum of |C x + D u|^2, x[k + 1] = A x[k] + B u[k].

    s = (z - 1) / (z + 1) gives a continuous-time equation with the same X (V. Mehrmann, IMA J.
    Numerical Analysis 16 (1996) 407-438). There time is scaled, so that poles may lie as near to
    z = 1 as fast sampling puts them. SciPy solves equations that this transformation does not
    suit, such as those with a pole at z = -1.

    Raises LinAlgError if there is no solution.
    """
    X = _solution_in_continuous_time(A, B, C, D)
    if X is not None:
        return X
    try:
        found: RealArray = solve_discrete_are(A, B, C.T @ C, D.T @ D, s=C.T @ D)
    except ValueError as error:
        raise LinAlgError(str(error)) from None
    return found


def _solution_in_continuous_time(
    A: RealArray, B: RealArray, C: RealArray, D: RealArray
) -> RealArray | None:
    """As `sampled_solution`; None where the transformed equation gives no solution."""
    try:
        (A, B, C, D), _, into = scaled_realisation((A, B, C, D), sampled=True)
    except InputError:
        return None
    R = D.T @ D
    if singular(R):
        return None
    gain = np.linalg.solve(R, D.T @ C)
    A, C = A - B @ gain, C - D @ gain
    X = hamiltonian_solution(np.block([[A, -B @ np.linalg.solve(R, B.T)], [-C.T @ C, -A.T]]))
    return None if X is None else into.T @ X @ into


class ScaledStates(NamedTuple):
    """A realisation with its unit of time 1 / ``rate``; its states are ``into`` x of the given
    x.
    """

    matrices: Matrices
    rate: float
    into: RealArray


def scaled_realisation(given: Matrices, *, sampled: bool) -> ScaledStates:
    """A realisation in continuous time, with time and states in units of its own.

    A sampled one is transformed by s = (z - 1) / (z + 1). If a transfer function is sampled fast,
    its states are nearly parallel. No units of the states separate them, but those of a Schur form
    are separated.

    Raises InputError for a pole at z = -1.
    """
    A, B, C, D = given
    U = np.eye(len(A))
    if sampled and len(A):
        T, U = schur(A)
        A, B, C, D = to_continuous((T, U.T @ B, C @ U, D))
    rate = speed(A, B, C)
    root = rate**0.5
    A, B, C = A / rate, B / root, C / root
    units = state_units(A, B, C)
    parts = A * units[:, None] / units, B * units[:, None], C / units, D
    return ScaledStates(parts, rate, units[:, None] * U.T)


FAR = 2.0**60
"""Rates [1/s] beyond this one, or below its reciprocal, are measured in another unit of time."""


def right_factors(P: StateSpace, name: str) -> StateSpace:
    """[N; M] with P = N M^-1 and N~ N + M~ M = 1, both stable; P in continuous time.

    Raises SolverError if there are none.
    """
    A, B, C = balanced(P.A, P.B, P.C)
    D = P.D
    a, b, c = (float(np.abs(part).max(initial=0.0)) for part in (A, B, C))
    fastest = max(a, b * c)
    if fastest > 0.0 and not (1 / FAR < fastest < FAR and max(b, c) < FAR):
        # Time and states are scaled by powers of two to units of their own.
        rate = float(np.exp2(np.round(np.log2(fastest))))
        unit = float(np.exp2(np.round(np.log2(c * rate / b) / 2))) if b * c > 0.0 else 1.0
        slow = right_factors(realisation((A / rate, B / rate * unit, C / unit, D), 0.0), name)
        return realisation((slow.A * rate, slow.B * rate, slow.C, slow.D), 0.0)
    R = np.eye(P.ninputs) + D.T @ D
    try:
        X = solve_continuous_are(A, B, C.T @ C, R, s=C.T @ D) if len(A) else np.zeros((0, 0))
    except (np.linalg.LinAlgError, ValueError) as error:
        raise SolverError(
            f"{name} has no normalised coprime factors ({error}): is a mode on the imaginary axis "
            "hidden, or moved by no input?"
        ) from None
    F = -np.linalg.solve(R, B.T @ X + D.T @ C)
    values, V = np.linalg.eigh(R)
    root = (V / np.sqrt(values)) @ V.T
    both = np.vstack([C + D @ F, F]), np.vstack([D, np.eye(P.ninputs)]) @ root
    found = realisation((A + B @ F, B @ root, *both), 0.0)
    if len(A) and not found.poles().real.max() < 0:
        raise SolverError(f"{name} has no normalised coprime factors: a pole is on the axis")
    return found
