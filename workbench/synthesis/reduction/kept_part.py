"""Split of a system into a part that order reduction keeps and a stable part.

Order reduction keeps the unstable poles and the poles that lie on the boundary of stability up to
rounding. Integrators (in sampled systems poles at z = 1 and z = -1) become exact: the matrices
change by rounding only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, solve_sylvester

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.systems.axis_poles import integrators_by_size, integrators_first, stable_last
from workbench.systems.balancing import axis_rounding, speed, state_units
from workbench.systems.bilinear import to_continuous, to_sampled
from workbench.systems.realisation import Matrices, in_parallel


@dataclass(frozen=True, eq=False)
class Split:
    """K as the sum of a kept and a stable part.

    ``kept`` is in K's own time. ``stable`` is continuous; its unit of time is 1 / ``rate``, with
    ``rate`` in rad/s. Where K is ``sampled``, ``stable`` comes from the bilinear transformation.
    The states of K are ``coordinates`` (n, n) times the states of both parts, up to rounding.
    ``units`` (n,) are factors on K's states; rounding is judged in the scaled states.
    """

    kept: Matrices
    stable: Matrices
    rate: float
    sampled: bool
    coordinates: RealArray
    units: RealArray

    @property
    def count(self) -> int:
        """Number of states of the kept part."""
        return len(self.kept[0])

    def with_stable(self, other: Matrices) -> Matrices:
        """The sum of the kept part and another stable part."""
        other = timed(other, self.rate)
        return in_parallel(self.kept, to_sampled(other) if self.sampled else other)


def kept_and_stable(K: Matrices, sampled: bool = False) -> Split:
    """Split a system into its kept and its stable part.

    Raises
    ------
    InputError
        It cannot be decided whether poles of K are integrators.
    """
    if not sampled:
        return _split_continuous(K, False)
    (A, B, C, D), coordinates, units, k = _exact_poles_first(K)
    first, rest, own = _decoupled_parts(A, B, C, k)
    others = _split_continuous((*rest, D), True)
    kept = in_parallel((*first, 0.0 * D), others.kept)
    coordinates = coordinates @ own @ block_diag(np.eye(k), others.coordinates)
    return Split(kept, others.stable, others.rate, True, coordinates, units)


def with_exact_poles(K: Matrices, sampled: bool) -> tuple[Matrices, RealArray, RealArray]:
    """K with poles exactly on the boundary where they are on it up to rounding.

    This holds for integrators (in sampled systems poles at z = 1 and z = -1), and for undamped
    pairs of a continuous system. Also returns V (n, n), where the given states are V times the new
    ones, and factors (n,) on the given states; rounding is judged in the scaled states.

    Raises
    ------
    InputError
        As `kept_and_stable`.
    """
    if sampled:
        return _exact_poles_first(K)[:3]
    rate, (A, B, C, D), units = _scaled_system(K)
    Q, T, _, _ = stable_last(A)
    return timed((T, Q.T @ B, C @ Q, D), rate), Q / units[:, None], units


def timed(K: Matrices, rate: float) -> Matrices:
    """The realisation in time t / rate: A and B are multiplied by `rate`."""
    A, B, C, D = K
    return A * rate, B * rate, C, D


def _split_continuous(K: Matrices, sampled: bool) -> Split:
    """The parts of a continuous system; a sampled system is made continuous before."""
    rate, parts, units = _scaled_system(to_continuous(K) if sampled else K)
    kept, stable, own = _split(parts)
    kept = timed(kept, rate)
    kept = to_sampled(kept) if sampled else kept
    return Split(kept, stable, rate, sampled, own / units[:, None], units)


def _exact_poles_first(K: Matrices) -> tuple[Matrices, RealArray, RealArray, int]:
    """A sampled system that starts with its exact poles at z = -1 and z = 1; V, units, number of
    poles.
    """
    A, B, C, D = K
    units = state_units(A, B, C)
    T = A * units[:, None] / units
    Q, T, k = integrators_first(T, axis_rounding(T), (-1.0, 1.0))
    return (T, Q.T @ (B * units[:, None]), C / units @ Q, D), Q / units[:, None], units, k


def _scaled_system(K: Matrices) -> tuple[float, Matrices, RealArray]:
    """A rate [rad/s], K in time scaled by this rate with balanced states, and the states' factors.

    The states are not balanced if balancing would hide that poles are 0 up to rounding.
    """
    A, B, C, D = K
    rate = speed(A, B, C)
    A, B = A / rate, B / rate
    units = state_units(A, B, C)
    integrators = integrators_by_size(A)
    for factor in (units, np.ones(len(A))):
        scaled = A * factor[:, None] / factor
        if stable_last(scaled)[3] >= integrators:
            return rate, (scaled, B * factor[:, None], C / factor, D), factor
    raise InputError(
        f"K has {integrators} poles that are 0 up to rounding, but its matrices do not say whether "
        "they are integrators: give it as a transfer function or with integrators that are exact"
    )


def stable_part_of(K: Matrices) -> Matrices:
    """The stable part of a continuous system in scaled time with balanced states."""
    return _split(K)[1]


def _split(K: Matrices) -> tuple[Matrices, Matrices, RealArray]:
    """The kept and the stable part by an ordered Schur form, and the coordinates of their
    states.
    """
    A, B, C, D = K
    Q, T, k, _ = stable_last(A)
    kept, stable, own = _decoupled_parts(T, Q.T @ B, C @ Q, k)
    return (*kept, np.zeros_like(D)), (*stable, D), Q @ own


Part = tuple[RealArray, RealArray, RealArray]
"""Matrices A, B and C of one part."""


def _decoupled_parts(
    T: RealArray, B: RealArray, C: RealArray, k: int
) -> tuple[Part, Part, RealArray]:
    """Both parts of a block triangular realisation, decoupled, and the coordinates of their states.

    A Sylvester equation removes the coupling.
    """
    first, coupling, last = T[:k, :k], T[:k, k:], T[k:, k:]
    X = solve_sylvester(first, -last, -coupling) if 0 < k < len(T) else np.zeros_like(coupling)
    own = np.eye(len(T))
    own[:k, k:] = X
    return (first, B[:k] - X @ B[k:], C[:, :k]), (last, B[k:], C[:, k:] + C[:, :k] @ X), own
