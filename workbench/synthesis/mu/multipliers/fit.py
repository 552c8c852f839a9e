"""Fit of multipliers to a loop: they minimise the bound that they prove.

Multipliers at a frequency are not unique, and they are arbitrary where mu is small. The parameters
are therefore not fitted to values of multipliers: the fit minimises the largest ratio, over
frequency, of the bound that the multipliers prove to a reference. `ScalingFit` of D-K iteration
does the same without G and with one function for each block, where second derivatives are cheap:
its Newton method needs a tenth of the steps.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from workbench._core.arrays import Array, RealArray
from workbench.executor.clock import tick
from workbench.synthesis.mu.biquads import FrequencyRange
from workbench.synthesis.mu.multipliers import triangles
from workbench.synthesis.mu.multipliers.functions import Multipliers
from workbench.synthesis.mu.multipliers.scaled_loop import ScaledLoop

SHARPNESS_STAGES = (6.0, 25.0, 100.0, 400.0)
"""Exponents of the power mean that replaces the maximum; each fit starts from the result of the one
before.
"""
MOST_ITERATIONS, SETTLED = 80, 1e-6
"""Largest number of L-BFGS iterations for one exponent; they end earlier if the logarithm falls by
less than the second number.
"""


def fit_multipliers(
    multipliers: Multipliers,
    M: Array,
    omega: RealArray,
    reference: RealArray,
    x: RealArray,
    within: FrequencyRange,
) -> tuple[RealArray, float]:
    """The best parameters near `x`, and the logarithm of their largest ratio of bound to reference.

    Parameters
    ----------
    multipliers
        The functions whose parameters are sought.
    M, omega
        The loop's response (F, c, r) at frequencies (F,) [rad/s].
    reference
        Positive values (F,) by which the proven bound is divided.
    x
        Parameters (rows, P) to start from.
    within
        Lowest and highest corner frequency [rad/s].
    """
    bounds, log_reference = _bounds(multipliers, within), np.log(reference)

    def cost(flat: RealArray, sharpness: float) -> tuple[float, RealArray]:
        tick("fit of multipliers")
        at = ScaledLoop.of(multipliers, M, omega, flat.reshape(x.shape))
        excess = at.log_beta - log_reference
        weight = np.exp(sharpness * (excess - excess.max()))
        mean = excess.max() + np.log(weight.mean()) / sharpness
        price, slope = at.price()
        slope += at.slope(weight / weight.sum())
        return float(mean + price), slope.ravel()

    def missed(flat: RealArray) -> float:
        at = ScaledLoop.of(multipliers, M, omega, flat.reshape(x.shape))
        return float(np.max(at.log_beta - log_reference))

    found = [x.ravel()]  # the start may already be the best
    for sharpness in SHARPNESS_STAGES:
        stage = minimize(
            cost,
            found[-1],
            args=(sharpness,),
            jac=True,
            method="L-BFGS-B",
            bounds=bounds,
            options={"maxiter": MOST_ITERATIONS, "ftol": SETTLED},
        )
        found.append(stage.x)
    best = min(found, key=missed)
    return best.reshape(x.shape), missed(best)


def _bounds(multipliers: Multipliers, within: FrequencyRange) -> list[tuple[float, float]]:
    """Lower and upper limits of all parameters."""
    row = [(low, high) for low, high in multipliers.functions.bounds(within).tolist()]
    no_gain = [(0.0, 0.0), *row[1:]]
    entry = triangles.parameter_bounds(multipliers.functions.size, within)
    counts = (
        multipliers.channels,
        multipliers.real.shape[1],
        multipliers.rows - multipliers.functions.rows,
    )
    kinds = zip((row, no_gain, entry), counts, strict=True)
    return [bound for one, count in kinds for bound in one * count]
