"""Methods of covers: the nominal fitted to centres, or chosen for small sets."""

from __future__ import annotations

import numpy as np

from workbench.errors import InputError, SolverError
from workbench.executor import Context
from workbench.fitting.rational import Complex, Rational
from workbench.fitting.response import ResponseFit
from workbench.geometry import Circle, Stadium
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.uncertainty.circle_cover import CircleCover
from workbench.uncertainty.cover import UncertaintyCover
from workbench.uncertainty.joint import smallest_sets
from workbench.uncertainty.stadium_cover import StadiumCover
from workbench.uncertainty.weights import fitted

LEAST = 1e-3
"""Size of a first set, relative to its centre, below which plants count as equal."""


@method(CircleCover, "steps", optimal=False)
@method(StadiumCover, "steps", optimal=False)
def _steps(program: UncertaintyCover, context: Context) -> Claim:
    """The steps of the thesis: the nominal is fitted to the centres of the first set."""
    first = program.first_set(program.points)
    nominal = _through(first.center, first, program, context)
    third = program.third_set(program.away(nominal, program.points))
    W_r = program.real_weight(third, context)
    return program.finished(first, nominal, third, W_r, context), Outcome.SOLVED, ""


@method(CircleCover, "joint", optimal=False)
@method(StadiumCover, "joint", optimal=False)
def _joint(program: UncertaintyCover, context: Context) -> Claim:
    """Nominal and real weight are chosen together for the least mean square size of the sets."""
    points = program.points
    first = program.first_set(points)
    found, said = [], []
    mean, even = mean_response(program.responses.points), Circle(first.center, np.abs(first.center))
    starts = {
        "the centres": (first.center, first),
        "the centres, evenly weighted": (first.center, even),
        "the plants' mean": (mean, first),
    }
    for name, (response, sizes) in starts.items():
        try:
            start = _through(response, sizes, program, context)
            third = program.third_set(program.away(start, points))
            W_r = program.real_weight(third, context)
            found.append(smallest_sets(program, points, start, W_r, context))
            said.append(f"{found[-1][0]:.4g} from {name}")
        except (InputError, SolverError) as error:
            said.append(f"none from {name}: {error}")
        if program.nominal is not None:
            break  # there is one start only
    if not found:
        return None, Outcome.FAILED, "; ".join(said)
    _, nominal, W_r = min(found, key=lambda each: each[0])
    third = program.third_set(program.away(nominal, points), W_r)
    answer = program.finished(first, nominal, third, W_r, context)
    return answer, Outcome.SOLVED, f"mean square size {', '.join(said)}"


def mean_response(points: Complex) -> Complex:
    """Geometric mean (F,) of responses (F, N), phases unwrapped along frequency."""
    phase = np.unwrap(np.angle(points), axis=0)
    phase -= 2 * np.pi * np.round((phase[0] - phase[0, 0]) / (2 * np.pi))
    mean: Complex = np.exp(np.log(np.abs(points)).mean(axis=1) + 1j * phase.mean(axis=1))
    return mean


def _through(
    response: Complex, first: Circle | Stadium, program: UncertaintyCover, context: Context
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
