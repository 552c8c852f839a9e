"""Tests of a weighted fit: its cost against the expected one, and whiteness over frequency.

A variance estimated from periods has few degrees of freedom. Errors divided by it are not normal
but have the distribution of Hotelling's T^2, and parameters scatter more than the inverse of the
information matrix says. All formulas are for M' = degrees / 2 complex degrees of freedom and d
entries that are whitened together (J. Schoukens, R. Pintelon, G. Vandersteen and P. Guillaume,
Automatica 33(6), 1997, for d = 1; moments of the inverse of a complex Wishart matrix for d > 1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from workbench._core.arrays import ComplexArray, RealArray

WHITENESS_LAGS = 20
"""Largest lag, in frequencies, at which residuals are correlated."""
FREQUENCIES_PER_LAG = 10
"""Fewest frequencies for each lag."""
LEVEL = 0.01
"""Significance level of both tests together, below which a model is rejected."""


@dataclass(frozen=True)
class ResidualTests:
    """Results of tests of a model's residuals.

    Parameters
    ----------
    cost
        Sum of squared residuals, each in units of its standard deviation.
    expected
        Its mean for a correct model.
    cost_p
        Probability of at least this cost for a correct model.
    whiteness_p
        p-value of the hypothesis that residuals are uncorrelated over frequency; NaN with too few
        frequencies.
    """

    cost: float
    expected: float
    cost_p: float
    whiteness_p: float

    @property
    def accepted(self) -> bool:
        """Whether neither test rejects the model, at `LEVEL` shared between them."""
        return not (self.cost_p < LEVEL / 2 or self.whiteness_p < LEVEL / 2)


def residual_tests(
    residual: ComplexArray, unknowns: int, degrees: float, together: int
) -> ResidualTests:
    """The tests of whitened residuals (F, p, m) of a fit with this number of unknowns.

    ``degrees`` are those of the variance, infinite if it is known; ``together`` is the number of
    entries whitened together.
    """
    cost = float(np.sum(np.abs(residual) ** 2))
    terms = residual.size / together
    share = 1.0 - unknowns / (2.0 * residual.size)
    if np.isinf(degrees):
        expected = 2.0 * residual.size - unknowns
        cost_p = float(stats.chi2.sf(cost, expected)) if expected else float("nan")
    else:
        complex_degrees = degrees / 2
        spare = complex_degrees - together + 1
        law = stats.f(2 * together, 2 * spare)
        scale = 2 * complex_degrees * together / spare
        expected = terms * scale * float(law.mean()) - unknowns * spread_factor(degrees, together)
        deviation = scale * float(law.std()) * np.sqrt(terms * max(share, 0.0))
        cost_p = float(stats.norm.sf((cost - expected) / deviation)) if deviation else float("nan")
    return ResidualTests(cost, expected, cost_p, p_of_white_residuals(residual))


def least_degrees(together: int) -> float:
    """Degrees of freedom that a variance needs for the tests and the covariance to exist."""
    return 2.0 * (together + 1)


def spread_factor(degrees: float, together: int) -> float:
    """Ratio of the covariance of the estimates to the inverse of the information matrix."""
    if np.isinf(degrees):
        return 1.0
    complex_degrees = degrees / 2
    found: float = complex_degrees**2 / ((complex_degrees - together) ** 2 - 1)
    return found


def p_of_white_residuals(residual: ComplexArray) -> float:
    """p-value of no correlation between residuals (F, p, m) of neighbouring frequencies.

    At each lag k, sum_f r_f^H r_(f + k) over the root of its sum of squares is nearly a complex
    normal number of variance 1, whatever the distribution of independent residuals is.
    """
    flat = residual.reshape(len(residual), -1)
    lags = min(WHITENESS_LAGS, len(flat) // FREQUENCIES_PER_LAG)
    if lags < 1:
        return float("nan")
    total = 0.0
    for lag in range(1, lags + 1):
        products = np.sum(flat[:-lag].conj() * flat[lag:], axis=1)
        square = float(np.sum(np.abs(products) ** 2))
        if square:
            total += 2.0 * abs(np.sum(products)) ** 2 / square
    return float(stats.chi2.sf(total, 2 * lags))


def bayes_criterion(tests: ResidualTests, count: int, unknowns: int) -> float:
    """Bayesian information criterion N log(cost / N) + P log N with an unknown scale of the noise.

    G. Schwarz, Annals of Statistics 6(2), 1978. N real data, P unknowns.
    """
    return float(count * np.log(max(tests.cost, 1e-300) / count) + unknowns * np.log(count))


def two_sided_normal(confidence: float) -> float:
    """Half-width of an interval of a normal variable, in standard deviations."""
    return float(stats.norm.ppf((1 + confidence) / 2))


def disc_radius(covariance: RealArray, confidence: float, dimension: int = 2) -> RealArray:
    """Radii of discs that contain normal numbers with covariances (..., 2, 2) of both parts.

    With the number of estimated coefficients as ``dimension``, all discs hold simultaneously: each
    is the projection of the coefficients' ellipsoid (H. Scheffe, The Analysis of Variance, 1959).
    """
    largest = np.linalg.eigvalsh(covariance)[..., -1]
    found: RealArray = np.sqrt(stats.chi2.ppf(confidence, dimension) * np.maximum(largest, 0.0))
    return found
