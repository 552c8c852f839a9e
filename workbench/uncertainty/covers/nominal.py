"""Nominals of covers: the mean of the plants, and a fit to centres or to another response."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import ComplexArray
from workbench.errors import InputError
from workbench.fitting.response.program import ResponseFit
from workbench.geometry import Circle, Stadium
from workbench.uncertainty.covers.cover import UncertaintyCover

STARTING_MIN_RELATIVE_SIZE = 1e-3
"""Smallest size of sets in the weights of a fit, relative to the centre or to the largest set. A
set of no size would else have all the weight. With half of it small sets count up to four times as
much in this start; with double of it up to four times less.
"""


def mean_response(points: ComplexArray) -> ComplexArray:
    """Geometric mean (F,) of responses (F, N), with phases unwrapped along frequency.

    If a response is nearly 0, noise decides in which direction its phase turns. A plant whose phase
    differs from the median of the others by a full turn is turned back.
    """
    phase = np.unwrap(np.angle(points), axis=0)
    middle = np.sort(phase, axis=1)[:, (phase.shape[1] - 1) // 2, None]
    phase -= 2 * np.pi * np.round((phase - middle) / (2 * np.pi))
    mean: ComplexArray = np.exp(np.log(np.abs(points)).mean(axis=1) + 1j * phase.mean(axis=1))
    return mean


def nominal_fit(
    response: ComplexArray, sizes: Circle | Stadium, program: UncertaintyCover
) -> ResponseFit:
    """Fit of a nominal to a response (F,).

    Errors are weighted as if the size of the sets were their standard deviation. So the nominal is
    close where the plants lie close together, but need not be close at a resonance.
    """
    omega, order, zeros = program.responses.axis, program.order, program.zeros
    size = np.maximum(
        sizes.radius + sizes.half_length, STARTING_MIN_RELATIVE_SIZE * np.abs(response)
    )
    # If the plants and their centre are all 0, the nominal is free.
    weight = np.divide(np.abs(response), size**2, out=np.zeros_like(size), where=size > 0)
    if not weight.any():
        raise InputError(
            "the centres of the sets are 0 at every frequency; deviations cannot be relative to a "
            "nominal of 0"
        )
    right = program.unstable_poles
    return ResponseFit(omega, response, order, weight=weight, zeros=zeros, unstable_poles=right)
