"""Narrowest stadiums through CVXPY: at a fixed angle the problem is convex, so
angles are scanned.
"""

from __future__ import annotations

import numpy as np

from workbench.errors import SolverError
from workbench.executor import Context
from workbench.solvers import Options, Outcome, conic_solvers, solve_conic

COARSE, FINE, ROUNDS = 24, 4, 5
"""Number of angles of the first scan, factor by which each further round is finer, number of these
rounds.
"""


class ScannedStadiums:
    """One parametrised program, solved again for every set and angle."""

    def __init__(self, points: int, context: Context) -> None:
        import cvxpy as cp

        self._context = context
        self._across, self._axis = cp.Parameter(points), cp.Variable()
        self._width = cp.Variable()
        strip = [cp.abs(self._across - self._axis) <= self._width]
        self._free = cp.Problem(cp.Minimize(self._width), strip)
        self._centred = cp.Problem(cp.Minimize(self._width), [*strip, self._axis == 0])
        self._solver = next(s for s in conic_solvers() if s.name == "clarabel")

    def narrowest(
        self, sets: np.ndarray, center: complex | None, what: str
    ) -> tuple[np.ndarray, np.ndarray]:
        """Smallest radius (F,) over the angles tried, and the angle (F,) that gives it."""
        found = []
        for points in self._context.track(list(sets), what):
            step = np.pi / COARSE
            tried = {a: self._radius(points, a, center) for a in np.arange(COARSE) * step}
            for _ in range(ROUNDS):
                best = min(tried, key=lambda angle: tried[angle])
                step /= FINE
                for k in (-3, -2, -1, 1, 2, 3):
                    angle = best + k * step
                    tried[angle] = self._radius(points, angle, center)
            best = min(tried, key=lambda angle: tried[angle])
            found.append((tried[best], best))
        radius, angle = np.array(found).T
        return radius, np.mod(angle, np.pi)

    def at(self, sets: np.ndarray, angles: np.ndarray, what: str) -> np.ndarray:
        """Smallest radius (F,) of stadiums centred at 0, at given angles (F,)."""
        pairs = self._context.track(list(zip(sets, angles, strict=True)), what)
        return np.array([self._radius(points, angle, 0.0) for points, angle in pairs])

    def _radius(self, points: np.ndarray, angle: float, center: complex | None) -> float:
        middle = points.mean() if center is None else center
        local = ((points - middle) * np.exp(-1j * angle)).imag
        scale = np.abs(local).max() or 1.0
        self._across.value = local / scale
        problem = self._free if center is None else self._centred
        outcome, message = solve_conic(
            problem, self._solver, Options(tolerance="middle"), self._context
        )
        if outcome not in (Outcome.SOLVED, Outcome.INACCURATE):
            raise SolverError(message)
        return float(self._width.value) * scale
