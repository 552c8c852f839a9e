"""Polynomial models that are linear in their parameters: ARX, and regularised impulse responses.

Sources: L. Ljung, System Identification, 2nd ed., 1999, section 4.2; T. Chen, L. Ljung,
"Implementation of algorithms for tuning parameters in regularized least squares problems in system
identification", Automatica 49(7), 2013 (the marginal likelihood by triangular factors).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag, cho_factor, cho_solve, solve_triangular
from scipy.optimize import minimize

from workbench.arrays import RealArray
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.gains import operating_point
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.regression import lagged_triangle, least_squares
from workbench.identification.innovations.scaling import Scaling

TAPS = 70
"""Largest number of samples of an impulse response."""
ROWS_FOR_EACH = 3
"""Fewest samples for each tap."""
LEAST_NOISE = 1e-12
"""Variance of the noise, relative to that of the output, below which it is rounding."""
DECAYS = (0.5, 0.8, 0.95)
"""Decays of an impulse response per sample from which the best one is sought."""


def arx(
    record: Experiments,
    order: int,
    *,
    direct: bool = True,
    delay: Sequence[int] = (),
    apart: bool = False,
) -> InnovationsModel | None:
    """ARX model of experiments, its polynomials matrices for several outputs; None if too short.

        y(t) + A_1 y(t-1) + ... + A_n y(t-n) = B_0 u(t) + ... + B_n u(t-n) + e(t)

    Parameters
    ----------
    order
        Degree n.
    direct
        Whether inputs may act at once: without, B_0 = 0.
    delay
        Delays [samples] of the inputs (nu,); empty for none.
    apart
        Whether each output depends on its own past alone and on inputs: A_1 to A_n are diagonal.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import arx, as_experiments
    >>> u = np.random.default_rng(0).standard_normal(1000)
    >>> y = control.forced_response(control.tf([0.5], [1, -0.5], 1.0), inputs=u).outputs
    >>> model = arx(as_experiments(u, y), order=1)
    >>> float(model.A[0, 0].round(4)), model.order
    (0.5, 1)
    """
    late = record.delayed(delay)
    nu, ny = late.u.shape[1], late.y.shape[1]
    m = nu + ny
    scaling = Scaling.of(late)
    lagged = lagged_triangle((scaling.scaled(*piece) for piece in late.pieces()), order, m)
    if lagged.rows < 2 * (1 + order * (nu + 1 if apart else m) + nu):
        return None
    r = lagged.factor
    columns = r.shape[1] - ny if direct else lagged.history.stop
    found = np.zeros((ny, columns))
    for o in range(ny):
        others = [nu + j for j in range(ny) if apart and j != o]
        kept = np.setdiff1d(
            np.arange(columns), [1 + lag * m + j for lag in range(order) for j in others]
        )
        found[o, kept] = least_squares(r[:, kept], r[:, [r.shape[1] - ny + o]])[0]
    lags = found[:, lagged.history].reshape(ny, order, m)
    D = found[:, lagged.history.stop :] if direct else np.zeros((ny, nu))
    model = scaling.restored(arx_from_lags(lags, D, found[:, 0]), late)
    return replace(model, delay=tuple(delay)) if any(delay) else model


def arx_from_lags(lags: RealArray, D: RealArray, level: RealArray) -> InnovationsModel:
    """Observer form of y(t) = level + D u(t) + sum over k of lags[:, k] (u, y)(t - k - 1) + e(t).

    ``lags`` has shape (ny, order, nu + ny), D (ny, nu), ``level`` (ny,).
    """
    ny, order = lags.shape[:2]
    nu = D.shape[1]
    past_in, past_out = lags[:, :, :nu], lags[:, :, nu:]
    A = np.eye(order * ny, k=ny)
    A[:, :ny] = np.moveaxis(past_out, 1, 0).reshape(order * ny, ny)
    K = A[:, :ny].copy()
    B = np.moveaxis(past_in, 1, 0).reshape(order * ny, nu) + K @ D
    C = np.eye(ny, order * ny)
    forcing = np.zeros(order * ny)
    forcing[:ny] = level
    offsets = operating_point(A, B, C, D, forcing, np.zeros(ny))
    return InnovationsModel(A, B, C, D, K, *offsets)


def impulse_response(
    record: Experiments, *, direct: bool = True, delay: Sequence[int] = ()
) -> InnovationsModel | None:
    """Impulse responses regularised by a kernel that decays; None if the record is too short.

    Prior covariance c d^max(i, j) of samples i and j (the tuned and correlated kernel), with a
    scale c and a decay d for each pair of channels at which the marginal likelihood is largest.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import as_experiments, impulse_response
    >>> u = np.random.default_rng(0).standard_normal(1000)
    >>> y = control.forced_response(control.tf([0.5], [1, -0.5], 1.0), inputs=u).outputs
    >>> model = impulse_response(as_experiments(u, y))
    >>> float((model.C @ model.B)[0, 0].round(2))  # the first sample of the response
    0.5
    """
    late = record.delayed(delay)
    nu, ny = late.u.shape[1], late.y.shape[1]
    scaling = Scaling.of(late)
    taps = min(TAPS, len(late) // (ROWS_FOR_EACH * (nu + 1)))
    if taps < 2:
        return None
    lagged = lagged_triangle((scaling.scaled(*piece) for piece in late.pieces()), taps, nu + ny)
    if lagged.rows < ROWS_FOR_EACH * taps:
        return None
    r, m, last = lagged.factor, nu + ny, lagged.factor.shape[1]
    places = [[1 + (lag - 1) * m + j for lag in range(1, taps + 1)] for j in range(nu)]
    if direct:
        places = [[last - m + j, *lags] for j, lags in enumerate(places)]
    order = [0, *(place for lags in places for place in lags), *range(last - ny, last)]
    factor = np.asarray(np.linalg.qr(r[:, order], mode="r"))
    inside = factor[1:, 1:]  # without means
    count = len(places[0])
    R, targets = inside[: count * nu, : count * nu], inside[: count * nu, count * nu :]
    rest = inside[count * nu :, count * nu :]
    free = max(lagged.rows - 1 - count * nu, 1)
    response = np.empty((ny, nu, count))
    for o in range(ny):
        noise = float(rest[:, o] @ rest[:, o]) / free
        noise = max(noise, LEAST_NOISE)
        response[o] = _regularised(R, targets[:, o], noise, nu, count).reshape(nu, count)
    level = factor[0, order.index(last - ny) :] / factor[0, 0]
    means = factor[0, 1 : 1 + count * nu] / factor[0, 0]
    level = level - response.reshape(ny, -1) @ means
    model = _shift_register(response, level, direct)
    found = scaling.restored(model, late)
    return replace(found, delay=tuple(delay)) if any(delay) else found


def _regularised(R: RealArray, target: RealArray, noise: float, nu: int, count: int) -> RealArray:
    """Taps (nu count,) of the largest posterior density, hyperparameters by marginal likelihood."""
    later = np.maximum.outer(np.arange(count), np.arange(count))

    def kernel_root(parameters: RealArray) -> RealArray:
        blocks = []
        for j in range(nu):
            scale, decay = np.exp(parameters[2 * j]), 1 / (1 + np.exp(-parameters[2 * j + 1]))
            kernel = scale * decay**later + 1e-12 * scale * np.eye(count)
            blocks.append(np.linalg.cholesky(kernel))
        return np.asarray(block_diag(*blocks))

    def cost(parameters: RealArray) -> float:
        try:
            moved = R @ kernel_root(np.clip(parameters, -15, 15))
            covariance = moved @ moved.T + noise * np.eye(len(moved))
            factor = cho_factor(covariance, lower=True)
        except np.linalg.LinAlgError:
            return np.inf
        half = 2 * float(np.log(np.diag(factor[0])).sum())
        return half + float(target @ cho_solve(factor, target))

    starts = [np.tile([0.0, np.log(d / (1 - d))], nu) for d in DECAYS]
    start = min(starts, key=cost)
    best = minimize(cost, start, method="Nelder-Mead", options={"maxiter": 120 * nu, "fatol": 0.1})
    root = kernel_root(np.clip(best.x, -15, 15))
    rows = np.vstack([R @ root, np.sqrt(noise) * np.eye(root.shape[1])])
    Q, triangle = np.linalg.qr(rows)
    white = solve_triangular(triangle, Q[: len(R)].T @ target)
    return np.asarray(root @ white)


def _shift_register(response: RealArray, level: RealArray, direct: bool) -> InnovationsModel:
    """Model whose states are past inputs, from impulse responses (ny, nu, taps)."""
    ny, nu = response.shape[:2]
    lags = response[:, :, 1:] if direct else response
    length = lags.shape[2]
    A = block_diag(*[np.eye(length, k=-1)] * nu)
    B = block_diag(*[np.eye(length, 1)] * nu)
    D = response[:, :, 0] if direct else np.zeros((ny, nu))
    return InnovationsModel(
        A, B, lags.reshape(ny, -1), D, np.zeros((len(A), ny)), np.zeros(nu), np.asarray(level)
    )
