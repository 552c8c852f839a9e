"""Models of plants in loops by instrumental variables: the signals that the excitation explains.

Sources: L. Ljung, System Identification, 2nd ed., 1999, section 7.6; P. Young, Recursive Estimation
and Time-Series Analysis, 2nd ed., 2011, chapter 7 (refined instruments).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from workbench._core.arrays import BoolArray, RealArray
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.polynomials.regressions import arx_from_lags

SETTLED, SLOWEST = 1e-3, 0.9999
"""Fraction of a filter's initial state at which it counts as settled; a pole beyond the radius is
not waited for.
"""
REFINEMENTS = 8
"""Number of times that the signals are filtered by the poles of the previous model."""


def refined_arx(
    record: Experiments, clean: Experiments, order: int, direct: bool, period: int | None
) -> Iterator[InnovationsModel]:
    """ARX models by instruments; each after the first uses signals filtered by the last poles.

    The equation errors of the first model are the noise times the denominator. With fast sampling
    the denominator is small except at the highest frequencies, which then dominate.
    """
    model = instrumental_arx(record, clean, order, direct)
    yield model
    for _ in range(REFINEMENTS):
        model = instrumental_arx(*filtered_by_poles(model, period, record, clean), order, direct)
        means = record.u.mean(axis=0), record.y.mean(axis=0)
        model = replace(model, u_offset=means[0], y_offset=means[1])
        yield model


def filtered_by_poles(
    model: InnovationsModel, period: int | None, record: Experiments, clean: Experiments
) -> tuple[Experiments, Experiments]:
    """A record and its explained part, without means, filtered by a model's stabilised poles.

    If the excitation is periodic, the filter starts in its periodic steady state: from rest, slow
    modes would take long to settle.
    """
    poles = np.linalg.eigvals(model.A)
    outside = np.abs(poles) >= 1
    poles[outside] = 1 / poles[outside].conj()
    denominator = np.asarray(np.poly(poles).real, dtype=float)
    lead = 0
    if period is not None:
        slowest = np.log(SETTLED) / np.log(min(np.abs(poles).max(initial=0.1), SLOWEST))
        lead = period * min(math.ceil(slowest / period), len(clean) // period)

    def filtered(signals: RealArray, before: RealArray) -> RealArray:
        whole = np.vstack([before[:lead], signals]) - signals.mean(axis=0)
        return np.asarray(lfilter([1.0], denominator, whole, axis=0)[lead:])

    first, second = (
        replace(one, u=filtered(one.u, clean.u), y=filtered(one.y, clean.y))
        for one in (record, clean)
    )
    return first, second


def instrumental_arx(
    record: Experiments,
    clean: Experiments,
    order: int,
    direct: bool,
    kept: BoolArray | None = None,
) -> InnovationsModel:
    """ARX model of a record, with the noise-free record as instruments.

    ``kept`` (N,) marks the samples of y whose equations count; None: all.
    """
    means = record.u.mean(axis=0), record.y.mean(axis=0)
    u, y = record.u - means[0], record.y - means[1]
    lags = range(1, order + 1)

    def rows(inputs: RealArray, outputs: RealArray) -> RealArray:
        parts = [part[order - lag : len(part) - lag] for lag in lags for part in (inputs, outputs)]
        return np.hstack([*parts, inputs[order:]]) if direct else np.hstack(parts)

    regressors = rows(u, y)
    instruments = rows(clean.u - means[0], clean.y - means[1])
    if kept is not None:
        instruments = instruments * kept[order:, None]
    moments = instruments.T @ regressors
    scale = np.sqrt(np.sum(regressors**2, axis=0))
    scale[scale == 0] = 1.0
    theta = np.linalg.lstsq(moments / scale, instruments.T @ y[order:], rcond=None)[0]
    found = (theta / scale[:, None]).T
    nu, ny = u.shape[1], y.shape[1]
    coefficients = found[:, : order * (nu + ny)].reshape(ny, order, nu + ny)
    D = found[:, order * (nu + ny) :] if direct else np.zeros((ny, nu))
    model = arx_from_lags(coefficients, D, np.zeros(ny))
    return replace(
        model,
        K=np.zeros_like(model.K),
        u_offset=means[0],
        y_offset=means[1],
        **record.labels,
    )
