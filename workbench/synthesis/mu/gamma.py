"""The scalar function gamma of the (mu, D)-K iteration, fitted to wanted magnitudes."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from workbench._core.arrays import RealArray
from workbench.synthesis.mu.biquads import Biquads

GAMMA_FUNCTION = Biquads(1, 2)
"""Form of gamma: a gain and two biquads."""
MOST_EVALUATIONS = 80
"""Largest number of evaluations of one least-squares fit to a target."""
START_COUNT = 7
"""Number of log frequencies around which corners start in a fit to a target."""
CORNER_SPREAD = 0.6
"""Distance between the corners of an initial guess, in natural logarithms."""
SMOOTHING_WIDTH = 0.1
"""Standard deviation, in log frequency, of the weights that smooth the wanted gamma."""


def fitted_gamma(target: RealArray, omega: RealArray, weight: RealArray) -> RealArray:
    """Parameters (1, P) that fit log|gamma| to a target (F,) by weighted least squares."""
    bounds = GAMMA_FUNCTION.limits(omega, reach=1.0)

    def missed(x: RealArray) -> RealArray:
        return np.asarray(weight * (GAMMA_FUNCTION.log_magnitude(x[None], omega)[0][0] - target))

    def slopes(x: RealArray) -> RealArray:
        return np.asarray(weight[:, None] * GAMMA_FUNCTION.log_magnitude(x[None], omega)[1][0].T)

    gain = np.array([np.average(target, weights=weight)])
    low, high = np.log(omega[[0, -1]])
    middles = np.linspace(low, high, START_COUNT + 2)[1:-1]
    starts = [GAMMA_FUNCTION.guess(gain, middle, CORNER_SPREAD) for middle in middles]
    fits = [
        least_squares(
            missed, np.clip(x[0], *bounds), slopes, bounds=bounds, max_nfev=MOST_EVALUATIONS
        )
        for x in starts
    ]
    return np.asarray(min(fits, key=lambda fit: fit.cost).x[None])


def gaussian_mean(at: RealArray, values: RealArray) -> RealArray:
    """Mean of values with Gaussian weights of width `SMOOTHING_WIDTH` over the log frequencies
    `at`.
    """
    weight = np.exp(-(((at[:, None] - at) / SMOOTHING_WIDTH) ** 2) / 2)
    mean: RealArray = weight @ values / weight.sum(axis=1)
    return mean
