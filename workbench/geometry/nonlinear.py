"""Circles and stadiums as nonlinear programs for IPOPT, from many starting angles."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench.executor import Context
from workbench.geometry.circle import Circle, SmallestCircle
from workbench.geometry.each_set import RefusedError, Unit, accept, each_set
from workbench.geometry.stadium import NarrowestStadium, Stadium
from workbench.program import Claim, method
from workbench.solvers import Outcome, ipopt, ipopt_outcome

STARTS = 12
"""Starting angles; the width of twelve points has about as many local minima."""


@method(SmallestCircle, "ipopt", optimal=True)
def _circle(program: SmallestCircle, context: Context) -> Claim:
    """Nonlinear program: least r with |p - c|^2 <= r^2 for every point."""
    import casadi as ca

    count = program.points.shape[-1]
    with context.stating():
        points = ca.SX.sym("p", count, 2)
        x = ca.SX.sym("x", 3)  # centre and radius
        square = (points[:, 0] - x[0]) ** 2 + (points[:, 1] - x[1]) ** 2
        nlp = {"x": x, "p": ca.vec(points), "f": x[2], "g": square - x[2] ** 2}
        solver = ipopt("circle", nlp, context.options)

    def answer(unit: Unit, index: int) -> tuple[complex, float, float]:
        p = np.concatenate([unit.points.real, unit.points.imag])
        middle = unit.points.mean()
        start = [middle.real, middle.imag, np.abs(unit.points - middle).max()]
        found = solver(x0=start, p=p, lbx=[-ca.inf, -ca.inf, 0], ubg=0)["x"].full().ravel()
        accept(ipopt_outcome(solver))
        return complex(found[0], found[1]), 0.0, 0.0

    shapes, outcome, message = each_set(program, context, answer)
    return Circle(shapes[0], shapes[1]), outcome, message


@method(NarrowestStadium, "ipopt", optimal=False)
def _stadium(program: NarrowestStadium, context: Context) -> Claim:
    """Nonlinear programs: least radius from many starting angles, then least half-length."""
    centers = None if program.center is None else program.center.ravel()
    angles = None if program.angle is None else program.angle.ravel()
    with context.stating():
        narrow = _strip(program.points.shape[-1], context)
        short = _segment(program.points.shape[-1], context)

    def answer(unit: Unit, index: int) -> tuple[complex, float, float]:
        center = None if centers is None else unit.inward(centers[index])
        if angles is None:
            starts = np.pi * (np.arange(STARTS) + context.rng.uniform(size=STARTS)) / STARTS
        else:
            starts = angles[index : index + 1]
        angle, axis = _best_strip(narrow, unit, center, starts, fixed=angles is not None)
        turn = np.exp(1j * angle)
        local = unit.points / turn - 1j * axis
        along = None
        if center is not None:  # exactly, not to the solver's feasibility tolerance
            local = (unit.points - center) / turn
            along = 0.0
        middle, half_length = _shortest(short, local.real, local.imag, along, context)
        if center is None:
            center = complex(middle, axis) * turn
        return center, half_length, angle

    shapes, outcome, message = each_set(program, context, answer)
    return Stadium(*shapes), outcome, message


def _strip(count: int, context: Context) -> Any:
    """Least radius of a strip: variables angle, axis, radius."""
    import casadi as ca

    p = ca.SX.sym("p", 2 * count + 3)  # points, centre, 1 where the centre is given
    x = ca.SX.sym("x", 3)
    cos, sin = ca.cos(x[0]), ca.sin(x[0])
    across = cos * p[count : 2 * count] - sin * p[:count] - x[1]
    off = p[2 * count + 2] * (cos * p[2 * count + 1] - sin * p[2 * count] - x[1])
    nlp = {"x": x, "p": p, "f": x[2], "g": ca.vertcat(across - x[2], -across - x[2], off, -off)}
    return ipopt("strip", nlp, context.options)


def _best_strip(
    solver: Any, unit: Unit, center: complex | None, starts: np.ndarray, *, fixed: bool
) -> tuple[float, float]:
    """Angle and axis of the narrowest strip over all starts."""
    given = [0.0, 0.0, 0.0] if center is None else [center.real, center.imag, 1.0]
    p = np.concatenate([unit.points.real, unit.points.imag, given])
    best, refusal = None, None
    for start in starts:
        local = (
            (unit.points if center is None else unit.points - center) / np.exp(1j * start)
        ).imag
        axis = 0.5 * (local.min() + local.max())
        if center is not None:
            axis = (center / np.exp(1j * start)).imag
        lower = [start if fixed else start - np.pi, -np.inf, 0.0]
        upper = [start if fixed else start + np.pi, np.inf, np.inf]
        found = (
            solver(x0=[start, axis, np.abs(local).max()], p=p, lbx=lower, ubx=upper, ubg=0)["x"]
            .full()
            .ravel()
        )
        solved = ipopt_outcome(solver)
        if solved[0] not in (Outcome.SOLVED, Outcome.INACCURATE):
            refusal = solved
        elif best is None or found[2] < best[2]:
            best = found
    if best is None:
        raise RefusedError(refusal or (Outcome.FAILED, "no start"))
    return float(best[0]), float(best[1])


def _segment(count: int, context: Context) -> Any:
    """Least half-length of a segment: variables middle, half-length, nearest point to each."""
    import casadi as ca

    p = ca.SX.sym("p", 2 * count + 1)  # along, beside, radius
    x = ca.SX.sym("x", count + 2)
    along, beside, radius = p[:count], p[count : 2 * count], p[2 * count]
    middle, half_length, nearest = x[0], x[1], x[2:]
    g = ca.vertcat(
        (along - nearest) ** 2 + beside**2 - radius**2,
        nearest - middle - half_length,
        middle - nearest - half_length,
    )
    return ipopt("segment", {"x": x, "p": p, "f": half_length, "g": g}, context.options)


def _shortest(
    solver: Any, along: np.ndarray, beside: np.ndarray, center: float | None, context: Context
) -> tuple[float, float]:
    """Middle and half-length of the shortest segment within reach of every point."""
    least = np.abs(beside).max()
    # Room for an interior point, as in the conic statement.
    radius = least + context.options.accuracy / 2 * max(least, context.options.accuracy)
    middle = 0.5 * (along.min() + along.max()) if center is None else center
    start = np.concatenate([[middle, np.abs(along - middle).max()], along])
    lower, upper = np.full(start.size, -np.inf), np.full(start.size, np.inf)
    lower[1] = 0.0
    if center is not None:
        lower[0] = upper[0] = center
    p = np.concatenate([along, beside, [radius]])
    found = solver(x0=start, p=p, lbx=lower, ubx=upper, ubg=0)["x"].full().ravel()
    accept(ipopt_outcome(solver))
    return float(found[0]), float(found[1])
