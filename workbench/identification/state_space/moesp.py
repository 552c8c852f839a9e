"""PO-MOESP: a state-space model from projections of the whole record.

Future outputs, cleared of what future inputs explain, are projected on past inputs and outputs. The
column space of the projection is that of the observability matrix, whose shift gives A and C; B and
D are those whose simulation fits the record best; the gain of the innovations solves a Riccati
equation of the noise covariance that the states of the projection leave. The inputs must not depend
on past noise: records of closed loops are for method "subspace".

Sources: M. Verhaegen, "Identification of the deterministic part of MIMO state space models given in
innovations form from input-output data", Automatica 30(1), 1994; P. Van Overschee, B. De Moor,
Subspace Identification for Linear Systems, 1996, section 4.3 (the noise).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, solve_discrete_are

from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.arrays import RealArray
from workbench.executor import Context
from workbench.identification.state_space.innovations import InnovationsModel
from workbench.identification.state_space.methods import claim, identify
from workbench.identification.state_space.program import Fitter, StateSpaceFit
from workbench.identification.state_space.subspace import best_fitting
from workbench.program import Claim, method

HALF_WINDOWS = (3, 5, 8, 12, 18, 25)
"""Numbers of samples of past, and of future, from which the best model is chosen."""
LEAST_COVARIANCE = 1e-12
"""Covariance added to that of the noise, whose trace is 1: some states may have no noise."""


@method(StateSpaceFit, "moesp", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _moesp(program: StateSpaceFit, context: Context) -> Claim:
    """PO-MOESP: projections of the record, for open loops; no iterations."""

    def way(order: int) -> Fitter:
        return lambda u, y: best_moesp(u, y, order)

    return claim(identify(program, way, way, context))


def best_moesp(u: RealArray, y: RealArray, order: int) -> InnovationsModel | None:
    """The best PO-MOESP model of a record u (N, nu), y (N, ny) over several windows, or None.

    Only stable models with a stable predictor count; the best one fits its own record best.
    """
    channels = u.shape[1] + y.shape[1]
    windows = [
        half
        for half in HALF_WINDOWS
        if order <= (half - 1) * y.shape[1] and len(u) - 2 * half >= 4 * half * channels
    ]
    return best_fitting((moesp(u, y, order, half) for half in windows), u, y)


def moesp(u: RealArray, y: RealArray, order: int, half: int) -> InnovationsModel | None:
    """Innovations model of a record u (N, nu), y (N, ny); None if A is unstable or no K exists.

    Parameters
    ----------
    order
        Number of states, at most (half - 1) ny.
    half
        Number of past samples, and of future ones, of a window.
    """
    nu, ny = u.shape[1], y.shape[1]
    u_offset, y_offset, u_scale, y_scale = u.mean(axis=0), y.mean(axis=0), u.std(0), y.std(0)
    inputs, outputs = (u - u_offset) / u_scale, (y - y_offset) / y_scale
    all_in, all_out = _windows(inputs, 2 * half), _windows(outputs, 2 * half)

    def told(now: int) -> RealArray:
        """Outputs from sample ``now`` of a window on, as far as the past before it tells them."""
        past = np.vstack([all_in[: now * nu], all_out[: now * ny]])
        known = np.vstack([past, all_in[now * nu :]])
        return _shares(all_out[now * ny :], known)[:, : len(past)] @ past

    ahead_in = all_in[half * nu :]
    future = told(half)
    cleared = future - _shares(future, ahead_in) @ ahead_in
    left, singular, _ = np.linalg.svd(cleared, full_matrices=False)
    observability = left[:, :order] * np.sqrt(singular[:order])
    A = np.linalg.lstsq(observability[:-ny], observability[ny:], rcond=None)[0]
    C = observability[:ny]
    if np.abs(np.linalg.eigvals(A)).max() >= 1.0:
        return None
    states = np.linalg.lstsq(observability, future, rcond=None)[0]
    next_states = np.linalg.lstsq(observability[:-ny], told(half + 1), rcond=None)[0]
    measured = np.vstack([next_states, all_out[half * ny : (half + 1) * ny]])
    K = _innovation_gain(A, C, _noise(measured - np.vstack([A, C]) @ states, ahead_in))
    if K is None:
        return None
    B, D = _inputs(A, C, inputs, outputs)
    return InnovationsModel(
        A=A,
        B=B / u_scale,
        C=y_scale[:, None] * C,
        D=y_scale[:, None] * D / u_scale,
        K=K / y_scale,
        u_offset=u_offset,
        y_offset=y_offset,
    )


def _windows(signal: RealArray, length: int) -> RealArray:
    """Hankel matrix (length * channels, N - length + 1) of a signal (N, channels)."""
    count = len(signal) - length + 1
    return np.vstack([signal[lag : lag + count].T for lag in range(length)])


def _shares(rows: RealArray, known: RealArray) -> RealArray:
    """Matrix X that minimises |rows - X known|."""
    return np.asarray(np.linalg.lstsq(known.T, rows.T, rcond=None)[0].T, dtype=float)


def _noise(left_over: RealArray, inputs: RealArray) -> RealArray:
    """Covariance (n + ny, n + ny) of what inputs do not explain of the rows ``left_over``.

    Its trace is 1: the gain does not depend on the size of the noise, the Riccati solver does.
    """
    noise = left_over - _shares(left_over, inputs) @ inputs
    noise /= max(float(np.linalg.norm(noise)), np.finfo(float).tiny)
    return np.asarray(noise @ noise.T + LEAST_COVARIANCE * np.eye(len(noise)))


def _innovation_gain(A: RealArray, C: RealArray, covariance: RealArray) -> RealArray | None:
    """Gain K of the stationary Kalman filter; None where the Riccati equation has no solution.

    ``covariance`` is that of state and output noise, (n + ny, n + ny).
    """
    n = len(A)
    Q, S, R = covariance[:n, :n], covariance[:n, n:], covariance[n:, n:]
    try:
        P = solve_discrete_are(A.T, C.T, Q, R, s=S)
    except (LinAlgError, ValueError):
        return None
    return np.asarray(np.linalg.solve(C @ P @ C.T + R, (A @ P @ C.T + S).T).T)


def _inputs(A: RealArray, C: RealArray, u: RealArray, y: RealArray) -> tuple[RealArray, RealArray]:
    """B (n, nu) and D (ny, nu) whose simulation, from any initial state, fits y (N, ny) best."""
    n, nu, ny = len(A), u.shape[1], len(C)
    eye = np.eye(n)
    # Column by column: the states that an entry of B, or of the initial state, brings about.
    driven = np.zeros((n, n * (nu + 1)))
    driven[:, n * nu :] = eye
    rows = np.empty((len(u), ny, n * (nu + 1) + ny * nu))
    for t, now in enumerate(u):
        rows[t, :, : driven.shape[1]] = C @ driven
        rows[t, :, driven.shape[1] :] = np.kron(now, np.eye(ny))
        driven = A @ driven
        driven[:, : n * nu] += np.kron(now, eye)
    flat = rows.reshape(len(u) * ny, -1)
    found = np.asarray(np.linalg.lstsq(flat, y.ravel(), rcond=None)[0], dtype=float)
    B, D = found[: n * nu], found[n * (nu + 1) :]
    return B.reshape(nu, n).T, D.reshape(nu, ny).T
