"""Predictor-based subspace identification: an innovations model without iterations.

A long vector autoregression with inputs gives the Markov parameters of the one-step predictor. The
product of their Hankel matrix with the past of the record is factored into observability matrix and
states. Inputs may depend on past noise, so closed-loop records are allowed.

Source: A. Chiuso, "The role of vector autoregressive modeling in predictor-based subspace
identification", Automatica 43(6), 2007.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from workbench.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.experiments.quality import checked_record
from workbench.identification.state_space.innovations import InnovationsModel

HORIZONS = (10, 15, 20, 30, 40)
"""Lengths [samples] of the past from which `best_subspace` chooses."""


def subspace(u: RealArray, y: RealArray, order: int, past: int) -> InnovationsModel:
    """Innovations model of a record u (N, nu), y (N, ny).

    Parameters
    ----------
    order
        Number of states, 1 to past * ny.
    past
        Number of past samples that the predictor uses; powers of A - K C should decay within them.

    Raises
    ------
    InputError
        The same as for `checked_record`; the order or the past is too large for the record.
    """
    u, y = checked_record(u, y)
    nu, ny = u.shape[1], y.shape[1]
    refuse_order(order, past, len(u), nu, ny)
    u_offset, y_offset = u.mean(axis=0), y.mean(axis=0)
    u_scale, y_scale = u.std(axis=0), y.std(axis=0)
    inputs, outputs = (u - u_offset) / u_scale, (y - y_offset) / y_scale

    joint = np.hstack([inputs, outputs])
    rows = len(joint) - past
    history = np.hstack([joint[past - lag : past - lag + rows] for lag in range(1, past + 1)])
    now_in, now_out = inputs[past:], outputs[past:]
    markov = _least_squares(np.hstack([history, now_in]), now_out)[:, : history.shape[1]]

    # Block row i of observability times reachability: the Markov parameters, shifted by i samples.
    product = np.zeros((past * ny, history.shape[1]))
    for i in range(past):
        keep = history.shape[1] - i * (nu + ny)
        product[i * ny : (i + 1) * ny, :keep] = markov[:, i * (nu + ny) :]
    triangle: RealArray = np.linalg.qr(history)[1]
    left, singular, _ = np.linalg.svd(product @ triangle.T, full_matrices=False)
    states = history @ product.T @ (left[:, :order] / np.sqrt(singular[:order]))

    output = _least_squares(np.hstack([states, now_in]), now_out)
    innovation = now_out - np.hstack([states, now_in]) @ output.T
    update = _least_squares(np.hstack([states, now_in, innovation])[:-1], states[1:])
    return InnovationsModel(
        A=update[:, :order],
        B=update[:, order : order + nu] / u_scale,
        C=y_scale[:, None] * output[:, :order],
        D=y_scale[:, None] * output[:, order:] / u_scale,
        K=update[:, order + nu :] / y_scale,
        u_offset=u_offset,
        y_offset=y_offset,
    )


def best_subspace(u: RealArray, y: RealArray, order: int) -> InnovationsModel | None:
    """The best subspace model of a record u (N, nu), y (N, ny) over several pasts, or None.

    Only stable models with a stable predictor count; the best one fits its own record best. The
    result is None if no past gives one.
    """
    nu, ny = u.shape[1], y.shape[1]
    fitting = [past for past in HORIZONS if order_fits(order, past, len(u), nu, ny)]
    return best_fitting((subspace(u, y, order, past) for past in fitting), u, y)


def best_fitting(
    models: Iterable[InnovationsModel | None], u: RealArray, y: RealArray
) -> InnovationsModel | None:
    """The model that fits a record u (N, nu), y (N, ny) best, None where none is stable.

    Only stable models with a stable predictor count.
    """
    best, least = None, np.inf
    for model in models:
        if model is None or max(model.radius, model.predictor_radius) >= 1 - 1 / len(u):
            continue  # unstable, or with a time constant longer than the record
        misfit = sum(
            float(np.mean(np.linalg.norm(y - run(u, y, len(y)), axis=0) / y.std(axis=0)))
            for run in (model.one_step, model.free_run)
        )
        if misfit < least:
            best, least = model, misfit
    return best


def order_fits(order: int, past: int, samples: int, nu: int, ny: int) -> bool:
    """Whether a record is long enough for the vector autoregression, and that for the order."""
    unknowns = past * (nu + ny) + nu
    return 1 <= order <= past * ny and samples - past >= 2 * unknowns


def refuse_order(order: int, past: int, samples: int, nu: int, ny: int) -> None:
    """Raise InputError unless `order_fits`."""
    if not order_fits(order, past, samples, nu, ny):
        raise InputError(
            f"order {order} with a past of {past} does not fit a record of {samples} samples: "
            f"1 <= order <= {past * ny} and at least {past + 2 * (past * (nu + ny) + nu)} samples "
            "are needed; lower the order, or the past, or take a longer record"
        )


def _least_squares(regressors: RealArray, targets: RealArray) -> RealArray:
    """Matrix X that minimises |targets - regressors X^T|."""
    return np.asarray(np.linalg.lstsq(regressors, targets, rcond=None)[0].T, dtype=float)
