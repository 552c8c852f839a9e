"""Upper bound on the share of an input's variance that comes from the outputs' new part."""

from __future__ import annotations

import numpy as np
from scipy import linalg, stats

from workbench._core.arrays import RealArray

CONFIDENCE = 0.95
"""Probability with which a share is below its bound."""


def correlations(a: RealArray, b: RealArray, first: int, last: int) -> RealArray:
    """Sums over k of a_(k+j) b_k at the leads j = first ... last."""
    size = 2 * len(a)
    product = np.fft.rfft(a, size) * np.conj(np.fft.rfft(b, size))
    return np.fft.irfft(product)[first : last + 1]


def largest_share(u: RealArray, new: RealArray, first: int, last: int) -> float:
    """Upper bound of the share of u's variance that comes from `new` (N, ny).

    The outputs' new part (their surprise, given all the past) is white. The share of u that linear
    feedback makes of its last samples is the sum of the squared correlations between u and them at
    the leads `first` to `last`. In an open loop estimated correlations r have mean 0 and covariance
    R / N, with R_ij the autocorrelation of u at lag i - j, whatever u is. So the sum of their
    squares has the mean trace(R) / N, which is subtracted, and the standard deviation sqrt(2
    trace(R^2) + 4 N r' R r) / N. The bound adds its `CONFIDENCE` quantile for a normal
    distribution. It assumes that feedback is linear and forgets within `last` samples.
    """
    n = len(u)
    energy = np.sum(u**2)
    own = correlations(u, u, 0, last - first) / energy
    found, spread = 0.0, 0.0
    for channel in _uncorrelated(new).T:
        r = correlations(u, channel, first, last) / np.sqrt(energy * n)
        count = len(r)
        found += float(np.sum(r**2)) - count / n
        lags = np.arange(1, count)
        square = count + 2.0 * np.sum((count - lags) * own[1:] ** 2)
        spread += (2.0 * square + 4.0 * n * r @ linalg.matmul_toeplitz(own, r)) / n**2
    bound = max(found, 0.0) + stats.norm.ppf(CONFIDENCE) * np.sqrt(max(spread, 0.0))
    return float(min(bound, 1.0))


def _uncorrelated(new: RealArray) -> RealArray:
    """Combinations of channels (N, ny) that are uncorrelated with unit variance."""
    left, size, _ = np.linalg.svd(new, full_matrices=False)
    return left[:, size > 1e-9 * size[0]] * np.sqrt(len(new)) if size[0] > 0 else new[:, :0]
