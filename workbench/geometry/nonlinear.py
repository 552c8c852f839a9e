"""Circles and stadiums as nonlinear programs for IPOPT, from many starting angles.

Of stadiums it is an independent answer beside the exact one, compared only if it is named: on the
CD drives, with 10 s for each cell, it has no certificate (docs/study.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench.executor import Context
from workbench.geometry.circle import Circle, SmallestCircle
from workbench.geometry.each_set import RefusedError, UnitFrame, accept, each_set, segment_frame
from workbench.geometry.enclosing_stadium import Stadium
from workbench.geometry.stadium import NarrowestStadium
from workbench.program import Claim, method
from workbench.solvers import Outcome, in_one_thread, ipopt, ipopt_outcome

STARTING_ANGLES = 12
"""Number of starting angles; the width of twelve points has about as many local minima."""
MIN_STRIP_UNIT = 1e-12
"""Smallest unit of length, relative to the set's size, in the program that refines a strip."""


@method(SmallestCircle, "ipopt", optimal=True)
@in_one_thread
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

    def answer(unit: UnitFrame, index: int) -> tuple[complex, float, float]:
        p = np.concatenate([unit.points.real, unit.points.imag])
        middle = unit.points.mean()
        start = [middle.real, middle.imag, np.abs(unit.points - middle).max()]
        found = solver(x0=start, p=p, lbx=[-ca.inf, -ca.inf, 0], ubg=0)["x"].full().ravel()
        accept(ipopt_outcome(solver))
        return complex(found[0], found[1]), 0.0, 0.0

    shapes, outcome, message = each_set(program, context, answer)
    return Circle(shapes[0], shapes[1]), outcome, message


@method(NarrowestStadium, "ipopt", optimal=False, by_name=True)
@in_one_thread
def _stadium(program: NarrowestStadium, context: Context) -> Claim:
    """Nonlinear programs: least radius from many starting angles, then least half-length."""
    centers = None if program.center is None else program.center.ravel()
    angles = None if program.angle is None else program.angle.ravel()
    count = program.points.shape[-1]
    with context.stating():
        narrow, short = _strip(count, context), _segment(count, context)

    def answer(unit: UnitFrame, index: int) -> tuple[complex, float, float]:
        center = 0j if centers is None else unit.to_frame(centers[index])
        points = unit.points - center
        if angles is None:
            starts = (
                np.pi
                * (np.arange(STARTING_ANGLES) + context.rng.uniform(size=STARTING_ANGLES))
                / STARTING_ANGLES
            )
        else:
            starts = angles[index : index + 1]
        strip = StripSearch(narrow, points, free=angles is None, centred=centers is not None)
        angle, axis = strip.narrowest(starts)
        frame = segment_frame(points, angle, axis, centers is not None, context.options.accuracy)
        bound = np.full(count + 2, np.inf)
        lower, upper = -bound, bound
        lower[1] = -frame.reach / frame.radius
        if centers is not None:
            lower[0] = upper[0] = 0.0
        p = np.concatenate([frame.ahead, frame.behind, frame.beside])
        found = short(x0=np.zeros(count + 2), p=p, lbx=lower, ubx=upper, ubg=0)["x"].full().ravel()
        accept(ipopt_outcome(short))
        middle, half_length = frame.segment(found[0], found[1])
        return center + middle, half_length, angle

    shapes, outcome, message = each_set(program, context, answer)
    return Stadium(*shapes), outcome, message


def _strip(count: int, context: Context) -> Any:
    """Solver for the strip of least radius; its variables are turn, axis and radius, in units of a
    width.
    """
    import casadi as ca

    along, across, width = ca.SX.sym("t", count), ca.SX.sym("h", count), ca.SX.sym("w")
    x = ca.SX.sym("x", 3)
    # h / w after turning by w x0; sin(w x0) / w stays of order one however narrow the strip
    turned = ca.cos(width * x[0]) * across / width - ca.sin(width * x[0]) / width * along
    beside = turned - x[1]
    nlp = {
        "x": x,
        "p": ca.vertcat(along, across, width),
        "f": x[2],
        "g": ca.vertcat(beside - x[2], -beside - x[2]),
    }
    return ipopt("strip", nlp, context.options)


@dataclass(frozen=True)
class StripSearch:
    """Search for the narrowest strip around points (N,).

    Parameters
    ----------
    solver
        Solver of `_strip` for N points.
    points
        Complex (N,), of unit size.
    free
        Whether the angle is free; else it stays at the start.
    centred
        Whether the axis must pass through 0.
    """

    solver: Any
    points: np.ndarray
    free: bool
    centred: bool

    def narrowest(self, starts: np.ndarray) -> tuple[float, float]:
        """Angle [rad] and axis of the narrowest strip found from the starting angles [rad].

        Raises `RefusedError` if no start leads to an answer.
        """
        best: tuple[float, float, float] | None = None
        refusal = (Outcome.FAILED, "no start")
        for start in starts:
            try:
                found = self._near(start, 1.0)
            except RefusedError as error:
                refusal = (error.outcome, str(error))
                continue
            if best is None or found[0] < best[0]:
                best = found
        if best is None:
            raise RefusedError(refusal)
        for _ in range(2):  # again, in units of the width found
            refined = self._near(best[1], max(best[0], MIN_STRIP_UNIT))
            best = min(best, refined)
        return best[1], best[2]

    def _near(self, start: float, width: float) -> tuple[float, float, float]:
        """Radius, angle and axis of the strip found from one starting angle [rad].

        ``width`` is the unit of length of the nonlinear program.
        """
        local = self.points / np.exp(1j * start)
        across = local.imag
        axis = 0.0 if self.centred else 0.5 * (across.min() + across.max())
        quarter = np.pi / 2 / width if self.free else 0.0
        lower, upper = np.array([-quarter, -np.inf, 0.0]), np.array([quarter, np.inf, np.inf])
        if self.centred:
            lower[1] = upper[1] = 0.0
        found = self.solver(
            x0=[0.0, axis / width, np.abs(across - axis).max() / width],
            p=np.concatenate([local.real, across, [width]]),
            lbx=lower,
            ubx=upper,
            ubg=0,
        )
        accept(ipopt_outcome(self.solver))
        turn, axis, _ = found["x"].full().ravel() * width
        # the radius decides between starts, so it is recomputed from the points
        turned = (self.points / np.exp(1j * (start + turn))).imag
        if not self.centred:
            axis = 0.5 * (turned.min() + turned.max())
        return float(np.abs(turned - axis).max()), float(start + turn), float(axis)


def _segment(count: int, context: Context) -> Any:
    """Solver for the least half-length (see `SegmentFrame`); variables m, l and shifts s (N,)."""
    import casadi as ca

    ahead, behind, beside = (ca.SX.sym(name, count) for name in "abh")
    x = ca.SX.sym("x", count + 2)
    middle, half_length, shift = x[0], x[1], x[2:]
    g = ca.vertcat(
        shift**2 + beside**2 - 1,
        ahead + shift - middle - half_length,
        behind - shift + middle - half_length,
    )
    nlp = {"x": x, "p": ca.vertcat(ahead, behind, beside), "f": half_length, "g": g}
    return ipopt("segment", nlp, context.options)
