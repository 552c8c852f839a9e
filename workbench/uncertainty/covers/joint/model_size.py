"""Size of the sets of a model that contains its plants, and its gradient, compiled.

The size is the mean over log frequency of |W_c|^2 + length_weight |W_r|^2, in units of the
deviations, or the inflation over the raw sets. W_c is scaled so that it reaches, at each frequency,
the radius around the segment of W_r that each plant needs. A norm of high power replaces the
largest ratio of a needed radius to |W_c|, so that the size is smooth.
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.compiled import unchecked
from workbench.fitting.factored_values import factored_values
from workbench.uncertainty.covers.joint.damping import with_penalty
from workbench.uncertainty.covers.joint.measures import mean_square, smooth_inflation
from workbench.uncertainty.covers.joint.radii import needed_radii, norm_of_ratios
from workbench.uncertainty.covers.joint.size_data import CIRCLE, NOMINAL, REAL, TINY, SizeData


@unchecked
def model_size(vector: RealArray, data: SizeData, power: int) -> tuple[float, RealArray]:
    """Mean square size, or inflation, and its gradient (P,), with a norm of the given power, which
    is a power of two.

    If a pair of roots of a weight has less damping than the frequencies resolve, the response
    between them is unknown, and a penalty enlarges the size.
    """
    count, plants = data.points.shape
    first, second = data.parameter[1], data.parameter[2]
    nominal, by_nominal = data.nominal, np.zeros((count, 0), dtype=np.complex128)
    end = np.zeros(count, dtype=np.complex128)
    by_end = np.zeros((count, 0), dtype=np.complex128)
    far = np.zeros(data.far.size, dtype=np.complex128)
    by_far = np.zeros((data.far.size, 0), dtype=np.complex128)
    if first > 0:
        nominal, by_nominal = _part(vector, data.omega, data, NOMINAL)
    if second > first:
        end, by_end = _part(vector, data.omega, data, REAL)
        far, by_far = _part(vector, data.far, data, REAL)
    circle, by_circle = _part(vector, data.reached, data, CIRCLE)
    width = np.abs(circle)

    away, along, radius = needed_radii(nominal, end, data)
    norm, pull, own = norm_of_ratios(radius, width, data, power)
    far_square = 0.0
    for f in range(data.far.size):
        far_square += (far[f].real ** 2 + far[f].imag ** 2) / data.far_unit[f] ** 2

    if data.about.size > 0:
        value, by_width, by_gain, by_length, by_plant, by_square = smooth_inflation(
            norm, width, np.abs(end), np.abs(nominal), far_square, data, power
        )
    else:
        value, by_width, by_gain, by_length, by_plant, by_square = mean_square(
            norm, width, np.abs(end), far_square, data
        )

    gradient = np.zeros(vector.size)
    for k in range(data.reached.size):
        back = (by_width[k] - by_gain * own[k]) * circle[k].conjugate() / width[k] ** 2
        _add(gradient, second, back, by_circle[k])
    for f in range(count):
        to = end[f] / data.unit[f]
        at_nominal, at_end = complex(by_plant[f] / nominal[f]), complex(0.0)
        scale = 1 / nominal[f] if data.multiplicative else complex(1 / data.unit[f])
        for i in range(plants):
            if pull[f, i] > 0.0:
                size = max(np.sqrt(away[f, i].real ** 2 + away[f, i].imag ** 2), TINY)
                turned = by_gain * pull[f, i] / radius[f, i] / size * away[f, i].conjugate()
                at_end -= turned * along[f, i]
                if data.multiplicative:
                    turned *= data.points[f, i] * scale
                at_nominal -= turned * scale
        if first > 0 and at_nominal != 0.0:
            _add(gradient, 0, at_nominal, by_nominal[f])
        if second > first:
            at_end += by_length[f] * to.conjugate() / max(abs(to), TINY)
            _add(gradient, first, at_end / data.unit[f], by_end[f])
    if second > first:
        for f in range(data.far.size):
            back = 2 * by_square * far[f].conjugate() / data.far_unit[f] ** 2
            _add(gradient, first, back, by_far[f])
    return with_penalty(value, gradient, vector, data)


@unchecked
def _part(
    vector: RealArray, omega: RealArray, data: SizeData, part: int
) -> tuple[ComplexArray, ComplexArray]:
    """Values (F,) of a part of the model at frequencies, and derivatives by its parameters."""
    i, j = data.factor[part], data.factor[part + 1]
    return factored_values(
        vector[data.parameter[part] : data.parameter[part + 1]],
        omega,
        data.level[i:j],
        data.coefficients[i:j],
        data.moving[i:j],
        data.positive[i:j],
        data.numerators[part],
    )


@unchecked
def _add(gradient: RealArray, start: int, slope: complex, derivatives: ComplexArray) -> None:
    """Add the real part of slope times the derivatives (Q,) to the gradient, beginning at
    `start`.
    """
    for a in range(derivatives.size):
        each = derivatives[a]
        gradient[start + a] += slope.real * each.real - slope.imag * each.imag
