"""Responses smoothed over neighbouring lines, which leaves less noise than each line has alone.

The noise of two lines is independent, while a plant's response hardly changes from line to line,
once a model of the plant has been divided out. So a local straight line through the ratios of
response and model is closer to the plant than one response (R. Pintelon, J. Schoukens, System
Identification, 2nd ed., Wiley 2012, chapter 7: the local polynomial method).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench._core.arrays import BoolArray, ComplexArray, RealArray
from workbench.errors import InputError
from workbench.executor import Context
from workbench.fitting import Rational
from workbench.uncertainty.responses.between_lines import modelled, products_with_input
from workbench.uncertainty.responses.plant_models import FREQUENCIES, OWN_SHARE, measured_plants
from workbench.uncertainty.responses.plants import Responses

REACH = 1.5
"""Lines within this factor of a frequency are used for its response: a little over an octave in
all. Half of the reach would leave too few lines of common records; in twice of it the ratio of a
response and its model need not be straight.
"""
RANK = 1e-8
"""Relative size below which a singular value of the model's derivatives counts as rounding: a pole
on a zero. With half or double of it nothing changes but for such models.
"""
FEWEST = 4
"""Least number of lines in reach; a frequency with fewer keeps its response. A straight line takes
two of them, the others show how far the ratios lie off it.
"""


def smoothed_responses(responses: Responses, *, unstable_poles: int = 0) -> Responses:
    """The same plants, each response smoothed over the lines nearby, with the variance that is
    left.

    A model of each plant, of the fewest poles that noise allows, is divided out. At each frequency
    a straight line over log frequency is fitted to the ratios of response and model in `REACH`.
    Its variance follows from those of the lines, with the error that they leave in the model. If
    the ratios lie farther off the straight line than noise explains, the bias of a curvature that
    explains it is added. The errors of neighbouring frequencies are no longer independent.

    Parameters
    ----------
    responses
        Of F frequencies, with their variances; without, they count as exact and are returned. The
        errors of different frequencies are independent.
    unstable_poles
        Poles of each plant right of the imaginary axis.

    Raises
    ------
    InputError
        The responses are corners of regions: take regions of what this returns.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.uncertainty import Responses, smoothed_responses
    >>> omega = np.geomspace(0.1, 10.0, 60)
    >>> exact = np.array([1 / (1j * omega / corner + 1) for corner in (0.9, 1.0, 1.2)]).T
    >>> noise = np.random.default_rng(0).standard_normal((2, 60, 3)) / np.sqrt(2)
    >>> noisy = exact * (1 + 0.1 * (noise[0] + 1j * noise[1]))
    >>> plants = Responses(omega=omega, values=noisy, variance=0.01 * np.abs(exact) ** 2)
    >>> smooth = smoothed_responses(plants)
    >>> missed = np.abs(smooth.values / exact - 1)
    >>> bool(np.sqrt(np.mean(missed**2)) < 0.06)
    True
    """
    if responses.confidence is not None:
        raise InputError(
            "the responses are corners of confidence regions; give those of the records, and take "
            "regions of what is smoothed"
        )
    if responses.variance is None:
        return responses
    models, _ = measured_plants(responses, 1, unstable_poles, Context())
    model = modelled(models, responses.omega, responses.dt)
    share = responses.variance / np.abs(responses.values) ** 2
    fitted_at = np.isin(responses.omega, responses.thinned(FREQUENCIES).omega)
    values, variance = responses.values.copy(), responses.variance.copy()
    added = np.zeros(variance.shape)
    ratios = responses.ratios
    joint = None if ratios is None else ratios.joint.copy()
    for k in range(values.shape[1]):
        there = np.flatnonzero(responses.present[:, k])
        of_model = _error_of_model(
            models[k], responses.axis[there], share[there, k], fitted_at[there]
        )
        log, ratio = np.log(responses.omega[there]), responses.values[there, k] / model[there, k]
        smooth, excess = _lines(log, ratio, share[there, k], of_model)
        alone_in_reach = np.diag(smooth) == 1.0
        fitted = (smooth @ ratio) * model[there, k]
        values[there, k] = np.where(alone_in_reach, responses.values[there, k], fitted)
        size = np.abs(values[there, k]) ** 2
        both = _twice(smooth)
        left = both + (np.eye(len(both)) - both) @ of_model  # of the noise of all lines
        part = np.tile(share[there, k], 2) / 2
        alone, whole = smooth**2 @ share[there, k], (left**2 @ part).reshape(2, -1).sum(axis=0)
        added[there, k] = (np.maximum(whole - alone, 0.0) + excess) * size
        variance[there, k] = alone * size + added[there, k]
        if joint is not None:
            # the covariances are over |u|^2, and so relative to the response
            relative = joint[there, k] / products_with_input(responses.values[there, k])
            smoothed = np.tensordot(smooth**2, relative, 1)
            joint[there, k] = smoothed * products_with_input(values[there, k])
    said = (
        f"responses are means over the lines within a factor of {REACH:g}, once a model of each "
        "plant is divided out: no plant has a narrower resonance that noise hides"
    )
    if ratios is not None and joint is not None:
        ratios = replace(ratios, joint=joint).with_numerator(added)
    return replace(
        responses,
        values=values,
        variance=variance,
        ratios=ratios,
        assumption="; ".join(filter(None, [responses.assumption, said])),
    )


def _lines(
    log: RealArray, ratio: ComplexArray, share: RealArray, of_model: RealArray
) -> tuple[RealArray, RealArray]:
    """Weights (n, n) of the ratios (n,) in the values of straight lines over log frequency, and
    their mean square bias (n,).

    The bias is that of a curvature that explains the mean square by which the ratios lie farther
    off the line than noise explains. At the end of a band such a curvature moves the line by more
    than it leaves beside it.
    """
    weights, bias = np.eye(log.size), np.zeros(log.size)
    seen = (np.eye(2 * log.size) - of_model) * np.sqrt(np.tile(share, 2) / 2)
    for i in range(log.size):
        near = np.flatnonzero(np.abs(log - log[i]) <= np.log(REACH))
        if near.size < FEWEST:
            continue
        x, root = log[near] - log[i], 1 / np.sqrt(share[near] + OWN_SHARE**2)
        basis = np.stack([np.ones_like(x), x], axis=1)
        to_line = np.linalg.pinv(basis * root[:, None]) * root
        off, weights[i] = np.eye(x.size) - basis @ to_line, 0.0
        weights[i, near] = to_line[0]
        noise = np.sum((_twice(off) @ seen[np.append(near, near + log.size)]) ** 2) / x.size
        excess = float(np.mean(np.abs(off @ ratio[near]) ** 2) - noise)
        moved, left = (to_line[0] @ x**2) ** 2, np.mean((off @ x**2) ** 2)
        bias[i] = max(excess, 0.0) * max(1.0, moved / left)
    return weights, bias


def _error_of_model(
    model: Rational, axis: RealArray, share: RealArray, fitted_at: BoolArray
) -> RealArray:
    """Matrix (2n, 2n) from the noise of n responses to the model's error, both relative and as
    real and imaginary parts, to first order.

    The model was fitted to the responses `fitted_at`, by least squares with the weights of
    `measured_plants`. Its logarithm has the derivatives 1 / (s - root) and 1.
    """
    s = 1j * axis[:, None]
    columns = [np.ones_like(s)]
    for roots in (model.zeros, model.poles):
        single = 1 / (s - roots[roots.imag == 0.0])
        upper = roots[roots.imag > 0.0]
        one, other = 1 / (s - upper), 1 / (s - upper.conj())
        columns += [single, one + other, 1j * (one - other)]
    slopes = np.concatenate(columns, axis=1)
    stacked = np.concatenate([slopes.real, slopes.imag])
    weight = np.tile(fitted_at / np.sqrt(share + OWN_SHARE**2), 2)
    stacked /= np.linalg.norm(weight[:, None] * stacked, axis=0)
    back = np.linalg.pinv(weight[:, None] * stacked, RANK)
    return np.asarray(stacked @ back * weight, dtype=float)


def _twice(matrix: RealArray) -> RealArray:
    """The same matrix for real and for imaginary parts."""
    return np.asarray(np.kron(np.eye(2), matrix), dtype=float)
