"""Polynomial models that are linear in their parameters: ARX.

Source: L. Ljung, System Identification, 2nd ed., 1999, section 4.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.gains import operating_point
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.regression import lagged_triangle, least_squares
from workbench.identification.innovations.scaling import Scaling
from workbench.input_checks import need_kind, need_whole


def arx(
    record: Experiments,
    order: int,
    *,
    direct: bool = True,
    delay_samples: Sequence[int] = (),
    apart: bool = False,
) -> InnovationsModel | None:
    """ARX model of experiments, with matrix polynomials for several outputs.

    None if the record is too short.

        y(t) + A_1 y(t-1) + ... + A_n y(t-n) = B_0 u(t) + ... + B_n u(t-n) + e(t)

    Parameters
    ----------
    order
        Degree n.
    direct
        Whether inputs may act within the sample; otherwise B_0 = 0.
    delay_samples
        Delays [samples] of the inputs (nu,); empty for none.
    apart
        Whether each output depends only on its own past and on the inputs: A_1 to A_n are diagonal.

    Raises
    ------
    InputError
        The record is none, as arrays are; `as_experiments` makes one. The order is no whole number
        of 0 or more; or a finding of the record's report forbids its use: `as_experiments` takes
        ``assume``.

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
    need_kind(record, Experiments, "record")
    need_whole(order, "order")
    if order < 0:
        raise InputError(f"order is {order}; it must be 0 or more")
    record.report_for(direct=direct, order=order).need_usable()
    return arx_model(record, order, direct=direct, delay=delay_samples, apart=apart)


def arx_model(
    record: Experiments,
    order: int,
    *,
    direct: bool = True,
    delay: Sequence[int] = (),
    apart: bool = False,
) -> InnovationsModel | None:
    """As `arx`, for a record that has been checked."""
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
    return replace(model, delay_samples=tuple(delay)) if any(delay) else model


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
