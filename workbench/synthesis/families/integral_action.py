"""Controllers with an exact integrator, made from controllers with a pole near zero."""

from __future__ import annotations

import numpy as np
from scipy.linalg import schur, solve_sylvester

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certificate import THIS_SYSTEM, Check
from workbench.systems.balancing import balanced
from workbench.systems.realisation import realisation


def with_integrator(K: StateSpace) -> StateSpace:
    """K with its real pole nearest to zero moved to zero; this integrator becomes the first state.

    A weight with a pole near zero leads to a controller with nearly this pole. K is returned
    unchanged if it has an integrator already, or no real pole.
    """
    if has_integrator(np.asarray(K.A)):
        return K
    A, B, C = balanced(K.A, K.B, K.C)
    T = schur(A)[0]
    paired = np.append(np.diag(T, -1), 0.0) + np.append(0.0, np.diag(T, -1)) != 0.0
    real = np.diag(T)[~paired]
    if not real.size:
        return K
    slowest = real[np.argmin(np.abs(real))]
    T, Q, _ = schur(A, sort=lambda re, im: im == 0.0 and re == slowest)
    # Two decoupled subsystems: the entries of the first row right of the diagonal become zero.
    X = solve_sylvester(T[:1, :1], -T[1:, 1:], -T[:1, 1:])
    inward, outward = Q.T @ B, C @ Q
    inward[:1] -= X @ inward[1:]
    outward[:, 1:] += outward[:, :1] @ X
    T[0, :] = 0.0
    labels = {"inputs": list(K.input_labels), "outputs": list(K.output_labels)}
    return realisation((T, inward, outward, K.D), 0.0, **labels)


def has_integrator(A: RealArray) -> bool:
    """Whether a state is an exact integrator, which is a zero row of A."""
    return bool((np.asarray(A) == 0.0).all(axis=1).any()) if len(A) else False


def without_integrators(K: StateSpace) -> StateSpace:
    """K without the states that are exact integrators."""
    kept = np.flatnonzero((np.asarray(K.A) != 0.0).any(axis=1))
    return realisation((K.A[np.ix_(kept, kept)], K.B[kept], K.C[:, kept], K.D), K.dt or 0.0)


def integral_check(K: StateSpace) -> Check:
    """Check that a controller has an exact integrator."""
    statement = "whether no state of the controller is an integrator to the last bit"
    none = float(not has_integrator(np.asarray(K.A)))
    return Check("integral action", statement, none, 0.0, over=THIS_SYSTEM, proven=True)
