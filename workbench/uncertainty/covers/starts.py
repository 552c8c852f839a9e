"""Starts of the search for small sets, which has many local minima, most of all for stadiums."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from workbench.arrays import ComplexArray
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.fitting.response.program import ResponseFit
from workbench.geometry import Circle, Stadium
from workbench.uncertainty.covers.cover import UncertaintyCover
from workbench.uncertainty.covers.stadium_cover import StadiumCover
from workbench.uncertainty.covers.weights import fitted, held, unwrapped

STARTING_MIN_RELATIVE_SIZE = 1e-3
"""Smallest size of sets in the weights of a fit, relative to the centre or to the largest set."""
STARTING_HALF_LENGTH_SHARE = 0.1
"""Factor of a stadium's half-length in the size that weights the errors of a starting weight."""


def through(
    response: ComplexArray, first: Circle | Stadium, program: UncertaintyCover, context: Context
) -> Rational:
    """The given nominal or, without one, a rational function fitted to a response (F,).

    The fit weights the errors as if the size of the first set were their standard deviation: the
    nominal must be close where the plants lie close together, and need not be at a resonance.
    """
    if program.nominal is not None:
        return program.nominal
    omega, order, zeros = program.responses.axis, program.order, program.zeros
    size = np.maximum(
        first.radius + first.half_length, STARTING_MIN_RELATIVE_SIZE * np.abs(response)
    )
    weight = np.abs(response) / size**2
    right = program.unstable_poles
    fit = ResponseFit(omega, response, order, weight=weight, zeros=zeros, unstable_poles=right)
    return fitted(fit, context)


def nominals(program: UncertaintyCover) -> dict[str, tuple[ComplexArray, Circle | Stadium]]:
    """Starting responses of the nominal, and the sets whose sizes weight the errors, by name."""
    first = program.first_set(program.points)
    centres = first.center
    return {
        "the centres": (centres, first),
        "the centres, evenly weighted": (centres, Circle(centres, np.abs(centres))),
        "the plants' mean": (mean_response(program.responses.points), first),
    }


def mean_response(points: ComplexArray) -> ComplexArray:
    """Geometric mean (F,) of responses (F, N), with phases unwrapped along frequency."""
    phase = np.unwrap(np.angle(points), axis=0)
    phase -= 2 * np.pi * np.round((phase[0] - phase[0, 0]) / (2 * np.pi))
    mean: ComplexArray = np.exp(np.log(np.abs(points)).mean(axis=1) + 1j * phase.mean(axis=1))
    return mean


def real_weights(program: StadiumCover, nominal: Rational, context: Context) -> Iterator[Rational]:
    """Real weights fitted to the third set: a minimum-phase one, then, if allowed, any other."""
    third = program.third_set(program.away(nominal, program.points))
    end = unwrapped(third.half_length * np.exp(1j * third.angle))
    size = third.radius + STARTING_HALF_LENGTH_SHARE * third.half_length
    weight = 1 / np.maximum(size, STARTING_MIN_RELATIVE_SIZE * (size.max() or 1.0))
    for minimum_phase in (True,) if program.minimum_phase else (True, False):
        omega, order = program.responses.axis, program.real_order
        yield fitted(held(omega, end, weight, order, minimum_phase), context)
