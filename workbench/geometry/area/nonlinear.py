"""Stadiums of the smallest area as nonlinear programs for IPOPT.

It is an independent answer beside the search, compared only if it is named: on the CD drives, with
10 s for each cell, it has no certificate (docs/study.md).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench.executor import Context
from workbench.geometry.area.program import SmallestAreaStadium
from workbench.geometry.each_set import RefusedError, UnitFrame, accept, each_set
from workbench.geometry.enclosing_stadium import Stadium
from workbench.program import Claim, method
from workbench.solvers import in_one_thread, ipopt, ipopt_outcome

STARTING_ANGLES = 6
"""Number of starting angles if the angle is free."""
STARTING_WIDTHS = (1.0, 1.5)
"""Starting radii, relative to half the width at the starting angle."""


@method(SmallestAreaStadium, "ipopt", optimal=False, by_name=True)
@in_one_thread
def _stadium(program: SmallestAreaStadium, context: Context) -> Claim:
    """Nonlinear program from many starting angles: every point is near a point of the segment."""
    centers = None if program.center is None else program.center.ravel()
    angles = None if program.angle is None else program.angle.ravel()
    count = program.size
    with context.stating():
        solver = _smallest(count, context)

    def answer(unit: UnitFrame, index: int) -> tuple[complex, float, float]:
        center = 0j if centers is None else unit.to_frame(centers[index])
        points = unit.points - center
        scale = float(np.abs(points).max()) or 1.0
        points = points / scale
        if angles is None:
            turns = np.arange(STARTING_ANGLES) + context.rng.uniform(size=STARTING_ANGLES)
            starts = np.pi * turns / STARTING_ANGLES
        else:
            starts = angles[index : index + 1]
        best: tuple[float, np.ndarray] | None = None
        refusal: RefusedError | None = None
        for start in starts:
            for wider in STARTING_WIDTHS:
                try:
                    found = _from(solver, points, start, wider, angles is None, centers is not None)
                except RefusedError as error:
                    refusal = error
                    continue
                if best is None or found[0] < best[0]:
                    best = found
        if best is None:
            assert refusal is not None
            raise refusal
        x, y, _, half_length, angle = best[1]
        return center + complex(x, y) * scale, max(float(half_length), 0.0) * scale, float(angle)

    shapes, outcome, message = each_set(program, context, answer)
    return Stadium(*shapes), outcome, message


def _smallest(count: int, context: Context) -> Any:
    """Solver for centre, radius, half-length and angle, and for each point a place (N,).

    The place is that of a point of the segment near the set's point, as a share of the half-length.
    """
    import casadi as ca

    points = ca.SX.sym("p", count, 2)
    v, share = ca.SX.sym("v", 5), ca.SX.sym("s", count)
    along = share * v[3]
    square = (points[:, 0] - v[0] - along * ca.cos(v[4])) ** 2
    square += (points[:, 1] - v[1] - along * ca.sin(v[4])) ** 2
    area = np.pi * v[2] ** 2 + 4 * v[2] * v[3]
    nlp = {"x": ca.vertcat(v, share), "p": ca.vec(points), "f": area, "g": square - v[2] ** 2}
    return ipopt("smallest_area", nlp, context.options)


def _from(
    solver: Any, points: np.ndarray, angle: float, wider: float, free: bool, centred: bool
) -> tuple[float, np.ndarray]:
    """Area and the five numbers of the stadium that the solver finds from a start."""
    local = points / np.exp(1j * angle)
    t, h = local.real, local.imag
    ends = ((t.min() + t.max()) / 2, (h.min() + h.max()) / 2)
    middle = 0j if centred else complex(*ends)
    t, h = t - middle.real, h - middle.imag
    radius = wider * float(np.abs(h).max()) or 1e-6
    half_length = max(float(np.abs(t).max()), 1e-6)
    at = middle * np.exp(1j * angle)
    inf, count = np.inf, len(points)
    place = -inf if not centred else 0.0
    turn = inf if free else 0.0
    found = solver(
        x0=[at.real, at.imag, radius, half_length, angle, *np.clip(t / half_length, -1, 1)],
        p=np.concatenate([points.real, points.imag]),
        lbx=[place, place, 0.0, 0.0, angle - turn, *[-1.0] * count],
        ubx=[-place, -place, inf, inf, angle + turn, *[1.0] * count],
        ubg=0,
    )
    accept(ipopt_outcome(solver))
    x = found["x"].full().ravel()[:5]
    # the radius decides between starts, so it is recomputed from the points
    away = (points - complex(x[0], x[1])) / np.exp(1j * x[4])
    beyond = np.hypot(np.maximum(np.abs(away.real) - x[3], 0.0), away.imag)
    x[2] = beyond.max()
    return float(np.pi * x[2] ** 2 + 4 * x[2] * max(x[3], 0.0)), x
