"""Sets answered one by one by a general solver, each scaled to unit size first.

A solver's radius is not believed: it is recomputed from its centre and segment, rounded outward,
and its distance from the optimum then shows in the certificate's gap.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

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

    @property
    def is_one_place(self) -> bool:
        """All points coincide."""
        return not self.points.any()

    def inward(self, point: complex) -> complex:
        return (point - self.origin) / self.scale

    def outward(self, point: complex) -> complex:
        return self.origin + point * self.scale


@dataclass(frozen=True)
class SegmentFrame:
    """The second step of a stadium, angle and axis known: all lengths in units of its radius.

    The nearest point of the segment to point i is moved from level with it by ``shift`` (N,), so
    that the program reads: least half-length l over middle m and shifts s with

        s^2 + beside^2 <= 1,  ahead + s - m <= l,  behind - s + m <= l.

    m and l count from those of the shortest segment level with every point.
    """

    ahead: np.ndarray
    behind: np.ndarray
    beside: np.ndarray
    radius: float
    reach: float
    origin: complex
    direction: complex

    def segment(self, middle: float, half_length: float) -> tuple[complex, float]:
        """Centre and half-length in the frame of the points."""
        center = self.origin + middle * self.radius * self.direction
        return center, self.reach + half_length * self.radius


def segment_frame(
    points: np.ndarray, angle: float, axis: float, centred: bool, accuracy: float
) -> SegmentFrame:
    """The frame of the shortest segment on a line at an angle, ``axis`` to the left of 0."""
    direction = complex(np.exp(1j * angle))
    local = points / direction
    along, beside = local.real, local.imag - axis
    middle = 0.0 if centred else 0.5 * (along.min() + along.max())
    reach = float(np.abs(along - middle).max())
    # At exactly the least radius the points on the sides leave the program no interior; half the
    # accuracy asked for gives it one.
    least = np.abs(beside).max()
    radius = float(least + accuracy / 2 * max(least, accuracy))
    return SegmentFrame(
        (along - middle - reach) / radius,
        (middle - along - reach) / radius,
        beside / radius,
        radius,
        reach,
        complex(middle, axis) * direction,
        direction,
    )


Answer = Callable[[Unit, int], tuple[complex, float, float]]
"""Centre, half-length and angle in the unit frame of a set of a given index."""


def each_set(
    program: Cover, context: Context, answer: Answer
) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray], Outcome, str]:
    """Centre, radius, half-length and angle of every set; the first refusal is the outcome.

    A refused set is NaN.
    """
    sets = program.points.reshape(-1, program.points.shape[-1])
    given, direction_given = getattr(program, "center", None), getattr(program, "angle", None)
    center = np.full(len(sets), np.nan, dtype=complex)
    radius, half_length, angle = np.full((3, len(sets)), np.nan)
    refused: list[tuple[Outcome, str]] = []
    for i in context.track(range(len(sets)), "sets"):
        unit = Unit(sets[i])
        if unit.is_one_place and (given is None or given.flat[i] == sets[i][0]):  # no program
            center[i], radius[i], half_length[i] = sets[i][0], 0.0, 0.0
            angle[i] = 0.0 if direction_given is None else direction_given.flat[i]
            continue
        try:
            middle, half, direction = answer(unit, i)
        except RefusedError as error:
            place = program.place(tuple(int(k) for k in np.unravel_index(i, program.batch)))
            refused.append((error.outcome, f"{error} {place}".rstrip()))
            continue
        center[i] = unit.outward(middle) if given is None else given.flat[i]
        half_length[i] = max(half, 0.0) * unit.scale
        angle[i] = canonical_angle(direction)
        radius[i] = stadium_radius(sets[i], center[i], half_length[i], angle[i])
    arrays = tuple(array.reshape(program.batch) for array in (center, radius, half_length, angle))
    outcome, message = refused[0] if refused else (Outcome.SOLVED, "")
    if len(refused) > 1:
        message += f" (and {len(refused) - 1} more sets)"
    return (arrays[0], arrays[1], arrays[2], arrays[3]), outcome, message
