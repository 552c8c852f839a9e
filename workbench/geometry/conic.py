"""Circles, and stadiums of a given angle, as conic programs for every conic solver."""

from __future__ import annotations

import numpy as np

from workbench.executor import Context
from workbench.geometry.circle import Circle, SmallestCircle
from workbench.geometry.each_set import UnitFrame, accept, each_set, segment_frame
from workbench.geometry.enclosing_stadium import Stadium
from workbench.geometry.stadium import NarrowestStadium
from workbench.program import Claim, conic_method
from workbench.solvers import ConicSolver, solve_conic


@conic_method(SmallestCircle, cones="second-order")
def _circle(program: SmallestCircle, context: Context, solver: ConicSolver) -> Claim:
    """Second-order cone program: least r with |p - c| <= r for every point."""
    import cvxpy as cp

    with context.stating():
        points = cp.Parameter((program.points.shape[-1], 2))
        center, radius = cp.Variable((1, 2)), cp.Variable()
        problem = cp.Problem(cp.Minimize(radius), [cp.norm(points - center, axis=1) <= radius])

    def answer(unit: UnitFrame, index: int) -> tuple[complex, float, float]:
        points.value = np.column_stack([unit.points.real, unit.points.imag])
        accept(solve_conic(problem, solver, context.options, context))
        return complex(*center.value[0]), 0.0, 0.0

    shapes, outcome, message = each_set(program, context, answer)
    return Circle(shapes[0], shapes[1]), outcome, message


def _free_angle(program: NarrowestStadium) -> str | None:
    """Reason why a conic solver cannot answer a stadium of free angle; None for a given angle."""
    if program.angle is not None:
        return None
    return "with a free angle it is not convex; give an angle, or use exact, thesis or ipopt"


@conic_method(NarrowestStadium, cones="second-order", unfit=_free_angle)
def _stadium(program: NarrowestStadium, context: Context, solver: ConicSolver) -> Claim:
    """Two conic programs in the frame of the angle: least radius, then least half-length."""
    import cvxpy as cp

    assert program.angle is not None
    angles = program.angle.ravel()
    centers = None if program.center is None else program.center.ravel()
    count = program.points.shape[-1]
    with context.stating():
        across, axis, width = cp.Parameter(count), cp.Variable(), cp.Variable()
        strip = [cp.abs(across - axis) <= width]
        ahead, behind, beside = cp.Parameter(count), cp.Parameter(count), cp.Parameter((1, count))
        middle, half_length, shift = cp.Variable(), cp.Variable(), cp.Variable((1, count))
        inside = [
            cp.norm(cp.vstack([shift, beside]), axis=0) <= 1,
            ahead + shift[0] - middle <= half_length,
            behind - shift[0] + middle <= half_length,
        ]
        if centers is not None:
            strip.append(axis == 0)
            inside.append(middle == 0)
        narrow = cp.Problem(cp.Minimize(width), strip)
        short = cp.Problem(cp.Minimize(half_length), inside)

    def answer(unit: UnitFrame, index: int) -> tuple[complex, float, float]:
        center = 0j if centers is None else unit.to_frame(centers[index])
        points = unit.points - center
        local = (points / np.exp(1j * angles[index])).imag
        scale = np.abs(local - local[0] if centers is None else local).max() or 1.0
        across.value = local / scale
        accept(solve_conic(narrow, solver, context.options, context))
        found = 0.0 if centers is not None else float(axis.value) * scale
        frame = segment_frame(
            points, angles[index], found, centers is not None, context.options.accuracy
        )
        ahead.value, behind.value, beside.value = frame.ahead, frame.behind, frame.beside[None]
        accept(solve_conic(short, solver, context.options, context))
        shift_of_center = 0.0 if centers is not None else float(middle.value)
        at, length = frame.segment(shift_of_center, float(half_length.value))
        return center + at, length, angles[index]

    shapes, outcome, message = each_set(program, context, answer)
    return Stadium(*shapes), outcome, message
