"""How good a model is: fits, and tests of its residuals.

Source: L. Ljung, System Identification, 2nd ed., 1999, section 16.6.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import correlate
from scipy.stats import norm

from workbench.arrays import RealArray
from workbench.errors import InputError

BOUND = float(norm.ppf(0.995))
"""Standard deviations within which 99 % of correlations lie when there is none."""


def nrmse_fit(measured: RealArray, modelled: RealArray) -> RealArray:
    """100 (1 - |y - yhat| / |y - mean y|) per output [%], for (N, ny) arrays: (ny,)."""
    spread = np.linalg.norm(measured - measured.mean(axis=0), axis=0)
    fit: RealArray = 100.0 * (1 - np.linalg.norm(measured - modelled, axis=0) / spread)
    return fit


def autocorrelation(residuals: RealArray, lags: int) -> RealArray:
    """Correlation of each residual with its own past, in standard deviations of white noise.

    residuals (N, ny); returns (lags, ny) for lags 1 to `lags`. Raises InputError where the record
    is not longer than the lags.
    """
    _refuse_lags(len(residuals), lags)
    own = _correlations(residuals, residuals, lags)[lags:]
    diagonal = np.einsum("kyy->ky", own)
    result: RealArray = diagonal[1:] / diagonal[0] * np.sqrt(len(residuals))
    return result


def cross_correlation(residuals: RealArray, inputs: RealArray, lags: int) -> RealArray:
    """Correlation of residuals with inputs, in standard deviations of independent signals.

    residuals (N, ny), inputs (N, nu); returns (2 lags + 1, ny, nu) for lags from -lags to lags. At
    positive lags the input is the earlier one: what is left there, the model has missed; at
    negative lags there is feedback. The standard deviation accounts for coloured inputs and
    residuals. Raises InputError where the record is not longer than the lags.
    """
    _refuse_lags(len(residuals), lags)
    far = len(residuals) // 4
    of_residuals = np.einsum("kyy->ky", _correlations(residuals, residuals, far))
    of_inputs = np.einsum("kuu->ku", _correlations(inputs, inputs, far))
    variance = np.einsum("ky,ku->yu", of_residuals, of_inputs) / len(residuals)
    # A sum of estimated correlations may come out too small; never below that of white residuals.
    least = np.outer(of_residuals[far], of_inputs[far]) / len(residuals)
    result: RealArray = _correlations(residuals, inputs, lags) / np.sqrt(
        np.maximum(variance, least)
    )
    return result


def share_outside(correlations: RealArray) -> float:
    """Share of correlations beyond the 99 % bound; near 0.01 for a model that left nothing."""
    return float(np.mean(np.abs(correlations) > BOUND))


def _correlations(a: RealArray, b: RealArray, lags: int) -> RealArray:
    """Mean of a_i(t) b_j(t - k) with means removed, k from -lags to lags: (2 lags + 1, na, nb)."""
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    middle = len(a) - 1
    pairs = [
        [correlate(x, z, method="fft")[middle - lags : middle + lags + 1] for z in b.T] for x in a.T
    ]
    return np.moveaxis(np.array(pairs), 2, 0) / len(a)


def _refuse_lags(samples: int, lags: int) -> None:
    if not 1 <= lags < samples:
        raise InputError(
            f"{lags} lags of {samples} residuals; take at least one lag, and fewer than residuals"
        )
