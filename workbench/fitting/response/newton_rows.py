"""Rows whose products are the matrix of Newton's equations of the least peak, compiled."""

from __future__ import annotations

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.compiled import unchecked


@unchecked
def newton_rows(
    slopes: ComplexArray,
    values: ComplexArray,
    weight: RealArray,
    error: ComplexArray,
    unit: float,
    multiplier: RealArray,
    ratio: RealArray,
) -> tuple[RealArray, RealArray, RealArray]:
    """Rows (3F, 2P) and (3F, P), and the real part (P,) of the sum of c dG.

    The factors are c = 2 z conj(e) weight / unit. The transpose of the first rows times the second
    are two matrices (P, P): the sum of 2 z Re(conj(de) de^T) + ratio d|e|^2 d|e|^2^T, and the real
    part of the sum of (c / G) dG dG^T, from which second derivatives of factored functions follow.

    Parameters
    ----------
    slopes, values
        Derivatives (F, P) of the function, and its values G (F,).
    weight, error, unit
        Weights (F,) of the errors, weighted errors (F,), and the unit in which e is taken.
    multiplier, ratio
        z (F,) and z over the slack (F,).
    """
    count, parameters = slopes.shape
    left = np.zeros((3 * count, 2 * parameters))
    right = np.empty((3 * count, parameters))
    bend = np.zeros(parameters)
    for f in range(count):
        scale, z = weight[f] / unit, 2 * multiplier[f]
        e = error[f] / unit
        factor = z * scale * e.conjugate()
        per_value = factor / values[f] / scale if values[f] != 0 else complex(0.0)
        for a in range(parameters):
            slope = slopes[f, a]
            real, imaginary = scale * slope.real, scale * slope.imag
            steep = 2 * (e.real * real + e.imag * imaginary)
            right[f, a] = real
            right[count + f, a] = imaginary
            right[2 * count + f, a] = steep
            left[f, a] = z * real
            left[count + f, a] = z * imaginary
            left[2 * count + f, a] = ratio[f] * steep
            turned = per_value * slope
            left[f, parameters + a] = turned.real
            left[count + f, parameters + a] = -turned.imag
            bend[a] += factor.real * slope.real - factor.imag * slope.imag
    return left, right, bend
