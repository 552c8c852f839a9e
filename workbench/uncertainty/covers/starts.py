"""Where the search for small sets starts: it has many local minima, of stadiums above all."""

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

LEAST = 1e-3
"""Size of a first set, relative to its centre, below which plants count as equal."""
SHORT = 0.1
"""What the length of a stadium counts beside its radius where a starting weight misses it."""


def through(
    response: ComplexArray, first: Circle | Stadium, program: UncertaintyCover, context: Context
) -> Rational:
    """The given nominal, or a rational function through a response (F,).

    Errors are relative, weighted like data whose standard deviation is the size of the first set:
    where plants lie close together the nominal must be near, at a resonance it need not be.
    """
    if program.nominal is not None:
        return program.nominal
    omega, order, zeros = program.responses.omega, program.order, program.zeros
    size = np.maximum(first.radius + first.half_length, LEAST * np.abs(response))
    weight = np.abs(response) / size**2
    return fitted(ResponseFit(omega, response, order, weight=weight, zeros=zeros), context)


def nominals(program: UncertaintyCover) -> dict[str, tuple[ComplexArray, Circle | Stadium]]:
    """Responses for a nominal to start from, and the sizes that weigh its errors, by name."""
    first = program.first_set(program.points)
    centres = first.center
    return {
        "the centres": (centres, first),
        "the centres, evenly weighted": (centres, Circle(centres, np.abs(centres))),
        "the plants' mean": (mean_response(program.responses.points), first),
    }


def mean_response(points: ComplexArray) -> ComplexArray:
    """Geometric mean (F,) of responses (F, N), phases unwrapped along frequency."""
    phase = np.unwrap(np.angle(points), axis=0)
    phase -= 2 * np.pi * np.round((phase[0] - phase[0, 0]) / (2 * np.pi))
    mean: ComplexArray = np.exp(np.log(np.abs(points)).mean(axis=1) + 1j * phase.mean(axis=1))
    return mean


def real_weights(program: StadiumCover, nominal: Rational, context: Context) -> Iterator[Rational]:
    """Real weights along the third set about a nominal: of minimum phase, and any if allowed."""
    third = program.third_set(program.away(nominal, program.points))
    end = unwrapped(third.half_length * np.exp(1j * third.angle))
    size = third.radius + SHORT * third.half_length
    weight = 1 / np.maximum(size, LEAST * (size.max() or 1.0))
    for minimum_phase in (True,) if program.minimum_phase else (True, False):
        omega, order = program.responses.omega, program.real_order
        yield fitted(held(omega, end, weight, order, minimum_phase), context)
