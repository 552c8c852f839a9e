"""Regions of a ratio of two estimates: Fieller's sets, and the ratios that are known at all.

Let y and u be estimates of two complex numbers with circular normal errors of covariance C and nu
degrees of freedom. A ratio G is compatible with them where y - G u is with zero,

    |y - G u|^2 <= F (C_yy - 2 Re(conj(G) C_yu) + |G|^2 C_uu),   F the quantile of F(2, nu).

All such G form a disc if |u|^2 > F C_uu; otherwise the set is unbounded. The set contains the true
ratio with exactly the stated probability. But a disc is reported only at lines where u is
distinguishable from zero, and if there are few such lines, many of them may be chance. So lines are
chosen by the rule of Benjamini and Hochberg. If a share q of the lines is chosen, a region of
confidence c is computed with the confidence 1 - q (1 - c); then on average at most a share 1 - c of
the reported regions misses the truth.

Sources: E. C. Fieller, Some problems in interval estimation, J. Royal Statistical Society B 16(2),
1954; Y. Benjamini, Y. Hochberg, J. Royal Statistical Society B 57(1), 1995; Y. Benjamini, D.
Yekutieli, False discovery rate-adjusted multiple confidence intervals for selected parameters, J.
American Statistical Association 100(469), 2005.
"""

from __future__ import annotations

import numpy as np
from scipy import stats

from workbench._core.arrays import BoolArray, ComplexArray, RealArray

FALSELY_SEEN = 1e-3
"""Average share of the chosen lines at which u is zero and was chosen by chance."""


def seen(power: RealArray, degrees: float) -> BoolArray:
    """Lines (F,) at which |u|^2 is distinguishable from zero, by |u|^2 / E|error|^2 (F,).

    For a matrix U use the least eigenvalue of U U^H relative to the covariance of one of its
    columns.
    """
    chance = stats.f.sf(power, 2, degrees)
    chance = np.where(np.isnan(chance), 1.0, chance)
    limits = FALSELY_SEEN * np.arange(1, chance.size + 1) / chance.size
    below = np.flatnonzero(np.sort(chance) <= limits)
    found: BoolArray = chance <= (limits[below[-1]] if below.size else -1.0)
    return found


def ratio_reach(
    ratio: ComplexArray, joint: ComplexArray, degrees: RealArray, confidence: RealArray
) -> RealArray:
    """Least radii (...) of discs about ratios that contain Fieller's sets; some are infinite.

    ``joint`` (..., 2, 2) is C / |u|^2 of (y, u).
    """
    one = np.ones((*ratio.shape, 1, 1), complex)
    return row_reach(ratio[..., None], joint, one, degrees, confidence)[..., 0]


def row_variance(row: ComplexArray, joint: ComplexArray, spread: ComplexArray) -> RealArray:
    """E|error|^2 (..., n) of rows y U^-1, to first order; arguments as for `row_reach`."""
    ways = _noise_factors(row)
    own = np.einsum("...a,...ab,...b->...", ways, joint, ways.conj()).real
    found: RealArray = np.maximum(own, 0.0)[..., None] * np.einsum("...ii->...i", spread).real
    return found


def row_reach(
    row: ComplexArray,
    joint: ComplexArray,
    spread: ComplexArray,
    degrees: RealArray,
    confidence: RealArray,
) -> RealArray:
    """Least radii (..., n) of discs about the entries of G = y U^-1 that contain Fieller's sets.

    The set of a row contains the whole row with this confidence: all G for which y - G U is
    compatible with zero. In terms of the errors d of G it is an ellipsoid in complex space,

        d S^-1 d^H <= n F ((1, -G - d) J (1, -G - d)^H),   F the quantile of F(2 n, nu),

    where the errors of y - G U have the covariance (1, -G) J (1, -G)^H S after U^-1.

    Parameters
    ----------
    row
        Estimates (..., n).
    joint
        Covariance J (..., 1 + n, 1 + n) of the noise of y and of the rows of U.
    spread
        S (..., n, n).
    """
    n = row.shape[-1]
    quantile = np.asarray(n * stats.f.ppf(confidence, 2 * n, degrees))
    ways, inner = _noise_factors(row), np.linalg.inv(spread)
    product = np.einsum("...ab,...b->...a", joint, ways.conj())
    variance = np.einsum("...a,...a->...", ways, product).real
    lean = product[..., 1:]
    rest = inner - quantile[..., None, None] * joint[..., 1:, 1:]
    ends = np.linalg.eigvalsh(rest)[..., 0] > 0
    rest = np.where(ends[..., None, None], rest, np.eye(n))
    inverse = np.linalg.inv(rest)
    shift = quantile[..., None] * np.einsum("...ij,...j->...i", inverse, lean)
    beyond = quantile * (np.maximum(variance, 0.0) + _inner(lean, shift))
    size = np.sqrt(beyond[..., None] * np.einsum("...ii->...i", inverse).real)
    return np.where(ends[..., None], np.abs(shift) + size, np.inf)


def _noise_factors(row: ComplexArray) -> ComplexArray:
    """(1, -G), the factors with which noise enters y - G U."""
    return np.concatenate([np.ones_like(row[..., :1]), -row], axis=-1)


def _inner(a: ComplexArray, b: ComplexArray) -> RealArray:
    found: RealArray = np.einsum("...i,...i->...", a.conj(), b).real
    return found


def of_chosen(confidence: float, share: RealArray) -> RealArray:
    """Confidence for single regions that gives the chosen share of them this confidence."""
    return np.asarray(1.0 - share * (1.0 - confidence))
