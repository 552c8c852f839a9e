"""Nominals of covers: the plants' mean, and the fit to centres or to another response."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import ComplexArray
from workbench.errors import InputError
from workbench.fitting.response.program import ResponseFit
from workbench.geometry import Circle, Stadium
from workbench.uncertainty.covers.cover import UncertaintyCover

STARTING_MIN_RELATIVE_SIZE = 1e-3
"""Smallest size of sets in the weights of a fit, relative to the centre or to the largest set."""


def mean_response(points: ComplexArray) -> ComplexArray:
    """Geometric mean (F,) of responses (F, N), with phases unwrapped along frequency.

    Where a response is nearly 0, noise decides which way its phase turns: a plant whose phase has
    left the others' middle by a turn is turned back.
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

    It weights the errors as if the size of the sets were their standard deviation: the nominal must
    be close where the plants lie close together, and need not be at a resonance.
    """
    omega, order, zeros = program.responses.axis, program.order, program.zeros
    size = np.maximum(
        sizes.radius + sizes.half_length, STARTING_MIN_RELATIVE_SIZE * np.abs(response)
    )
    # Where plants and their centre are all 0, nothing is asked of the nominal.
    weight = np.divide(np.abs(response), size**2, out=np.zeros_like(size), where=size > 0)
    if not weight.any():
        raise InputError(
            "the centres of the sets are 0 at every frequency; as a nominal they have no size that "
            "others could be relative to"
        )
    right = program.unstable_poles
    return ResponseFit(omega, response, order, weight=weight, zeros=zeros, unstable_poles=right)
