"""Controllers with exact integrators, made from controllers with poles near zero."""

from __future__ import annotations

import numpy as np
from scipy.linalg import schur, solve_sylvester

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certificate import THIS_SYSTEM, Check
from workbench.systems.balancing import balanced
from workbench.systems.realisation import realisation

NEARLY_EQUAL = 1e-9
"""Relative difference of two sizes of an eigenvalue that is due to rounding."""


def with_integrator(K: StateSpace) -> StateSpace:
    """K with its poles nearest to zero moved to zero, one for each channel; these integrators
    become the first states.

    A weight with a pole near zero leads to a controller with nearly this pole; of several channels
    two such poles may be a complex pair. The number of channels is the smaller one of the numbers
    of inputs and outputs. If the poles nearest to zero contain half a pair, the real poles nearest
    to zero are moved instead. K is returned unchanged if it has the integrators already, or too few
    such poles.
    """
    count = channel_count(K)
    if integrators(np.asarray(K.A)) >= count:
        return K
    A, B, C = balanced(K.A, K.B, K.C)
    found = _slowest_first(A, count, real=False) or _slowest_first(A, count, real=True)
    if found is None:
        return K
    T, Q = found
    # Two decoupled subsystems: the entries of the first rows right of the diagonal become zero.
    X = solve_sylvester(T[:count, :count], -T[count:, count:], -T[:count, count:])
    inward, outward = Q.T @ B, C @ Q
    inward[:count] -= X @ inward[count:]
    outward[:, count:] += outward[:, :count] @ X
    T[:count] = 0.0
    labels = {"inputs": list(K.input_labels), "outputs": list(K.output_labels)}
    return realisation((T, inward, outward, K.D), 0.0, **labels)


def _slowest_first(A: RealArray, count: int, *, real: bool) -> tuple[RealArray, RealArray] | None:
    """Real Schur form of A and its basis, with the ``count`` eigenvalues nearest to zero first.

    With ``real`` only real eigenvalues count. None if there are too few, or half a pair is among
    them.
    """
    T = schur(A)[0]
    below = np.diag(T, -1)
    paired = np.append(below, 0.0) + np.append(0.0, below) != 0.0
    # both of a pair have the same size: the root of the determinant of its block
    size = np.abs(np.diag(T))
    for i in np.flatnonzero(below):
        size[i : i + 2] = np.sqrt(np.linalg.det(T[i : i + 2, i : i + 2]))
    usable = np.sort(size[~paired] if real else size)
    if usable.size < count:
        return None
    last = usable[count - 1] * (1 + NEARLY_EQUAL)

    def first(re: float, im: float) -> bool:
        return bool((im == 0.0 or not real) and np.hypot(re, im) <= last)

    T, Q, found = schur(A, sort=first)
    return (T, Q) if found == count else None


def channel_count(K: StateSpace) -> int:
    """Number of constant signals that a controller can hold independently."""
    return min(int(K.ninputs), int(K.noutputs))


def integrators(A: RealArray) -> int:
    """Number of states that are exact integrators, which are zero rows of A."""
    return int((np.asarray(A) == 0.0).all(axis=1).sum()) if len(A) else 0


def without_integrators(K: StateSpace) -> StateSpace:
    """K without the states that are exact integrators."""
    kept = np.flatnonzero((np.asarray(K.A) != 0.0).any(axis=1))
    return realisation((K.A[np.ix_(kept, kept)], K.B[kept], K.C[:, kept], K.D), K.dt or 0.0)


def integral_check(K: StateSpace) -> Check:
    """Check that a controller has an exact integrator for each channel."""
    statement = "channels without a state that is an integrator to the last bit"
    missing = float(max(channel_count(K) - integrators(np.asarray(K.A)), 0))
    return Check("integral action", statement, missing, 0.0, over=THIS_SYSTEM, proven=True)
