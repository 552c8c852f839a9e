"""Circles, and stadiums of a given angle, as conic programs for every conic solver."""

from __future__ import annotations

import numpy as np

from workbench.executor import Context
from workbench.geometry.circle import Circle, SmallestCircle
from workbench.geometry.each_set import Unit, accept, each_set
from workbench.geometry.stadium import NarrowestStadium, Stadium
from workbench.program import Claim, conic_method
from workbench.solvers import ConicSolver, solve_conic


@conic_method(SmallestCircle)
def _circle(program: SmallestCircle, context: Context, solver: ConicSolver) -> Claim:
    """Second-order cone program: least r with |p - c| <= r for every point."""
    import cvxpy as cp

    with context.stating():
        points = cp.Parameter((program.points.shape[-1], 2))
        center, radius = cp.Variable((1, 2)), cp.Variable()
        problem = cp.Problem(cp.Minimize(radius), [cp.norm(points - center, axis=1) <= radius])

    def answer(unit: Unit, index: int) -> tuple[complex, float, float]:
        points.value = np.column_stack([unit.points.real, unit.points.imag])
        accept(solve_conic(problem, solver, context.options, context))
        return complex(*center.value[0]), 0.0, 0.0

    shapes, outcome, message = each_set(program, context, answer)
    return Circle(shapes[0], shapes[1]), outcome, message


def _free_angle(program: NarrowestStadium) -> str | None:
    if program.angle is not None:
        return None
    return "with a free angle it is not convex; give an angle, or use exact, thesis or ipopt"


@conic_method(NarrowestStadium, unfit=_free_angle)
def _stadium(program: NarrowestStadium, context: Context, solver: ConicSolver) -> Claim:
    """Two conic programs in the frame of the angle: least radius, then least half-length."""
    import cvxpy as cp

    assert program.angle is not None
    angles = program.angle.ravel()
    centers = None if program.center is None else program.center.ravel()
    count = program.points.shape[-1]
    with context.stating():
        along, across = cp.Parameter(count), cp.Parameter(count)
        given_along, given_across = cp.Parameter(), cp.Parameter()
        axis, width = cp.Variable(), cp.Variable()
        strip = [cp.abs(across - axis) <= width]
        beside, radius = cp.Parameter(count), cp.Parameter(nonneg=True)
        middle, half_length, nearest = cp.Variable(), cp.Variable(), cp.Variable(count)
        inside = [
            cp.norm(cp.vstack([along - nearest, beside]), axis=0) <= radius,
            cp.abs(nearest - middle) <= half_length,
        ]
        if centers is not None:
            strip.append(axis == given_across)
            inside.append(middle == given_along)
        narrow = cp.Problem(cp.Minimize(width), strip)
        short = cp.Problem(cp.Minimize(half_length), inside)

    def answer(unit: Unit, index: int) -> tuple[complex, float, float]:
        turn = np.exp(1j * angles[index])
        local = unit.points / turn
        along.value, across.value = local.real, local.imag
        if centers is not None:
            center = unit.inward(centers[index]) / turn
            given_along.value, given_across.value = center.real, center.imag
        accept(solve_conic(narrow, solver, context.options, context))
        found = given_across.value if centers is not None else axis.value
        beside.value = local.imag - found
        # At exactly the least radius the points on the sides leave the second program no
        # interior; half the accuracy asked for gives it one.
        least = np.abs(beside.value).max()
        radius.value = least + context.options.accuracy / 2 * max(least, context.options.accuracy)
        accept(solve_conic(short, solver, context.options, context))
        if centers is not None:
            return unit.inward(centers[index]), half_length.value.item(), angles[index]
        return complex(middle.value, found) * turn, half_length.value.item(), angles[index]

    shapes, outcome, message = each_set(program, context, answer)
    return Stadium(*shapes), outcome, message
