"""Regions of a ratio of two estimates: Fieller's sets, and which ratios are known at all.

Let y and u be estimates of two complex numbers with circular normal errors of covariance C and nu
degrees of freedom. A ratio G is compatible with them where y - G u is with zero,

    |y - G u|^2 <= F (C_yy - 2 Re(conj(G) C_yu) + |G|^2 C_uu),   F the quantile of F(2, nu).

All such G fill a disc where |u|^2 > F C_uu; elsewhere they reach to infinity. The set holds the
true ratio with exactly the stated probability. But a disc is only told where u is seen, and among
few that are seen many are seen by chance. So lines are chosen by Benjamini's and Hochberg's rule,
and of a chosen share q of them a region of confidence c is one of 1 - q (1 - c): then the share of
the told regions that miss their truth is at most 1 - c in the mean.

Sources: E. C. Fieller, Some problems in interval estimation, J. Royal Statistical Society B 16(2),
1954; Y. Benjamini, Y. Hochberg, J. Royal Statistical Society B 57(1), 1995; Y. Benjamini, D.
Yekutieli, False discovery rate-adjusted multiple confidence intervals for selected parameters, J.
American Statistical Association 100(469), 2005.
"""

from __future__ import annotations

import numpy as np
from scipy import stats

from workbench.arrays import BoolArray, ComplexArray, RealArray

FALSELY_SEEN = 1e-3
"""Share of the chosen lines, in the mean, at which u is zero and was seen by chance."""


def seen(u: ComplexArray, variance: RealArray, degrees: float) -> BoolArray:
    """Lines (F,) at which u (F,) of a variance E|error|^2 (F,) is distinguishable from zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        chance = stats.f.sf(np.abs(u) ** 2 / variance, 2, degrees)
    chance = np.where(np.isnan(chance), 1.0, chance)
    limits = FALSELY_SEEN * np.arange(1, chance.size + 1) / chance.size
    below = np.flatnonzero(np.sort(chance) <= limits)
    found: BoolArray = chance <= (limits[below[-1]] if below.size else -1.0)
    return found


def ratio_variance(ratio: ComplexArray, joint: ComplexArray) -> RealArray:
    """E|error|^2 of ratios (...), to first order; ``joint`` (..., 2, 2) is C / |u|^2 of (y, u)."""
    cross = (ratio.conj() * joint[..., 0, 1]).real
    own: RealArray = joint[..., 0, 0].real - 2 * cross + np.abs(ratio) ** 2 * joint[..., 1, 1].real
    return np.maximum(own, 0.0)


def ratio_reach(
    ratio: ComplexArray, joint: ComplexArray, degrees: RealArray, confidence: RealArray
) -> RealArray:
    """Least radii (...) of discs about the ratios that hold Fieller's sets; infinite ones too.

    ``joint`` is as for `ratio_variance`.
    """
    quantile = stats.f.ppf(confidence, 2, degrees)
    variance = ratio_variance(ratio, joint)
    lean = np.abs(joint[..., 0, 1] - ratio * joint[..., 1, 1])
    rest = 1.0 - quantile * joint[..., 1, 1].real
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = quantile * lean / rest
        reach: RealArray = shift + np.sqrt(shift**2 + quantile * variance / rest)
    return np.where(rest > 0, reach, np.inf)


def of_chosen(confidence: float, share: RealArray) -> RealArray:
    """Confidence of single regions with which those of a chosen share of all have this one."""
    return np.asarray(1.0 - share * (1.0 - confidence))
