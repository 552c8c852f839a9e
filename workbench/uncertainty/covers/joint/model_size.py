"""Size of the sets of a model that contains its plants, and its gradient, compiled.

The size is the mean over log frequency of |W_c|^2 + length_weight |W_r|^2, in units of the
deviations, or the inflation over the raw sets. W_c is scaled so that it reaches, at each frequency,
the radius around the segment of W_r that each plant needs. A norm of high power replaces the
largest ratio of a needed radius to |W_c|, so that the size is smooth.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.compiled import unchecked
from workbench.fitting.factored_values import factored_values
from workbench.uncertainty.covers.weights import SUFFICIENT_DAMPING

TINY = float(np.finfo(float).tiny)
"""Least divisor, against division by zero."""
LEAST_PULL = 1e-18
"""A ratio below this share of the largest one is neglected in the norm."""
RESOLVED_MARGIN = 1.02
"""Least damping of roots of weights, relative to the damping that the frequencies resolve."""
NOMINAL, REAL, CIRCLE = 0, 1, 2
"""Parts of a model: the nominal, W_r and W_c."""
BLEND = 8.0
"""Power of the norm that replaces the larger one of two ratios."""


class SizeData(NamedTuple):
    """Data on which the size of a model depends, besides its parameters (P,).

    ``points`` (F, N) are the plants at frequencies ``omega`` (F,) [rad/s], ``unit`` (F,) is the
    unit of their deviations, and ``floor`` (F,) is added to radii. ``nominal`` (F,) is the response
    of a given nominal, and ``shares`` (F,) are weights of the frequencies. W_c is evaluated at
    ``reached`` (R,) [rad/s], where its own size has the weight ``counted`` (R,). There it must
    reach the radii at the frequencies with index ``row`` (R,). Where ``onward`` (R,) is not 0, it
    must reach the radius interpolated in log-log scale at this share of the way to the next
    frequency. The square of W_r at ``far`` [rad/s] over that of ``far_unit`` is added.

    ``level``, ``coefficients``, ``moving`` and ``positive`` are the factors as `factored_values`
    takes them. Part k of the model has the factors from ``factor[k]`` to ``factor[k + 1]``, of
    which ``numerators[k]`` are in the numerator, and the parameters from ``parameter[k]`` to
    ``parameter[k + 1]``. A part that is given or missing has none.

    ``damping`` and ``tone`` (K, P + 1) give the logarithms of damping and frequency of the pairs of
    roots of the weights, the last column without parameters. ``gap`` are the distances of
    neighbours of log omega and ``middle`` their middles.

    The inflation needs radius plus half-length of the raw sets: ``about`` (F,) of those about a
    nominal, in units of the deviations, and ``free`` (F,) of those with free centres, in units
    ``plain`` (F,) of the plants. ``free_square`` is the mean square of the latter's radii.
    ``given`` (R,) tells which of the frequencies ``reached`` are given ones. For the mean square
    size ``about`` is empty.
    """

    omega: RealArray
    points: ComplexArray
    unit: RealArray
    floor: RealArray
    nominal: ComplexArray
    shares: RealArray
    reached: RealArray
    row: np.ndarray
    onward: RealArray
    counted: RealArray
    far: RealArray
    far_unit: RealArray
    level: RealArray
    coefficients: RealArray
    moving: np.ndarray
    positive: np.ndarray
    factor: np.ndarray
    numerators: np.ndarray
    parameter: np.ndarray
    damping: RealArray
    tone: RealArray
    middle: RealArray
    gap: RealArray
    multiplicative: bool
    length_weight: float
    about: RealArray
    free: RealArray
    plain: RealArray
    free_square: float
    given: np.ndarray


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

    away, along, radius = _needed(nominal, end, data)
    norm, pull, own = _reached(radius, width, data, power)
    far_square = 0.0
    for f in range(data.far.size):
        far_square += (far[f].real ** 2 + far[f].imag ** 2) / data.far_unit[f] ** 2

    if data.about.size > 0:
        value, by_width, by_gain, by_length, by_plant, by_square = _inflation(
            norm, width, np.abs(end), np.abs(nominal), far_square, data, power
        )
    else:
        value, by_width, by_gain, by_length, by_plant, by_square = _mean_square(
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
    return _resolved(value, gradient, vector, data)


@unchecked
def _needed(
    nominal: ComplexArray, end: ComplexArray, data: SizeData
) -> tuple[ComplexArray, RealArray, RealArray]:
    """Distance (F, N) of each plant from the nearest point of the segment, the place of that point
    on the segment, and the radius that the plant needs.
    """
    count, plants = data.points.shape
    away = np.empty((count, plants), dtype=np.complex128)
    along = np.empty((count, plants))
    radius = np.empty((count, plants))
    for f in range(count):
        to = end[f] / data.unit[f]
        per_square = 1 / max(to.real * to.real + to.imag * to.imag, TINY)
        scale = 1 / nominal[f] if data.multiplicative else complex(1 / data.unit[f])
        center = complex(1.0) if data.multiplicative else nominal[f] * scale
        for i in range(plants):
            deviation = data.points[f, i] * scale - center
            share = (deviation.real * to.real + deviation.imag * to.imag) * per_square
            along[f, i] = max(-1.0, min(1.0, share))
            away[f, i] = deviation - along[f, i] * to
            size = away[f, i].real ** 2 + away[f, i].imag ** 2
            radius[f, i] = max(np.sqrt(size), TINY) + data.floor[f]
    return away, along, radius


@unchecked
def _reached(
    radius: RealArray, width: RealArray, data: SizeData, power: int
) -> tuple[float, RealArray, RealArray]:
    """Norm of the ratios of needed radii to |W_c|, and the derivatives of its logarithm: by the
    logarithms of the radii (F, N), and of |W_c| (R,) less the sign.
    """
    count, plants = radius.shape
    rows, most = data.reached.size, 0.0
    ratio = np.empty((rows, plants))
    for k in range(rows):
        f, onward = data.row[k], data.onward[k]
        scale = data.unit[f] / width[k]
        for i in range(plants):
            ratio[k, i] = radius[f, i] * scale
        if onward > 0.0:
            scale = data.unit[f + 1] / width[k]
            for i in range(plants):
                ratio[k, i] *= (radius[f + 1, i] * scale / ratio[k, i]) ** onward
        for i in range(plants):
            most = max(most, ratio[k, i])
    total, least = 0.0, LEAST_PULL ** (1 / power)
    for k in range(rows):
        for i in range(plants):
            share = ratio[k, i] / most
            ratio[k, i] = _raised(share, power) if share > least else 0.0
            total += ratio[k, i]
    pull, own = np.zeros((count, plants)), np.zeros(rows)
    for k in range(rows):
        f, onward = data.row[k], data.onward[k]
        for i in range(plants):
            ratio[k, i] /= total
            own[k] += ratio[k, i]
            pull[f, i] += (1 - onward) * ratio[k, i]
        if onward > 0.0:
            for i in range(plants):
                pull[f + 1, i] += onward * ratio[k, i]
    return most * total ** (1 / power), pull, own


Measure = tuple[float, RealArray, float, RealArray, RealArray, float]
"""A size and its derivatives: by the logarithms of |W_c| (R,) and of the norm, by |W_r| in its unit
(F,), by the logarithm of |G| (F,), and by the sum of squares of W_r outside the frequencies.
"""


@unchecked
def _mean_square(
    norm: float, width: RealArray, length: RealArray, far_square: float, data: SizeData
) -> Measure:
    """Mean square of the sets' sizes."""
    gain = norm**2
    by_width, by_length = np.zeros(width.size), np.zeros(length.size)
    mean = 0.0
    for k in range(width.size):
        square = gain * data.counted[k] * (width[k] / data.unit[data.row[k]]) ** 2
        by_width[k] = 2 * square
        mean += square
    value = mean + far_square
    for f in range(length.size):
        share = data.length_weight * data.shares[f] * length[f] / data.unit[f]
        value += share * length[f] / data.unit[f]
        by_length[f] = 2 * share
    return value, by_width, 2 * mean, by_length, np.zeros(length.size), 1.0


@unchecked
def _inflation(
    norm: float,
    width: RealArray,
    length: RealArray,
    plant: RealArray,
    far_square: float,
    data: SizeData,
    power: int,
) -> Measure:
    """A smooth maximum of three ratios of the model's sets to the raw ones: the largest extent over
    that of the narrowest sets about the nominal and with free centres, and the root mean square of
    the width over that of those with free centres.
    """
    rows, count = width.size, length.size
    by_width, by_length = np.zeros(rows), np.zeros(count)
    by_plant = np.zeros(count)
    size = plant / data.plain if data.multiplicative else np.ones(count)
    square = far_square / data.free_square
    squares = np.zeros(rows)
    for k in range(rows):
        f = data.row[k]
        squares[k] = data.counted[k] * (norm * size[f] * width[k] / data.unit[f]) ** 2
        squares[k] /= data.free_square
        square += squares[k]
    mean = np.sqrt(square)

    # Raw sets are known at the given frequencies.
    about, free, largest = np.zeros(rows), np.zeros(rows), 0.0
    for k in range(rows):
        if data.given[k]:
            f = data.row[k]
            extent = (norm * width[k] + length[f]) / data.unit[f]
            about[k], free[k] = extent / data.about[f], size[f] * extent / data.free[f]
            largest = max(largest, about[k], free[k])
    total = 0.0
    for k in range(rows):
        if data.given[k]:
            about[k] = data.counted[k] * _raised(about[k] / largest, power)
            free[k] = data.counted[k] * _raised(free[k] / largest, power)
            total += about[k] + free[k]
    peak = largest * total ** (1 / power)

    most = max(mean, peak)
    pulls = (mean / most) ** BLEND, (peak / most) ** BLEND
    value = most * (pulls[0] + pulls[1]) ** (1 / BLEND)
    by_mean = value * pulls[0] / (pulls[0] + pulls[1])  # by the logarithm
    by_peak = value - by_mean
    by_gain = 0.0
    for k in range(rows):
        f = data.row[k]
        change = by_mean * squares[k] / square
        by_width[k] += change
        by_plant[f] += change
        if data.given[k]:
            change = by_peak * (about[k] + free[k]) / total
            whole = norm * width[k] + length[f]
            by_width[k] += change * norm * width[k] / whole
            by_length[f] += change * data.unit[f] / whole
            by_plant[f] += by_peak * free[k] / total
        by_gain += by_width[k]
    if not data.multiplicative:
        by_plant[:] = 0.0
    return value, by_width, by_gain, by_length, by_plant, by_mean / square / data.free_square / 2


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
def _raised(value: float, power: int) -> float:
    """The value raised to a power that is a power of two."""
    while power > 1:
        value *= value
        power //= 2
    return value


@unchecked
def _add(gradient: RealArray, start: int, slope: complex, derivatives: ComplexArray) -> None:
    """Add the real part of slope times the derivatives (Q,) to the gradient, beginning at
    `start`.
    """
    for a in range(derivatives.size):
        each = derivatives[a]
        gradient[start + a] += slope.real * each.real - slope.imag * each.imag


@unchecked
def _resolved(
    value: float, gradient: RealArray, vector: RealArray, data: SizeData
) -> tuple[float, RealArray]:
    """The size and its gradient with a penalty for roots with less damping than the frequencies
    resolve.
    """
    count = vector.size
    excess, turn = 0.0, np.zeros(count)
    for j in range(len(data.damping)):
        damping, tone = data.damping[j, count], data.tone[j, count]
        for a in range(count):
            damping += data.damping[j, a] * vector[a]
            tone += data.tone[j, a] * vector[a]
        limit = min(_at(tone, data.middle, data.gap) / 2, SUFFICIENT_DAMPING) * RESOLVED_MARGIN
        short = np.log(limit) - damping
        if short > 0.0:
            excess += short**2
            for a in range(count):
                turn[a] -= 2 * short * data.damping[j, a]
    for a in range(count):
        gradient[a] = gradient[a] * (1 + excess) + value * turn[a]
    return value * (1 + excess), gradient


@unchecked
def _at(x: float, places: RealArray, values: RealArray) -> float:
    """Linear interpolation of values at places, constant beyond them."""
    k = np.searchsorted(places, x)
    if k == 0:
        return values[0]
    if k == places.size:
        return values[-1]
    share = (x - places[k - 1]) / (places[k] - places[k - 1])
    return values[k - 1] * (1 - share) + values[k] * share
