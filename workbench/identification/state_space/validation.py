"""Validation of a model: fits, and tests of its residuals.

Source: L. Ljung, System Identification, 2nd ed., 1999, section 16.6.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import correlate
from scipy.stats import norm

from workbench._core.arrays import RealArray
from workbench.errors import InputError

CORRELATION_BOUND = float(norm.ppf(0.995))
"""Bound [standard deviations] on 99 % of the estimated correlations of uncorrelated signals."""
OUTPUT_ROUNDING = 1e-12
"""Spread of an output, relative to its size, below which it counts as rounding: the output has
settled.
"""


def nrmse_fit(measured: RealArray, modelled: RealArray) -> RealArray:
    """Fit 100 (1 - |y - yhat| / |y - mean y|) [%] of each output (ny,), from (N, ny) arrays.

    Missing samples (NaN) in y do not count. For an output that has settled up to rounding, errors
    are relative to its size.
    """
    known = np.isfinite(measured)
    spread = np.linalg.norm(np.where(known, measured - np.nanmean(measured, axis=0), 0.0), axis=0)
    error = np.linalg.norm(np.where(known, measured - modelled, 0.0), axis=0)
    size = np.linalg.norm(np.where(known, measured, 0.0), axis=0)
    least = np.maximum(OUTPUT_ROUNDING * size, np.finfo(float).tiny)
    fit: RealArray = 100.0 * (1 - error / np.maximum(spread, least))
    return fit


def autocorrelation(residuals: RealArray, lags: int) -> RealArray:
    """Correlation of each residual with its own past, in standard deviations of white noise.

    From residuals (N, ny) the result is (lags, ny), for lags 1 to `lags`. Raises InputError if the
    record is not longer than the lags.
    """
    _refuse_lags(len(residuals), lags)
    own = _correlations(residuals, residuals, lags)[lags:]
    diagonal = np.einsum("kyy->ky", own)
    result: RealArray = diagonal[1:] / diagonal[0] * np.sqrt(len(residuals))
    return result


def cross_correlation(residuals: RealArray, inputs: RealArray, lags: int) -> RealArray:
    """Correlation of residuals with inputs, in standard deviations of independent signals.

    From residuals (N, ny) and inputs (N, nu) the result is (2 lags + 1, ny, nu), for lags from
    -lags to lags. At positive lags the input is earlier than the residual: correlation there is an
    error of the model. Correlation at negative lags shows feedback. The standard deviation accounts
    for coloured inputs and residuals. An input that never moves is correlated with nothing. Raises
    InputError if the record is not longer than the lags.
    """
    _refuse_lags(len(residuals), lags)
    far = len(residuals) // 4
    of_residuals = np.einsum("kyy->ky", _correlations(residuals, residuals, far))
    of_inputs = np.einsum("kuu->ku", _correlations(inputs, inputs, far))
    variance = np.einsum("ky,ku->yu", of_residuals, of_inputs) / len(residuals)
    # The sum of estimated correlations may be too small: use at least that of white signals.
    least = np.outer(of_residuals[far], of_inputs[far]) / len(residuals)
    spread = np.sqrt(np.maximum(variance, least))
    found = _correlations(residuals, inputs, lags)
    result: RealArray = np.divide(found, spread, out=np.zeros_like(found), where=spread > 0)
    return result


def share_outside(correlations: RealArray) -> float:
    """Share of correlations beyond the 99 % bound; it is near 0.01 for white residuals."""
    return float(np.mean(np.abs(correlations) > CORRELATION_BOUND))


def _correlations(a: RealArray, b: RealArray, lags: int) -> RealArray:
    """Correlations (2 lags + 1, na, nb): means of a_i(t) b_j(t - k) for k from -lags to lags.

    The means of both signals are removed first.
    """
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    middle = len(a) - 1
    pairs = [
        [correlate(x, z, method="fft")[middle - lags : middle + lags + 1] for z in b.T] for x in a.T
    ]
    return np.moveaxis(np.array(pairs), 2, 0) / len(a)


def _refuse_lags(samples: int, lags: int) -> None:
    """Raise `InputError` unless there are more residuals than lags, and at least one lag."""
    if not 1 <= lags < samples:
        raise InputError(
            f"{lags} lags of {samples} residuals; take at least one lag, and fewer than residuals"
        )
