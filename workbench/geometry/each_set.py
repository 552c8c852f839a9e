"""Sets answered one by one by a general solver, each scaled to unit size first.

A solver's radius is not believed: it is recomputed from its centre and segment, rounded outward,
and its distance from the optimum then shows in the certificate's gap.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from workbench.errors import WorkbenchError
from workbench.executor import Context
from workbench.geometry.cover import Cover
from workbench.geometry.exact_stadium import stadium_radius
from workbench.geometry.points import canonical_angle
from workbench.solvers import Outcome

Solved = tuple[Outcome, str]
"""An outcome and the solver's own status."""


class RefusedError(WorkbenchError):
    """A set that the solver did not solve."""

    def __init__(self, solved: Solved) -> None:
        super().__init__(solved[1])
        self.outcome = solved[0]


def accept(solved: Solved) -> None:
    """Raise `RefusedError` without an answer; an inaccurate one is for the certificate to judge."""
    if solved[0] not in (Outcome.SOLVED, Outcome.INACCURATE):
        raise RefusedError(solved)


class Unit:
    """The frame of one set: moved to one of its points, scaled to unit size."""

    def __init__(self, points: np.ndarray) -> None:
        away = points - points[0]
        self.origin = points[0]
        self.scale = float(np.abs(away).max()) or 1.0
        self.points = away / self.scale

    def inward(self, point: complex) -> complex:
        return (point - self.origin) / self.scale

    def outward(self, point: complex) -> complex:
        return self.origin + point * self.scale


Answer = Callable[[Unit, int], tuple[complex, float, float]]
"""Centre, half-length and angle in the unit frame of a set of a given index."""


def each_set(
    program: Cover, context: Context, answer: Answer
) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray], Outcome, str]:
    """Centre, radius, half-length and angle of every set; the first refusal is the outcome.

    A refused set is NaN.
    """
    sets = program.points.reshape(-1, program.points.shape[-1])
    center = np.full(len(sets), np.nan, dtype=complex)
    radius, half_length, angle = np.full((3, len(sets)), np.nan)
    refused: list[tuple[Outcome, str]] = []
    for i in context.track(range(len(sets)), "sets"):
        unit = Unit(sets[i])
        try:
            middle, half, direction = answer(unit, i)
        except RefusedError as error:
            place = program.place(tuple(int(k) for k in np.unravel_index(i, program.batch)))
            refused.append((error.outcome, f"{error} {place}".rstrip()))
            continue
        center[i], half_length[i] = unit.outward(middle), max(half, 0.0) * unit.scale
        angle[i] = canonical_angle(direction)
        radius[i] = stadium_radius(sets[i], center[i], half_length[i], angle[i])
    arrays = tuple(array.reshape(program.batch) for array in (center, radius, half_length, angle))
    outcome, message = refused[0] if refused else (Outcome.SOLVED, "")
    if len(refused) > 1:
        message += f" (and {len(refused) - 1} more sets)"
    return (arrays[0], arrays[1], arrays[2], arrays[3]), outcome, message
