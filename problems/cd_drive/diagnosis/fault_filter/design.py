"""Fault filters for a relative error: full order, then few states at the sampling rate, certified.

The reduced filter keeps only its poles: what they can do is a convex problem again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.certify.stability import stability_of
from workbench.diagnosis import FaultEstimation, FaultFilter
from workbench.errors import InputError, SolverError
from workbench.heavy_types import StateSpace
from workbench.synthesis import approximated
from workbench.systems.realisation import realisation

from .front import FaultFront, Point, full_filter, laguerre
from .loop import FaultLoop

REDUCTIONS = ("weighted", "balanced", "hankel")


@dataclass(frozen=True, eq=False)
class Design:
    """A filter F in metres, how it does on a grid, and its certified answer."""

    F: StateSpace
    point: Point
    answer: FaultFilter


def full_order(loop: FaultLoop, states: int, error: float, leakage: float) -> Design:
    """The filter of least leakage and noise over the Laguerre basis.

    Raises SolverError where the set of plants allows none.
    """
    front = FaultFront(loop)
    point = front.least(laguerre(loop, states, front.omega), error)
    return certified(loop, full_filter(loop, point.coefficients), point, error, leakage)


def few_states(loop: FaultLoop, F: StateSpace, order: int, error: float, leakage: float) -> Design:
    """The best filter for poles of a reduction of F to at most an order.

    Of those that are certified to meet all requirements, if there are any.

    Raises SolverError where no reduction has poles that meet the relative error and the leakage.
    """
    program = estimation(loop, error, leakage)
    found: list[Design] = []
    for method in REDUCTIONS:
        plant = program.plant if method == "weighted" else None
        try:
            poles = approximated(F, order, method, plant)  # type: ignore[arg-type]
            front = FaultFront(loop, poles=poles.poles())
            point = front.least(front.of_filter(poles), error, leakage)
        except (InputError, SolverError):
            continue
        x = point.coefficients
        made = realisation((poles.A, poles.B, x[None, :-1], x[None, -1:]), 0.0)
        if stability_of(made).holds:
            found.append(certified(loop, made, point, error, leakage))
    if not found:
        raise SolverError(
            f"no filter of order {order} with a relative error of {error:g} and a leakage of "
            f"{leakage:g} m by {REDUCTIONS}"
        )
    meeting = [each for each in found if each.answer.upper <= 1.0]
    return min(meeting or found, key=lambda each: each.point.total)


def estimation(loop: FaultLoop, error: float, leakage: float) -> FaultEstimation:
    """The normalised problem of a loop."""
    return FaultEstimation(loop.plant, "f_sd", loop.requirements(error, leakage))


def certified(loop: FaultLoop, F: StateSpace, point: Point, error: float, leakage: float) -> Design:
    """Raises SolverError for a filter that is not stable."""
    answer = estimation(loop, error, leakage).answer(F)
    if answer is None:
        raise SolverError(f"the filter is not stable: poles {np.sort(F.poles().real)[-2:]}")
    return Design(F, point, answer)
