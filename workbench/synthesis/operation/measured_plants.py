"""A model of each measured plant, to simulate it."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.fitting.response.program import ResponseFit
from workbench.fitting.response.vector_fitting import relocated_fits, vector_fits
from workbench.uncertainty import Responses

HIGHEST_ORDER = 6
"""Most poles of a model."""
ENOUGH = 1.2
"""Error of a fit over that of the best order, up to which a smaller order is taken."""
OWN_SHARE = 0.01
"""Share of a response that a model may miss besides what noise leaves open."""
FREQUENCIES = 80
"""Most frequencies that are fitted."""


def measured_plants(
    responses: Responses, order: int, unstable_poles: int, context: Context
) -> tuple[list[Rational], RealArray]:
    """A model of each plant, of `order` poles or a few more, and its relative rms error (N,).

    `unstable_poles` of them lie right of the axis. Responses are weighted by the inverse of what
    noise leaves open. The smallest order that misses no more than that is taken: larger ones follow
    the noise, by light resonances between the frequencies with which a loop may be unstable.
    """
    few = responses.thinned(FREQUENCIES)
    models, errors = [], []
    for k in range(len(few.plants)):
        there = few.present[:, k]
        omega, values = few.omega[there], few.values[there, k]
        open_ = np.zeros(omega.size) if few.variance is None else few.variance[there, k]
        weight = 1.0 / np.sqrt((OWN_SHARE * np.abs(values)) ** 2 + open_)
        tried = []
        for count in range(max(order, 1), max(order, min(HIGHEST_ORDER, omega.size // 4)) + 1):
            fit = ResponseFit(
                omega, values, count, weight=weight, zeros=count - 1, unstable_poles=unstable_poles
            )
            every = [*relocated_fits(fit, context), vector_fits(fit, context)[0]]
            tried += [(float(np.sqrt(np.mean(fit.errors(one) ** 2))), one) for one in every]
        least = min(error for error, _ in tried)
        _, model = next(pair for pair in tried if pair[0] <= max(ENOUGH * least, 1.0))
        apart = np.abs(model.response(omega) - values) / np.abs(values)
        models.append(model)
        errors.append(float(np.sqrt(np.mean(apart**2))))
    return models, np.array(errors)
