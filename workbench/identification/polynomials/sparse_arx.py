"""Sparse ARX models: the lagged samples that explain most of an output are added one by one.

Forward selection by orthogonal least squares: each new term is the one that, with the terms chosen
before, reduces the squared errors most. Their number minimises the Bayesian information criterion.
If a record hardly determines a full regression, as a short one with many channels or slow inputs,
few terms predict it better. Source: S. Chen, S. Billings, W. Luo, "Orthogonal least squares methods
and their application to non-linear system identification", International Journal of Control 50(5),
1989.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from workbench._core.arrays import RealArray
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.regression import lagged_triangle, least_squares
from workbench.identification.innovations.scaling import Scaling
from workbench.identification.polynomials.regressions import arx_from_lags

MOST_TERMS = 60
"""Most terms for an output."""
ROWS_FOR_EACH = 3
"""Fewest samples in the record for each term."""
LEAST_NEW_SHARE = 1e-10
"""A regressor counts as rounding if the part that the chosen terms do not explain is below this
share of its square.
"""


def sparse_arx(
    record: Experiments,
    lags: int,
    *,
    direct: bool = True,
    delay: Sequence[int] = (),
    apart: bool = False,
) -> InnovationsModel | None:
    """Sparse ARX model of experiments; None if the record is too short.

    Parameters
    ----------
    lags
        Longest lag [samples] of a term.
    direct
        Whether inputs may act within the sample.
    delay
        Delays [samples] of the inputs (nu,); empty for none.
    apart
        Whether each output depends only on its own past and on the inputs.
    """
    late = record.delayed(delay)
    nu, ny = late.u.shape[1], late.y.shape[1]
    m = nu + ny
    scaling = Scaling.of(late)
    lagged = lagged_triangle((scaling.scaled(*piece) for piece in late.pieces()), lags, m)
    most = min(MOST_TERMS, lagged.rows // ROWS_FOR_EACH)
    if most < 1:
        return None
    r = lagged.factor
    taps, D, level = np.zeros((ny, lags, m)), np.zeros((ny, nu)), np.zeros(ny)
    history, now = np.arange(1, 1 + lags * m), np.arange(nu) + 1 + lags * m
    for o in range(ny):
        own = (history - 1) % m
        past = history[(own < nu) | (own == nu + o)] if apart else history
        offered = np.concatenate([past, now]) if direct else past
        target = r[:, r.shape[1] - ny + o]
        kept = offered[_terms(r[:, offered], target, r[:, 0], lagged.rows, most)]
        found = np.zeros(r.shape[1])
        found[[0, *kept]] = least_squares(r[:, [0, *kept]], target[:, None])[0]
        level[o], D[o] = found[0], found[now]
        taps[o] = found[history].reshape(lags, m)
    model = scaling.restored(arx_from_lags(taps, D, level), late)
    return replace(model, delay_samples=tuple(delay)) if any(delay) else model


def _terms(
    offered: RealArray, target: RealArray, constant: RealArray, samples: int, most: int
) -> list[int]:
    """Chosen columns of regressors (N, n) for a target (N,), in addition to a constant (N,)."""
    unit = constant / np.linalg.norm(constant)
    left = offered - np.outer(unit, unit @ offered)
    error = target - unit * (unit @ target)
    smallest = LEAST_NEW_SHARE * np.maximum((offered**2).sum(axis=0), np.finfo(float).tiny)
    taken: list[int] = []
    criteria = [_information(float(error @ error), samples, 1)]
    while len(taken) < most:
        sizes = (left**2).sum(axis=0)
        usable = sizes > smallest
        usable[taken] = False
        if not usable.any():
            break
        gains = np.where(usable, (error @ left) ** 2 / np.where(usable, sizes, 1.0), -1.0)
        chosen = int(gains.argmax())
        unit = left[:, chosen] / np.sqrt(sizes[chosen])
        left = left - np.outer(unit, unit @ left)
        error = error - unit * (unit @ error)
        taken.append(chosen)
        criteria.append(_information(float(error @ error), samples, 1 + len(taken)))
    return taken[: int(np.argmin(criteria))]


def _information(squares: float, samples: int, parameters: int) -> float:
    """Bayesian information criterion of a regression with this sum of squared errors."""
    size = max(squares / samples, np.finfo(float).tiny)
    return float(samples * np.log(size) + parameters * np.log(samples))
