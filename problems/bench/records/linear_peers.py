"""Linear models by sippy_unipi, nfoursid and statsmodels, as candidates to choose from.

Every package gets signals with zero mean and unit standard deviation. Its models are written as
innovations models, so that the same code predicts and simulates for all packages.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from workbench.identification import Experiments, InnovationsModel
from workbench.identification.innovations.gains import innovation_gain
from workbench.identification.innovations.scaling import Scaling
from workbench.identification.polynomials.regressions import arx_from_lags
from workbench.types import RealArray

Scaled = Callable[[RealArray, RealArray], InnovationsModel | None]
"""Function of scaled inputs (N, nu) and outputs (N, ny) that returns a model, or None."""
Fitting = Callable[[Experiments], Any]
"""Function of one experiment that returns a model, or None."""

ORDERS = (1, 2, 3, 4, 6, 8, 10, 12, 16)
HORIZONS = (5, 10, 20, 40)
SIPPY_ALGORITHMS = ("N4SID", "MOESP", "CVA", "PARSIM-K")
BLOCK_ROWS = (5, 10, 20)
LAGS = (1, 2, 3, 4, 6, 8, 12, 20)
NOISES = ((1, 0), (2, 0), (2, 2))
"""Autoregressive and moving-average orders of the noise in SARIMAX."""
FIR_LAGS = (5, 15)
LARGEST_SARIMAX = 2500
"""Largest number of samples for which SARIMAX is tried, since its cost is high."""


def sippy(nu: int, ny: int, samples: int) -> Iterator[tuple[str, Fitting]]:
    """Subspace models by sippy_unipi for every algorithm, horizon and order."""
    for algorithm in SIPPY_ALGORITHMS:
        for horizon in HORIZONS:
            if horizon * (nu + ny) * 2 < samples // 3:
                for order in ORDERS:
                    if order <= horizon:
                        label = f"{algorithm}, horizon {horizon}, order {order}"
                        yield label, _scaled(_sippy(algorithm, horizon, order))


def _sippy(algorithm: str, horizon: int, order: int) -> Scaled:
    from sippy_unipi import system_identification

    def fit(u: RealArray, y: RealArray) -> InnovationsModel | None:
        with contextlib.redirect_stdout(io.StringIO()):
            system = system_identification(
                y.T,
                u.T,
                algorithm,
                SS_f=horizon,
                SS_p=horizon,
                SS_fixed_order=order,
                SS_D_required=True,
            )
        if np.shape(system.K) != (len(system.A), y.shape[1]) or len(system.A) != order:
            return None  # no Kalman gain was found, or the package lowered the order
        return _unscaled(system.A, system.B, system.C, system.D, system.K)

    return fit


def nfoursid(nu: int, ny: int, samples: int) -> Iterator[tuple[str, Fitting]]:
    """Subspace models by nfoursid for every number of block rows and every order."""
    for rows in BLOCK_ROWS:
        if rows * (nu + ny) * 2 < samples // 3:
            for order in ORDERS:
                if order <= rows * ny:
                    yield f"block rows {rows}, order {order}", _scaled(_nfoursid(rows, order))


def _nfoursid(rows: int, order: int) -> Scaled:
    import pandas as pd
    from nfoursid.nfoursid import NFourSID

    def fit(u: RealArray, y: RealArray) -> InnovationsModel | None:
        inputs = [f"u{j}" for j in range(u.shape[1])]
        outputs = [f"y{j}" for j in range(y.shape[1])]
        table = pd.DataFrame(np.hstack([u, y]), columns=[*inputs, *outputs])
        work = NFourSID(table, outputs, inputs, num_block_rows=rows)
        work.subspace_identification()
        found, covariance = work.system_identification(rank=order)
        ny = y.shape[1]
        swap = np.r_[ny : ny + order, :ny]  # the package puts the noise of outputs first
        gain = innovation_gain(found.a, found.c, covariance[np.ix_(swap, swap)])
        return None if gain is None else _unscaled(found.a, found.b, found.c, found.d, gain)

    return fit


def statsmodels(nu: int, ny: int, samples: int) -> Iterator[tuple[str, Fitting]]:
    """Autoregressions with distributed lags, and regressions with ARMA noise, by statsmodels."""
    for lags in LAGS:
        if 3 * lags * (nu + ny) < samples // 2:
            yield f"ARDL, {lags} lags", _scaled(_ardl(lags))
    if ny == 1 and nu <= 2 and samples <= LARGEST_SARIMAX:
        for noise in NOISES:
            for lags in FIR_LAGS:
                label = f"SARIMAX, noise {noise}, {lags} lags of inputs"
                yield label, _scaled(_sarimax(noise, lags))


def _ardl(lags: int) -> Scaled:
    """Each output depends on its own past, on past other outputs, and on inputs up to now."""
    import pandas as pd
    from statsmodels.tsa.ardl import ARDL

    def fit(u: RealArray, y: RealArray) -> InnovationsModel:
        nu, ny = u.shape[1], y.shape[1]
        names = [f"u{j}" for j in range(nu)], [f"y{j}" for j in range(ny)]
        inputs = pd.DataFrame(u, columns=names[0])
        outputs = pd.DataFrame(y, columns=names[1])
        taps, direct, level = np.zeros((ny, lags, nu + ny)), np.zeros((ny, nu)), np.zeros(ny)
        for row, name in enumerate(names[1]):
            others = outputs.drop(columns=name)
            orders = {one: list(range(lags + 1)) for one in inputs} | {
                one: list(range(1, lags + 1)) for one in others
            }
            exogenous = pd.concat([inputs, others], axis=1)
            model = ARDL(outputs[name], lags, exogenous, orders, trend="c")
            found = model.fit().params
            level[row] = found["const"]
            for j, one in enumerate([*names[0], *names[1]]):
                for lag in range(1, lags + 1):
                    taps[row, lag - 1, j] = found[f"{one}.L{lag}"]
            direct[row] = [found[f"{one}.L0"] for one in names[0]]
        return arx_from_lags(taps, direct, level)

    return fit


def _sarimax(noise: tuple[int, int], lags: int) -> Scaled:
    """y(t) = c + sum of b_k u(t - k) + w(t), where w is an ARMA process."""
    from statsmodels.tsa.statespace.sarimax import SARIMAX

    def fit(u: RealArray, y: RealArray) -> InnovationsModel:
        nu, p, q = u.shape[1], *noise
        late = [np.roll(u, lag, axis=0)[lags:] for lag in range(lags + 1)]
        model = SARIMAX(y[lags:, 0], np.hstack(late), (p, 0, q), trend="c")
        found = dict(zip(model.param_names, model.fit(disp=0, maxiter=60).params, strict=True))
        taps = np.array([found[f"x{k + 1}"] for k in range(nu * (lags + 1))]).reshape(-1, nu)
        order = max(p, q)
        past = np.array([found.get(f"ar.L{k + 1}", 0.0) for k in range(order)])
        moving = np.array([found.get(f"ma.L{k + 1}", 0.0) for k in range(order)])
        companion = np.eye(order, k=1)
        companion[:, 0] = past
        shift = np.kron(np.eye(lags, k=-1), np.eye(nu))
        enters = np.vstack([np.eye(nu), np.zeros((nu * (lags - 1), nu))])
        A = block_diag(companion, shift)
        B = np.vstack([np.zeros((order, nu)), enters])
        C = np.hstack([np.eye(1, order), taps[1:].reshape(1, -1)])
        K = np.concatenate([past + moving, np.zeros(nu * lags)])[:, None]
        # With exogenous inputs the constant is in the equation of the noise.
        level = np.array([found["intercept"] / (1 - past.sum())])
        return replace(_unscaled(A, B, C, taps[:1], K), y_offset=level)

    return fit


def _unscaled(*matrices: Any) -> InnovationsModel:
    A, B, C, D, K = (np.asarray(matrix, dtype=float) for matrix in matrices)
    return InnovationsModel(A, B, C, D, K, np.zeros(B.shape[1]), np.zeros(len(C)))


def _scaled(fit: Scaled) -> Fitting:
    """A fitting function for records, made from one for scaled signals."""

    def fitted(record: Experiments) -> InnovationsModel | None:
        scaling = Scaling.of(record)
        model = fit(*scaling.scaled(record.u, record.y))
        return model and scaling.restored(model, record)

    return fitted
