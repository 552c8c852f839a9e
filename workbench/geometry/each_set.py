"""Use a general solver on one set after another, each moved to the origin and scaled to unit size.

The solver's radius is not used: it is recomputed from the solver's centre and segment and rounded
upward. How far it is from the optimum then shows in the certificate's gap.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from workbench.errors import WorkbenchError
from workbench.executor import Context
from workbench.geometry.enclosing_shape import EnclosingShape
from workbench.geometry.exact_stadium import stadium_radius
from workbench.geometry.points import canonical_angle
from workbench.solvers import Outcome

SolverReport = tuple[Outcome, str]
"""An outcome and the solver's own words for it."""


class RefusedError(WorkbenchError):
    """The solver gave no answer for a set."""

    def __init__(self, solved: SolverReport) -> None:
        super().__init__(solved[1])
        self.outcome = solved[0]


def accept(solved: SolverReport) -> None:
    """Raise `RefusedError` if the solver gave no answer.

    An inaccurate answer is accepted: the certificate judges it.
    """
    if solved[0] not in (Outcome.SOLVED, Outcome.INACCURATE):
        raise RefusedError(solved)


class UnitFrame:
    """Frame of one set: its origin is a point of the set, its unit of length the set's size."""

    def __init__(self, points: np.ndarray) -> None:
        away = points - points[0]
        self.origin = points[0]
        self.scale = float(np.abs(away).max()) or 1.0
        self.points = away / self.scale

    @property
    def is_one_place(self) -> bool:
        """Whether all points coincide."""
        return not self.points.any()

    def to_frame(self, point: complex) -> complex:
        """Coordinates of a point in this frame."""
        return (point - self.origin) / self.scale

    def from_frame(self, point: complex) -> complex:
        """Point of the plane that has the given coordinates in this frame."""
        return self.origin + point * self.scale


@dataclass(frozen=True)
class SegmentFrame:
    """Data of the program for the half-length of a stadium whose angle and axis are known.

    All lengths are in units of the radius. Point i must be within 1 of a point of the segment; that
    point of the segment lies ``s_i`` further along the axis than point i. The program is: least
    half-length l over the middle m and the shifts s (N,) with

        s^2 + beside^2 <= 1,  ahead + s - m <= l,  behind - s + m <= l.

    m and l are counted from the middle and the half-length of the segment that reaches from the
    first to the last of the points along the axis.
    """

    ahead: np.ndarray
    behind: np.ndarray
    beside: np.ndarray
    radius: float
    reach: float
    origin: complex
    direction: complex

    def segment(self, middle: float, half_length: float) -> tuple[complex, float]:
        """Centre and half-length, in the frame of the points, of a solution (m, l)."""
        center = self.origin + middle * self.radius * self.direction
        return center, self.reach + half_length * self.radius


def segment_frame(
    points: np.ndarray, angle: float, axis: float, centred: bool, accuracy: float
) -> SegmentFrame:
    """Data of the program for the shortest segment on a given line.

    Parameters
    ----------
    points
        Complex (N,).
    angle
        Direction of the line [rad].
    axis
        Signed distance of the line from 0, positive to the left of its direction.
    centred
        Whether the middle of the segment is the foot of the perpendicular from 0.
    accuracy
        Accuracy asked of the solver, relative.
    """
    direction = complex(np.exp(1j * angle))
    local = points / direction
    along, beside = local.real, local.imag - axis
    middle = 0.0 if centred else 0.5 * (along.min() + along.max())
    reach = float(np.abs(along - middle).max())
    # At exactly the least radius the feasible set has no interior, because of the points on the
    # sides. A radius larger by half the accuracy gives it one.
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


SetSolver = Callable[[UnitFrame, int], tuple[complex, float, float]]
"""Function of a set's unit frame and index; gives centre, half-length and angle in that frame."""


def each_set(
    program: EnclosingShape, context: Context, answer: SetSolver
) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray], Outcome, str]:
    """Solve every set: arrays of centre, radius, half-length and angle, an outcome and a message.

    A set that the solver refuses gets NaN, and the first refusal gives outcome and message.
    """
    sets = program.points.reshape(-1, program.points.shape[-1])
    given, direction_given = getattr(program, "center", None), getattr(program, "angle", None)
    center = np.full(len(sets), np.nan, dtype=complex)
    radius, half_length, angle = np.full((3, len(sets)), np.nan)
    refused: list[tuple[Outcome, str]] = []
    for i in context.track(range(len(sets)), "sets"):
        unit = UnitFrame(sets[i])
        if unit.is_one_place and (given is None or given.flat[i] == sets[i][0]):
            # a single point: there is nothing to solve
            center[i], radius[i], half_length[i] = sets[i][0], 0.0, 0.0
            angle[i] = 0.0 if direction_given is None else direction_given.flat[i]
            continue
        try:
            middle, half, direction = answer(unit, i)
        except RefusedError as error:
            place = program.place(tuple(int(k) for k in np.unravel_index(i, program.batch)))
            refused.append((error.outcome, f"{error} {place}".rstrip()))
            continue
        center[i] = unit.from_frame(middle) if given is None else given.flat[i]
        half_length[i] = max(half, 0.0) * unit.scale
        angle[i] = canonical_angle(direction)
        radius[i] = stadium_radius(sets[i], center[i], half_length[i], angle[i])
    arrays = tuple(array.reshape(program.batch) for array in (center, radius, half_length, angle))
    outcome, message = refused[0] if refused else (Outcome.SOLVED, "")
    if len(refused) > 1:
        message += f" (and {len(refused) - 1} more sets)"
    return (arrays[0], arrays[1], arrays[2], arrays[3]), outcome, message
