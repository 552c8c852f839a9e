"""Methods of order reduction: balanced truncation, singular perturbation, Glover's approximation,
and truncation weighted by the closed loop.

All are square-root methods in scaled time and states (see `workbench.systems.equations.gramians`).
They keep poles that are not stable (see `workbench.synthesis.reduction.kept_part`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import sqrtm

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.mu.frequency.peak_bounds import Peak
from workbench.synthesis.reduction.kept_part import Split, stable_part_of, timed
from workbench.systems.balancing import speed, state_units
from workbench.systems.equations.gramians import balancing_projections, gramian_factors
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.realisation import Matrices, in_series

Reducer = Callable[[int], Matrices]
"""Function: number of states -> the reduced controller with at most so many states."""
EQUAL_VALUE_TOLERANCE = 1e-9
"""Hankel singular values within this relative distance count as one multiple value."""
NEGLIGIBLE_VALUE = 1e-12
"""Glover's approximation leaves out Hankel singular values below this share of the largest. It
divides by differences of squared values, and these would be rounding errors.
"""


@dataclass(frozen=True, eq=False)
class Weights:
    """Stable weights of the difference W_o (K - K_r) W_i, which is made small. None stands
    for 1.
    """

    leaving: Matrices | None = None
    entering: Matrices | None = None


def balanced_truncation(K: Split, weights: Weights | None = None) -> tuple[int, Reducer]:
    """Balanced truncation of the stable part (B. Moore, IEEE Trans. Automatic Control 26 (1981)).

    Returns the least possible order, which is the order of the kept part, and the reducer.
    """
    A, B, C, D = K.stable
    left, right, _ = balancing_projections(*_weighted_gramian_factors(K, weights))

    def of(order: int) -> Matrices:
        T, V = left[: order - K.count], right[:, : order - K.count]
        return K.with_stable((T @ A @ V, T @ B, C @ V, D))

    return K.count, of


def matchdc(K: Split, weights: Weights | None = None) -> tuple[int, Reducer]:
    """Balanced singular perturbation of the stable part: the removed states are at rest.

    The response at zero frequency stays the same, because the removed states add their static gain
    to the direct term (K. Fernando, H. Nicholson, Singular perturbational model reduction of
    balanced systems, IEEE Trans. Automatic Control 27 (1982) 466-468). The result is that of
    `balanced_truncation`.
    """
    A, B, C, D = _balanced_realisation(K.stable, *_weighted_gramian_factors(K, weights))[0]

    def of(order: int) -> Matrices:
        k = min(order - K.count, len(A))
        rest = np.linalg.solve(A[k:, k:], np.hstack([A[k:, :k], B[k:]]))
        A2, B2 = rest[:, :k], rest[:, k:]
        slow = A[:k, :k] - A[:k, k:] @ A2, B[:k] - A[:k, k:] @ B2
        return K.with_stable((*slow, C[:, :k] - C[:, k:] @ A2, D - C[:, k:] @ B2))

    return K.count, of


def _weighted_gramian_factors(K: Split, weights: Weights | None) -> tuple[RealArray, RealArray]:
    """Factors of the Gramians of a stable part, weighted as by D. Enns (CDC 1984).

    The controllability Gramian is the block that belongs to the part's states in the Gramian of G
    W_i. The observability Gramian is their block in the Gramian of W_o G.
    """
    G = K.stable
    n = len(G[0])
    S, R = gramian_factors(*G[:3])
    if weights is not None and weights.entering is not None and n:
        A, B, C, units = _scaled_states(in_series(timed(weights.entering, 1.0 / K.rate), G))
        S = gramian_factors(A, B, C)[0][:n] / units[:n, None]
    if weights is not None and weights.leaving is not None and n:
        A, B, C, units = _scaled_states(in_series(G, timed(weights.leaving, 1.0 / K.rate)))
        R = gramian_factors(A, B, C)[1][:, len(A) - n :] * units[len(A) - n :]
    if weights is not None and weights.leaving is not None and weights.entering is not None and n:
        S, R = _stability_preserving(G[0], S), _stability_preserving(G[0].T, R.T).T
    return S, R


def _stability_preserving(A: RealArray, S: RealArray) -> RealArray:
    """A factor of a Gramian P_1 >= P = S S' for which A P_1 + P_1 A' is negative semidefinite.

    With P_1 truncation keeps stability, which P does not guarantee with weights on both sides (G.
    Wang, V. Sreeram, W. Liu, A new frequency-weighted balanced truncation method and an error
    bound, IEEE Trans. Automatic Control 44 (1999) 1734-1737).
    """
    half = A @ S @ S.T
    values, vectors = np.linalg.eigh(half + half.T)
    gains = vectors * np.sqrt(np.abs(values))
    return gramian_factors(A, gains, np.zeros((1, len(A))))[0]


def _scaled_states(G: Matrices) -> tuple[RealArray, RealArray, RealArray, RealArray]:
    """A, B and C with scaled states, and the scaling factors."""
    A, B, C, _ = G
    units = state_units(A, B, C)
    return A * units[:, None] / units, B * units[:, None], C / units, units


def hankel(K: Split) -> tuple[int, Reducer]:
    """Optimal Hankel-norm approximation of the stable part; the direct term stays the same.

    The Hankel norm of the error is the first singular value that is left out. No stable system of
    this order has a smaller error. It returns the same as `balanced_truncation`.

    References
    ----------
    K. Glover, All optimal Hankel-norm approximations of linear multivariable systems and their
    L-infinity-error bounds, Int. J. Control 39 (1984) 1115-1193, theorem 6.3.
    """
    minimal, values = _balanced_realisation(K.stable, *gramian_factors(*K.stable[:3]))
    # Scale the largest value to about 1: the squares of very large or small values overflow or
    # underflow.
    half = int(np.frexp(values.max(initial=0.0))[1]) // 2
    minimal, values = _scaled_by_power_of_4(minimal, -half), np.ldexp(values, -2 * half)

    def of(order: int) -> Matrices:
        return K.with_stable(_scaled_by_power_of_4(_glover(minimal, values, order - K.count), half))

    return K.count, of


def _scaled_by_power_of_4(G: Matrices, power: int) -> Matrices:
    """4^power G, balanced if G is."""
    A, B, C, D = G
    return A, np.ldexp(B, power), np.ldexp(C, power), np.ldexp(D, 2 * power)


def _balanced_realisation(G: Matrices, S: RealArray, R: RealArray) -> tuple[Matrices, RealArray]:
    """A stable system in balanced coordinates without negligible states, and its singular
    values.
    """
    A, B, C, D = G
    left, right, values = balancing_projections(S, R)
    seen = int((values > NEGLIGIBLE_VALUE * values.max(initial=0.0)).sum())
    left, right = left[:seen], right[:, :seen]
    return (left @ A @ right, left @ B, C @ right, D), values[:seen]


def _glover(G: Matrices, values: RealArray, order: int) -> Matrices:
    """Glover's approximation of a balanced system by one of order `order`.

    The order is lower where its singular value equals the next one.
    """
    A, B, C, D = G
    if order >= len(values):
        return G
    sigma = float(values[order])
    near = np.abs(values - sigma) <= EQUAL_VALUE_TOLERANCE * sigma
    rest = ~near
    A11, B1, C1, values1 = A[np.ix_(rest, rest)], B[rest], C[:, rest], values[rest]
    # Find U with B2 = -C2^T U: a partial isometry, with zero rows or columns where D is not square.
    left, _, right = np.linalg.svd(C[:, near] @ B[near], full_matrices=False)
    rank = min(int(near.sum()), *D.shape)
    U = -left[:, :rank] @ right[:rank]
    gamma = values1**2 - sigma**2
    inner = sigma**2 * A11.T + values1[:, None] * A11 * values1 - sigma * C1.T @ U @ B1.T
    A_all = inner / gamma[:, None]
    B_all = (values1[:, None] * B1 + sigma * C1.T @ U) / gamma[:, None]
    C_all = C1 * values1 + sigma * U @ B1.T
    return stable_part_of((A_all, B_all, C_all, D))


def weighted(K: Matrices, plant: GeneralisedPlant, loop: Matrices, peak: Peak | None) -> Reducer:
    """Balanced truncation weighted by the closed loop (see `loop_weighted_truncation`).

    The signals of N are scaled by the D scalings of mu at its peak, so that perturbation and
    performance have equal weight (P. Wortelboer, Frequency-weighted balanced reduction of
    closed-loop mechanical servo-systems, thesis, Delft 1994).

    Parameters
    ----------
    loop
        N with all its states; the last states are those of K.
    peak
        The peak of mu of N; None without a perturbation, where all signals count equally.
    """
    A, B, C, D = loop
    if peak is not None:
        output, entering = _multipliers(plant, peak)
        B, C = B @ entering, output @ C
    return loop_weighted_truncation(K, (A, B, C, D))


def loop_weighted_truncation(K: Matrices, loop: Matrices) -> Reducer:
    """Balanced truncation weighted by a closed loop N, whose last states are those of K.

    A small change of K changes N by W_o dK W_i with W_o = P12 (1 - K P22)^-1 and W_i = (1 - P22
    K)^-1 P21 (D. Enns, Model reduction with balanced realizations, CDC 1984). The weighted Gramians
    are the blocks of K in the Gramians of N. Only N must be stable, so K may have poles on the
    axis or right of it.
    """
    n = len(K[0])
    A, B, C, _ = loop
    rate = speed(A, B, C)
    units = state_units(A / rate, B, C)
    S, R = gramian_factors(A / rate * units[:, None] / units, B * units[:, None], C / units)
    own = units[len(A) - n :]
    left, right, _ = balancing_projections(S[len(A) - n :], R[:, len(A) - n :])
    left, right = left * own, right / own[:, None]
    Ak, Bk, Ck, Dk = K

    def of(order: int) -> Matrices:
        T, V = left[:order], right[:, :order]
        return T @ Ak @ V, T @ Bk, Ck @ V, Dk

    return of


def _multipliers(plant: GeneralisedPlant, peak: Peak) -> tuple[RealArray, RealArray]:
    """Real scalings of N at the peak of mu: D for the outputs, and the inverse of D for the
    inputs.
    """
    performs = plant.performance and plant.exogenous
    structure = plant.performance_structure if performs else plant.structure
    assert structure is not None
    multipliers = peak.multipliers(structure)
    if multipliers is None:
        raise InputError(
            f"mu of the loop is not certified at its peak ({peak.message}), so the weights are "
            'unknown; ask for "balanced", "matchdc" or "hankel"'
        )
    D_left, D_right, _ = multipliers
    rows = plant.system.noutputs - plant.measurements
    columns = plant.system.ninputs - plant.controls
    # The real part of a positive definite matrix is positive definite.
    left, right = D_left.real[:rows, :rows], D_right.real[:columns, :columns]
    return np.real(sqrtm(left)), np.linalg.inv(np.real(sqrtm(right)))
