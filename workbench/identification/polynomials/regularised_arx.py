"""Long ARX models with regularised polynomials: predictors whose order need not be chosen.

The one-step predictor has impulse responses from past inputs and from past outputs. Their prior
covariance is the tuned and correlated kernel, whose hyperparameters maximise the marginal
likelihood. Source: G. Pillonetto, A. Chiuso, G. De Nicolao, "Prediction error identification of
linear systems: a nonparametric Gaussian regression approach", Automatica 47(2), 2011.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from workbench._core.arrays import RealArray
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.regression import LEAST_NOISE, lagged_triangle
from workbench.identification.innovations.scaling import Scaling
from workbench.identification.polynomials.regressions import arx_from_lags

LAGS = 40
"""Largest number of lags."""
ROWS_FOR_EACH = 3
"""Fewest samples in the record for each lag of each channel."""
FEWEST_LAGS = 3
MOST_CHANNELS_APART = 3
"""Records with more channels use one scale and decay for all inputs, and another for all other
outputs.
"""
DECAYS = (0.5, 0.8, 0.95)
"""Decay factors per sample with which the search starts."""
LARGEST_EXPONENT = 15.0
"""Bound on the logarithms of scale and of decay."""


def regularised_arx(
    record: Experiments, *, direct: bool = True, delay: Sequence[int] = ()
) -> InnovationsModel | None:
    """ARX model with long, regularised polynomials; None if the record is too short.

    Parameters
    ----------
    direct
        Whether inputs may act within the sample.
    delay
        Delays [samples] of the inputs (nu,); empty for none.
    """
    late = record.delayed(delay)
    nu, ny = late.u.shape[1], late.y.shape[1]
    m = nu + ny
    lags = min(LAGS, len(late) // (ROWS_FOR_EACH * (m + 1)))
    if lags < FEWEST_LAGS:
        return None
    scaling = Scaling.of(late)
    lagged = lagged_triangle((scaling.scaled(*piece) for piece in late.pieces()), lags, m)
    if lagged.rows < ROWS_FOR_EACH * lags:
        return None
    r, last = lagged.factor, lagged.factor.shape[1]
    places = [[1 + lag * m + j for lag in range(lags)] for j in range(m)]
    if direct:
        places[:nu] = [[last - m + j, *later] for j, later in enumerate(places[:nu])]
    order = [0, *(place for channel in places for place in channel), *range(last - ny, last)]
    factor = np.asarray(np.linalg.qr(r[:, order], mode="r"))
    count = sum(map(len, places))
    R, targets, rest = (
        factor[1 : 1 + count, 1 : 1 + count],
        factor[1 : 1 + count, 1 + count :],
        factor[1 + count :, 1 + count :],
    )
    free = max(lagged.rows - 1 - count, 1)
    found = np.empty((ny, count))
    for o in range(ny):
        noise = max(float(rest[:, o] @ rest[:, o]) / free, LEAST_NOISE)
        groups = _groups(nu, ny, o)
        found[o] = _posterior_mean(R, targets[:, o], noise, [len(c) for c in places], groups)
    level = (factor[0, 1 + count :] - found @ factor[0, 1 : 1 + count]) / factor[0, 0]
    taps, D, end = np.zeros((ny, lags, m)), np.zeros((ny, nu)), 0
    for j, channel in enumerate(places):
        response = found[:, end : end + len(channel)]
        end += len(channel)
        if len(channel) > lags:
            D[:, j], response = response[:, 0], response[:, 1:]
        taps[:, :, j] = response
    model = scaling.restored(arx_from_lags(taps, D, level), late)
    return replace(model, delay_samples=tuple(delay)) if any(delay) else model


def _groups(nu: int, ny: int, output: int) -> list[int]:
    """Group (nu + ny,) of each channel; channels of a group share a scale and a decay."""
    if nu + ny <= MOST_CHANNELS_APART:
        return list(range(nu + ny))
    own = [1 if o == output else 2 for o in range(ny)]
    return [0] * nu + own


def _posterior_mean(
    R: RealArray, target: RealArray, noise: float, counts: Sequence[int], groups: Sequence[int]
) -> RealArray:
    """Maximum a posteriori coefficients, with hyperparameters by marginal likelihood.

    ``counts`` are the numbers of coefficients of the channels, ``groups`` their groups.
    """
    names = sorted(set(groups))

    def kernels(parameters: RealArray) -> RealArray:
        parameters = np.clip(parameters, -LARGEST_EXPONENT, LARGEST_EXPONENT)
        covariance = np.zeros((sum(counts), sum(counts)))
        end = 0
        for count, group in zip(counts, groups, strict=True):
            place = 2 * names.index(group)
            scale, decay = np.exp(parameters[place]), 1 / (1 + np.exp(-parameters[place + 1]))
            later = np.maximum.outer(np.arange(count), np.arange(count))
            part = slice(end, end + count)
            covariance[part, part] = scale * decay**later
            end += count
        return covariance

    def cost(parameters: RealArray) -> float:
        covariance = R @ kernels(parameters) @ R.T
        covariance[np.diag_indices_from(covariance)] += noise
        try:
            factor = cho_factor(covariance, lower=True)
        except np.linalg.LinAlgError:
            return np.inf
        half = 2 * float(np.log(np.diag(factor[0])).sum())
        return half + float(target @ cho_solve(factor, target))

    starts = [np.tile([0.0, np.log(d / (1 - d))], len(names)) for d in DECAYS]
    start = min(starts, key=cost)
    limits = {"maxiter": 100 * len(names), "xatol": 0.05, "fatol": 0.1}
    best = minimize(cost, start, method="Nelder-Mead", options=limits)
    prior = kernels(best.x)
    covariance = R @ prior @ R.T
    covariance[np.diag_indices_from(covariance)] += noise
    return np.asarray(prior @ R.T @ cho_solve(cho_factor(covariance, lower=True), target))
