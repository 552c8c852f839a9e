"""Methods of order reduction: balanced truncation, with fast states left out or at rest, Glover's
approximation, closed-loop weighting.

All are square-root methods in scaled time and states (see `workbench.systems.equations.gramians`);
poles that are not stable are kept (see `workbench.synthesis.reduction.kept_part`).
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
"""A function that gives the controller with at most a number of states."""
EQUAL_VALUE_TOLERANCE = 1e-9
"""Hankel singular values within this relative distance count as one value with several states."""
NEGLIGIBLE_VALUE = 1e-12
"""Hankel singular values below this share of the largest are left out of Glover's approximation. It
divides by differences of their squares, in which they would be rounding errors."""


@dataclass(frozen=True, eq=False)
class Weights:
    """Stable weights of the difference W_o (K - K_r) W_i that is to be small; None is 1."""

    leaving: Matrices | None = None
    entering: Matrices | None = None


def balanced_truncation(K: Split, weights: Weights | None = None) -> tuple[int, Reducer]:
    """Balanced truncation of the stable part (B. Moore, IEEE Trans. Automatic Control 26 (1981)).

    Returns the least order, which is that of the kept part, and the reducer.
    """
    A, B, C, D = K.stable
    left, right, _ = balancing_projections(*_factors(K, weights))

    def of(order: int) -> Matrices:
        T, V = left[: order - K.count], right[:, : order - K.count]
        return K.with_stable((T @ A @ V, T @ B, C @ V, D))

    return K.count, of


def matchdc(K: Split, weights: Weights | None = None) -> tuple[int, Reducer]:
    """Balanced truncation whose other states are at rest, of the stable part.

    The response at zero frequency stays the same, and fast states leave their gain in the direct
    term (K. Fernando, H. Nicholson, Singular perturbational model reduction of balanced systems,
    IEEE Trans. Automatic Control 27 (1982) 466-468). Returns as `balanced_truncation`.
    """
    A, B, C, D = _balanced(K.stable, *_factors(K, weights))[0]

    def of(order: int) -> Matrices:
        k = min(order - K.count, len(A))
        rest = np.linalg.solve(A[k:, k:], np.hstack([A[k:, :k], B[k:]]))
        A2, B2 = rest[:, :k], rest[:, k:]
        slow = A[:k, :k] - A[:k, k:] @ A2, B[:k] - A[:k, k:] @ B2
        return K.with_stable((*slow, C[:, :k] - C[:, k:] @ A2, D - C[:, k:] @ B2))

    return K.count, of


def _factors(K: Split, weights: Weights | None) -> tuple[RealArray, RealArray]:
    """Factors of the Gramians of a stable part, weighted as by D. Enns (CDC 1984).

    The controllability Gramian is the block of the part's states in that of G W_i, the
    observability Gramian their block in that of W_o G.
    """
    G = K.stable
    n = len(G[0])
    S, R = gramian_factors(*G[:3])
    if weights is not None and weights.entering is not None and n:
        A, B, C, units = _balanced_states(in_series(timed(weights.entering, 1.0 / K.rate), G))
        S = gramian_factors(A, B, C)[0][:n] / units[:n, None]
    if weights is not None and weights.leaving is not None and n:
        A, B, C, units = _balanced_states(in_series(G, timed(weights.leaving, 1.0 / K.rate)))
        R = gramian_factors(A, B, C)[1][:, len(A) - n :] * units[len(A) - n :]
    if weights is not None and weights.leaving is not None and weights.entering is not None and n:
        S, R = _definite(G[0], S), _definite(G[0].T, R.T).T
    return S, R


def _definite(A: RealArray, S: RealArray) -> RealArray:
    """A factor of a Gramian at least P = S S', whose A P + P A' is negative semidefinite.

    With it truncation keeps stability, which weights on both sides may cost (G. Wang, V. Sreeram,
    W. Liu, A new frequency-weighted balanced truncation method and an error bound, IEEE Trans.
    Automatic Control 44 (1999) 1734-1737).
    """
    half = A @ S @ S.T
    values, vectors = np.linalg.eigh(half + half.T)
    gains = vectors * np.sqrt(np.abs(values))
    return gramian_factors(A, gains, np.zeros((1, len(A))))[0]


def _balanced_states(G: Matrices) -> tuple[RealArray, RealArray, RealArray, RealArray]:
    """A, B and C with balanced states, and the factors of the states."""
    A, B, C, _ = G
    units = state_units(A, B, C)
    return A * units[:, None] / units, B * units[:, None], C / units, units


def hankel(K: Split) -> tuple[int, Reducer]:
    """Optimal Hankel-norm approximation of the stable part; the direct term stays the same.

    The Hankel norm of the error is the next singular value, which is the least error of any stable
    system of the order. Returns as `balanced_truncation`.

    References
    ----------
    K. Glover, All optimal Hankel-norm approximations of linear multivariable systems and their
    L-infinity-error bounds, Int. J. Control 39 (1984) 1115-1193, theorem 6.3.
    """
    minimal, values = _balanced(K.stable, *gramian_factors(*K.stable[:3]))
    # The largest value becomes about 1: squares of values far from that leave doubles.
    half = int(np.frexp(values.max(initial=0.0))[1]) // 2
    minimal, values = _amplified(minimal, -half), np.ldexp(values, -2 * half)

    def of(order: int) -> Matrices:
        return K.with_stable(_amplified(_glover(minimal, values, order - K.count), half))

    return K.count, of


def _amplified(G: Matrices, power: int) -> Matrices:
    """4^power G, balanced if G is."""
    A, B, C, D = G
    return A, np.ldexp(B, power), np.ldexp(C, power), np.ldexp(D, 2 * power)


def _balanced(G: Matrices, S: RealArray, R: RealArray) -> tuple[Matrices, RealArray]:
    """A stable system in balanced coordinates, without negligible states, and singular values."""
    A, B, C, D = G
    left, right, values = balancing_projections(S, R)
    seen = int((values > NEGLIGIBLE_VALUE * values.max(initial=0.0)).sum())
    left, right = left[:seen], right[:, :seen]
    return (left @ A @ right, left @ B, C @ right, D), values[:seen]


def _glover(G: Matrices, values: RealArray, order: int) -> Matrices:
    """Glover's approximation of a balanced system by one of order `order`.

    The order is lower where the singular value of the order equals the next one.
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


def weighted(K: Matrices, plant: GeneralisedPlant, loop: Matrices, peak: Peak) -> Reducer:
    """Balanced truncation weighted by the closed loop; unstable parts of K are reduced too.

    A small change of K changes N by W_o dK W_i with W_o = P12 (1 - K P22)^-1 and W_i =
    (1 - P22 K)^-1 P21 (D. Enns, Model reduction with balanced realizations, CDC 1984). The weighted
    Gramians are the blocks of K in the Gramians of the closed loop N. The signals of N are scaled
    by the multipliers of mu at its peak, so that perturbation and performance count equally (P.
    Wortelboer, Frequency-weighted balanced reduction of closed-loop mechanical servo-systems,
    thesis, Delft 1994).

    Parameters
    ----------
    loop
        N with every state; the states of K are the last.
    peak
        The peak of mu of N.
    """
    n = len(K[0])
    output, entering = _multipliers(plant, peak)
    A, B, C, _ = loop
    B, C = B @ entering, output @ C
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
    """Real scalings of N at the peak of mu: D of the outputs, and the inverse D of the inputs."""
    performs = plant.performance and plant.exogenous
    structure = plant.performance_structure if performs else plant.structure
    assert structure is not None
    multipliers = peak.multipliers(structure)
    if multipliers is None:
        raise InputError(
            f"mu of the loop is certified nowhere about its peak ({peak.message}), so that there "
            'is nothing to weigh with; ask "balanced", "matchdc" or "hankel"'
        )
    D_left, D_right, _ = multipliers
    rows = plant.system.noutputs - plant.measurements
    columns = plant.system.ninputs - plant.controls
    # The real part of a positive definite matrix is positive definite.
    left, right = D_left.real[:rows, :rows], D_right.real[:columns, :columns]
    return np.real(sqrtm(left)), np.linalg.inv(np.real(sqrtm(right)))
