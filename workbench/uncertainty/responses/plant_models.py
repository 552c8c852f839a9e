"""A model of each measured plant: to simulate it, and to know it between the frequencies."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.fitting.response.program import ResponseFit
from workbench.fitting.response.vector_fitting import relocated_fits, vector_fits
from workbench.uncertainty.responses.plants import Responses

HIGHEST_ORDER = 12
"""Largest number of poles of a model."""
ENOUGH = 1.2
"""A smaller order is taken if its error is at most this many times the error of the best order."""
OWN_SHARE = 0.01
"""Relative error of a response that a model may have, in addition to the error due to noise."""
FREQUENCIES = 80
"""Largest number of frequencies that are fitted."""


def measured_plants(
    responses: Responses, order: int, unstable_poles: int, context: Context
) -> tuple[list[Rational], RealArray]:
    """A model of each plant with `order` poles or a few more, and its relative rms error (N,).

    `unstable_poles` of them lie right of the axis. Errors are weighted by the inverse of the
    allowed error, which is the standard deviation of the noise and `OWN_SHARE` of the response. The
    smallest order with a weighted rms error of at most 1, or near the best one, is taken. Larger
    orders follow the noise with lightly damped resonances between the frequencies, and a loop with
    such a model may be unstable.
    """
    few = responses.thinned(FREQUENCIES)
    models, errors = [], []
    for k in range(len(few.plants)):
        there = few.present[:, k]
        omega, values = few.axis[there], few.values[there, k]
        open_ = np.zeros(omega.size) if few.variance is None else few.variance[there, k]
        weight = 1.0 / np.sqrt((OWN_SHARE * np.abs(values)) ** 2 + open_)
        tried = []
        for count in range(max(order, 1), max(order, min(HIGHEST_ORDER, omega.size // 4)) + 1):
            fit = ResponseFit(
                omega, values, count, weight=weight, zeros=count - 1, unstable_poles=unstable_poles
            )
            every = [*relocated_fits(fit, context), vector_fits(fit, context)[0]]
            tried += [(float(np.sqrt(np.mean(fit.errors(one) ** 2))), one) for one in every]
            if min(error for error, _ in tried) <= 1.0:
                break
        least = min(error for error, _ in tried)
        _, model = next(pair for pair in tried if pair[0] <= max(ENOUGH * least, 1.0))
        apart = np.abs(model.response(omega) - values) / np.abs(values)
        models.append(model)
        errors.append(float(np.sqrt(np.mean(apart**2))))
    return models, np.array(errors)
