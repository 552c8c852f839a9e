"""Autoregressions of errors by their autocovariances, of the order that Akaike's criterion chooses.

Source: P. Stoica, R. Moses, Spectral Analysis of Signals, 2005, sections 3.4 (the equations of Yule
and Walker) and C.3 (order).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_toeplitz

from workbench._core.arrays import RealArray

LONGEST_PER_DECADE = 10
"""Longest autoregression that is tried [samples], over the decimal logarithm of the samples."""
EXPLAINED = 1e-12
"""Least variance that an autoregression leaves, over that of the errors."""


def autoregression(errors: RealArray, order: int) -> RealArray:
    """Factors (order,) of the last errors (N,) in the next one; they make a stable filter."""
    return _factors(_autocovariances(errors, order), order)


def chosen_autoregression(errors: RealArray) -> RealArray:
    """As `autoregression`, of the order (0 for white errors) that Akaike's criterion chooses."""
    samples = len(errors)
    longest = min(int(LONGEST_PER_DECADE * np.log10(samples)), samples // 4)
    covariances = _autocovariances(errors, longest)
    if covariances[0] == 0:
        return np.zeros(0)
    fits = [_factors(covariances, order) for order in range(longest + 1)]
    left = [1 - fit @ covariances[1 : len(fit) + 1] / covariances[0] for fit in fits]
    criterion = samples * np.log(np.maximum(left, EXPLAINED)) + 2 * np.arange(longest + 1)
    return fits[int(np.argmin(criterion))]


def _autocovariances(errors: RealArray, longest: int) -> RealArray:
    """Autocovariances (longest + 1,) of errors (N,); missing ones (NaN) count as zero."""
    v = np.nan_to_num(errors - np.nanmean(errors))
    return np.array([v[: len(v) - k] @ v[k:] for k in range(longest + 1)]) / len(v)


def _factors(covariances: RealArray, order: int) -> RealArray:
    if order == 0 or covariances[0] == 0:
        return np.zeros(order)
    return np.asarray(solve_toeplitz(covariances[:order], covariances[1 : order + 1]))
