"""Fewer states for a controller: balanced truncation, Glover's approximation, the closed loop's.

All are square-root methods, in scaled time and states (see `gramians`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import schur, solve_sylvester, sqrtm

from workbench.arrays import RealArray
from workbench.errors import InputError
from workbench.mu.frequency.peak import Peak
from workbench.systems.balancing import speed, state_units
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.gramians import balancing_projections, factors
from workbench.systems.minimal import ZERO_ROUNDING
from workbench.systems.realisation import EPS, Matrices

Reducer = Callable[[int], Matrices]
"""Gives the controller with at most that many states."""
EQUAL = 1e-9
"""Hankel singular values this close, relative, are one value with several states."""
SEEN = 1e-12
"""Hankel singular values that the approximation sees, over the largest: it divides by differences
of their squares, in which smaller ones are rounding errors."""


@dataclass(frozen=True, eq=False)
class Split:
    """K = kept + stable: the poles on the imaginary axis, by rounding, or right of it are kept."""

    kept: Matrices
    stable: Matrices

    @property
    def count(self) -> int:
        """Number of states kept."""
        return len(self.kept[0])

    def with_stable(self, other: Matrices) -> Matrices:
        """The kept part beside another stable one; the direct term is the other's."""
        (A1, B1, C1, _), (A2, B2, C2, D) = self.kept, other
        n, k = len(A1), len(A2)
        A = np.zeros((n + k, n + k))
        A[:n, :n], A[n:, n:] = A1, A2
        return A, np.vstack([B1, B2]), np.hstack([C1, C2]), D


def balanced(K: Matrices) -> tuple[int, Reducer]:
    """Balanced truncation of the stable part (B. Moore, IEEE Trans. Automatic Control 26 (1981)).

    Returns the least order, that of the part which is kept, and the reducer.
    """
    rate, parts = _scaled(K)
    split = _split(parts)
    A, B, C, D = split.stable
    S, R = factors(A, B, C)
    left, right, _ = balancing_projections(S, R)

    def of(order: int) -> Matrices:
        T, V = left[: order - split.count], right[:, : order - split.count]
        return _timed(split.with_stable((T @ A @ V, T @ B, C @ V, D)), rate)

    return split.count, of


def hankel(K: Matrices) -> tuple[int, Reducer]:
    """Optimal Hankel-norm approximation of the stable part; the direct term, which is free, stays.

    The Hankel norm of the error is the next singular value, the least that any stable system of
    the order has. Returns as `balanced`.

    References
    ----------
    K. Glover, All optimal Hankel-norm approximations of linear multivariable systems and their
    L-infinity-error bounds, Int. J. Control 39 (1984) 1115-1193, theorem 6.3.
    """
    rate, parts = _scaled(K)
    split = _split(parts)
    A, B, C, D = split.stable
    S, R = factors(A, B, C)
    left, right, values = balancing_projections(S, R)
    seen = int((values > SEEN * values.max(initial=0.0)).sum())
    left, right, values = left[:seen], right[:, :seen], values[:seen]
    minimal = left @ A @ right, left @ B, C @ right, D

    def of(order: int) -> Matrices:
        return _timed(split.with_stable(_glover(minimal, values, order - split.count)), rate)

    return split.count, of


def _glover(G: Matrices, values: RealArray, order: int) -> Matrices:
    """Order `order`, or less where its singular value equals the next one, of a balanced system."""
    A, B, C, D = G
    if order >= len(values):
        return G
    sigma = float(values[order])
    near = np.abs(values - sigma) <= EQUAL * sigma
    rest = ~near
    A11, B1, C1, values1 = A[np.ix_(rest, rest)], B[rest], C[:, rest], values[rest]
    # U with B2 = -C2^T U: partial isometries do, and of one size with zero columns or rows.
    left, _, right = np.linalg.svd(C[:, near] @ B[near], full_matrices=False)
    rank = min(int(near.sum()), *D.shape)
    U = -left[:, :rank] @ right[:rank]
    gamma = values1**2 - sigma**2
    inner = sigma**2 * A11.T + values1[:, None] * A11 * values1 - sigma * C1.T @ U @ B1.T
    A_all = inner / gamma[:, None]
    B_all = (values1[:, None] * B1 + sigma * C1.T @ U) / gamma[:, None]
    C_all = C1 * values1 + sigma * U @ B1.T
    return _split((A_all, B_all, C_all, D)).stable


def weighted(K: Matrices, plant: GeneralisedPlant, loop: Matrices, peak: Peak) -> Reducer:
    """Balanced truncation with the closed loop as weight; unstable parts of K are reduced too.

    A small change of K changes N by W_o dK W_i, W_o = P12 (1 - K P22)^-1 and W_i = (1 - P22 K)^-1
    P21 (D. Enns, Model reduction with balanced realizations, CDC 1984). The weighted Gramians are
    K's blocks of those of the closed loop N, whose signals are scaled with the multipliers of mu
    at its peak, so that perturbation and performance count alike (P. Wortelboer, Frequency-
    weighted balanced reduction of closed-loop mechanical servo-systems, thesis, Delft 1994).

    Parameters
    ----------
    loop
        N with every state, those of K the last.
    peak
        That of mu of N.
    """
    n = len(K[0])
    output, entering = _multipliers(plant, peak)
    A, B, C, _ = loop
    B, C = B @ entering, output @ C
    rate = speed(A)
    units = state_units(A / rate, B, C)
    S, R = factors(A / rate * units[:, None] / units, B * units[:, None], C / units)
    own = units[len(A) - n :]
    left, right, _ = balancing_projections(S[len(A) - n :], R[:, len(A) - n :])
    left, right = left * own, right / own[:, None]
    Ak, Bk, Ck, Dk = K

    def of(order: int) -> Matrices:
        T, V = left[:order], right[:, :order]
        return T @ Ak @ V, T @ Bk, Ck @ V, Dk

    return of


def _multipliers(plant: GeneralisedPlant, peak: Peak) -> tuple[RealArray, RealArray]:
    """D of the outputs and inverse D of the inputs of N at the peak of mu, real."""
    of = next((one for one in peak.intervals if one.low <= peak.omega <= one.high), None)
    if of is None:
        raise InputError(
            f"mu of the loop is certified nowhere about its peak ({peak.message}), so that there "
            'is nothing to weigh with; ask "balanced" or "hankel"'
        )
    D_left, D_right, _ = of.multipliers(peak.omega)
    rows = plant.system.noutputs - plant.measurements
    columns = plant.system.ninputs - plant.controls
    # The real part of a positive definite matrix is positive definite.
    left, right = D_left.real[:rows, :rows], D_right.real[:columns, :columns]
    return np.real(sqrtm(left)), np.linalg.inv(np.real(sqrtm(right)))


def _scaled(K: Matrices) -> tuple[float, Matrices]:
    """A rate of time and K in that time, its states balanced."""
    A, B, C, D = K
    rate = speed(A)
    A, B = A / rate, B / rate
    units = state_units(A, B, C)
    return rate, (A * units[:, None] / units, B * units[:, None], C / units, D)


def _timed(K: Matrices, rate: float) -> Matrices:
    A, B, C, D = K
    return A * rate, B * rate, C, D


def _split(K: Matrices) -> Split:
    """Ordered Schur form, and a Sylvester equation for what couples its parts."""
    A, B, C, D = K
    n = len(A)
    boundary = -ZERO_ROUNDING * EPS * n * float(np.linalg.norm(A))
    T, Q, k = schur(A, sort=lambda re, im: re >= boundary) if n else (A, A, 0)
    X = solve_sylvester(T[:k, :k], -T[k:, k:], -T[:k, k:]) if 0 < k < n else np.zeros((k, n - k))
    B, C = Q.T @ B, C @ Q
    kept = T[:k, :k], B[:k] - X @ B[k:], C[:, :k], np.zeros_like(D)
    return Split(kept, (T[k:, k:], B[k:], C[:, k:] + C[:, :k] @ X, D))
