"""Controllers with exact integrators, made from controllers with poles near zero."""

from __future__ import annotations

import numpy as np
from scipy.linalg import schur, solve_sylvester

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certificate import THIS_SYSTEM, Check
from workbench.systems.balancing import balanced
from workbench.systems.realisation import realisation


def with_integrator(K: StateSpace) -> StateSpace:
    """K with its real poles nearest to zero moved to zero, one for each channel; these integrators
    become the first states.

    A weight with a pole near zero leads to a controller with nearly this pole. The number of
    channels is the smaller one of the numbers of inputs and outputs. K is returned unchanged if it
    has the integrators already, or too few real poles.
    """
    count = channel_count(K)
    if integrators(np.asarray(K.A)) >= count:
        return K
    A, B, C = balanced(K.A, K.B, K.C)
    T = schur(A)[0]
    paired = np.append(np.diag(T, -1), 0.0) + np.append(0.0, np.diag(T, -1)) != 0.0
    real = np.sort(np.abs(np.diag(T)[~paired]))
    if real.size < count:
        return K
    T, Q, found = schur(A, sort=lambda re, im: im == 0.0 and abs(re) <= real[count - 1])
    if found != count:
        return K
    # Two decoupled subsystems: the entries of the first rows right of the diagonal become zero.
    X = solve_sylvester(T[:count, :count], -T[count:, count:], -T[:count, count:])
    inward, outward = Q.T @ B, C @ Q
    inward[:count] -= X @ inward[count:]
    outward[:, count:] += outward[:, :count] @ X
    T[:count] = 0.0
    labels = {"inputs": list(K.input_labels), "outputs": list(K.output_labels)}
    return realisation((T, inward, outward, K.D), 0.0, **labels)


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
