"""Values and derivatives of products of quadratic factors, compiled."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.compiled import unchecked

LARGEST_LOGARITHM = 40.0
"""Largest |logarithm| of a coefficient; beyond it the root is far from all data."""


@unchecked
def factored_values(
    vector: RealArray,
    omega: RealArray,
    level: RealArray,
    coefficients: RealArray,
    moving: NDArray[np.bool_],
    positive: NDArray[np.bool_],
    numerators: int,
) -> tuple[ComplexArray, ComplexArray]:
    """Values (F,) and derivatives (F, P) of gain * prod(numerators) / prod(denominators).

    Parameters
    ----------
    vector
        Parameters (P,): those of each factor in turn, and the gain.
    omega
        Frequencies [rad/s] (F,).
    level, coefficients, moving, positive
        For each factor (K,): the frequency [rad/s] that scales s, the coefficients (K, 3) of the
        powers 0 to 2, which of them are parameters (K, 3), and whether the parameters are
        logarithms.
    numerators
        Number of factors of the numerator, which come first.
    """
    count = level.size
    now, scale = coefficients.copy(), np.ones(coefficients.shape)
    at = 0
    for i in range(count):
        for power in range(3):
            if moving[i, power]:
                now[i, power] = vector[at]
                if positive[i]:
                    bounded = max(-LARGEST_LOGARITHM, min(LARGEST_LOGARITHM, vector[at]))
                    now[i, power] = scale[i, power] = math.exp(bounded)
                at += 1
    gain = vector[at]
    values = np.empty(omega.size, dtype=np.complex128)
    slopes = np.empty((omega.size, vector.size), dtype=np.complex128)
    factor = np.empty(count, dtype=np.complex128)
    others = np.empty(count, dtype=np.complex128)
    for f in range(omega.size):
        bottom, top = complex(1.0), complex(1.0)
        for i in range(count):
            x = omega[f] / level[i]
            factor[i] = complex(now[i, 0] - now[i, 2] * x * x, now[i, 1] * x)
            if i >= numerators:
                size = factor[i].real ** 2 + factor[i].imag ** 2
                factor[i] = complex(factor[i].real / size, -factor[i].imag / size)
                bottom *= factor[i]
        # a factor may be zero: its derivative uses the product without it, instead of a division
        for i in range(numerators):
            others[i] = top
            top *= factor[i]
        behind = complex(1.0)
        for i in range(numerators - 1, -1, -1):
            others[i] *= behind
            behind *= factor[i]
        bare = top * bottom
        values[f], slopes[f, vector.size - 1] = gain * bare, bare
        at = 0
        for i in range(count):
            x = omega[f] / level[i]
            outer = gain * (others[i] * bottom if i < numerators else -bare * factor[i])
            for power in range(3):
                if moving[i, power]:
                    part = outer * scale[i, power]
                    if power == 0:
                        slopes[f, at] = part
                    elif power == 1:
                        slopes[f, at] = complex(-part.imag * x, part.real * x)
                    else:
                        slopes[f, at] = -part * (x * x)
                    at += 1
    return values, slopes
