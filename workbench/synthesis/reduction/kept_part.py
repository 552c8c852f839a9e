"""A system as the sum of the part that order reduction keeps and a stable part.

Kept are the poles on the boundary of stability, up to rounding, and those beyond it. Integrators
(sampled: poles at z = 1, and at z = -1) become exact, by changes of the matrices within rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, solve_sylvester

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.systems.axis_poles import stable_last
from workbench.systems.balancing import (
    axis_rounding,
    integrators_first,
    poles_at_zero,
    speed,
    state_units,
)
from workbench.systems.bilinear import to_continuous, to_sampled
from workbench.systems.realisation import Matrices, in_parallel


@dataclass(frozen=True, eq=False)
class Split:
    """K as the sum of a kept and a stable part.

    ``kept`` is in K's own time. ``stable`` is continuous, its time measured by ``rate`` [rad/s];
    where K is ``sampled`` it is that of the bilinear transformation. The states of K are
    ``coordinates`` (n, n) times those of both parts, up to rounding; ``units`` (n,) are the factors
    of K's states in which that was judged.
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
    """The parts of a system.

    Raises
    ------
    InputError
        Its poles do not say whether they are integrators.
    """
    if not sampled:
        return _of_continuous(K, False)
    (A, B, C, D), coordinates, units, k = _exact_at_the_ends(K)
    first, rest, own = _apart(A, B, C, k)
    others = _of_continuous((*rest, D), True)
    kept = in_parallel((*first, 0.0 * D), others.kept)
    coordinates = coordinates @ own @ block_diag(np.eye(k), others.coordinates)
    return Split(kept, others.stable, others.rate, True, coordinates, units)


def with_exact_poles(K: Matrices, sampled: bool) -> tuple[Matrices, RealArray, RealArray]:
    """K with poles within rounding of the boundary exactly on it, where doubles can say so.

    Integrators (sampled: poles at z = 1 and z = -1) become exact, and undamped pairs of a
    continuous system. With them come the coordinates V (n, n), in which the given states are V
    times the new ones, and the factors (n,) of the given states in which rounding was judged.

    Raises
    ------
    InputError
        As `kept_and_stable`.
    """
    if sampled:
        return _exact_at_the_ends(K)[:3]
    rate, (A, B, C, D), units = _scaled(K)
    Q, T, _, _ = stable_last(A)
    return timed((T, Q.T @ B, C @ Q, D), rate), Q / units[:, None], units


def timed(K: Matrices, rate: float) -> Matrices:
    """A realisation in a unit of time that is so many times as short."""
    A, B, C, D = K
    return A * rate, B * rate, C, D


def _of_continuous(K: Matrices, sampled: bool) -> Split:
    """The parts of a continuous system, or by way of one."""
    rate, parts, units = _scaled(to_continuous(K) if sampled else K)
    kept, stable, own = _split(parts)
    kept = timed(kept, rate)
    kept = to_sampled(kept) if sampled else kept
    return Split(kept, stable, rate, sampled, own / units[:, None], units)


def _exact_at_the_ends(K: Matrices) -> tuple[Matrices, RealArray, RealArray, int]:
    """A sampled system with exact poles at z = -1 and z = 1 first, V, units, and their number."""
    A, B, C, D = K
    units = state_units(A, B, C)
    T = A * units[:, None] / units
    Q, k, small = np.eye(len(A)), 0, axis_rounding(T)
    for end in (-1.0, 1.0):
        turn, moved, count = integrators_first(T[k:, k:] - end * np.eye(len(A) - k), small)
        T[:k, k:] = T[:k, k:] @ turn
        T[k:, k:] = moved + end * np.eye(len(A) - k)
        Q[:, k:] = Q[:, k:] @ turn
        k += count
    return (T, Q.T @ (B * units[:, None]), C / units @ Q, D), Q / units[:, None], units, k


def _scaled(K: Matrices) -> tuple[float, Matrices, RealArray]:
    """A rate [rad/s], K in time scaled by it with balanced states, and their factors.

    The states stay as given where balancing hides that poles are 0 up to rounding.
    """
    A, B, C, D = K
    rate = speed(A, B, C)
    A, B = A / rate, B / rate
    units = state_units(A, B, C)
    integrators = poles_at_zero(np.linalg.eigvals(A)) if len(A) else 0
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
    """The kept and the stable part, by an ordered Schur form, and coordinates of their states."""
    A, B, C, D = K
    Q, T, k, _ = stable_last(A)
    kept, stable, own = _apart(T, Q.T @ B, C @ Q, k)
    return (*kept, np.zeros_like(D)), (*stable, D), Q @ own


Part = tuple[RealArray, RealArray, RealArray]
"""A, B and C."""


def _apart(T: RealArray, B: RealArray, C: RealArray, k: int) -> tuple[Part, Part, RealArray]:
    """Both parts of a block triangular form, and coordinates of their states.

    A Sylvester equation removes the coupling.
    """
    first, coupling, last = T[:k, :k], T[:k, k:], T[k:, k:]
    X = solve_sylvester(first, -last, -coupling) if 0 < k < len(T) else np.zeros_like(coupling)
    own = np.eye(len(T))
    own[:k, k:] = X
    return (first, B[:k] - X @ B[k:], C[:, :k]), (last, B[k:], C[:, k:] + C[:, :k] @ X), own
