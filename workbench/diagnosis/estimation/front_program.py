"""The cone programs whose solutions form the front of fault filters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.diagnosis.estimation.limits import Limits
from workbench.executor import Context
from workbench.solvers import Outcome, conic_solvers, solve_conic


class FrontProgram:
    """Minimise E + 3 ||noise x|| under some limits, with E up to a largest value.

    noise: (M, n); None: the least E. ``said`` is the solver's last message.
    """

    def __init__(self, noise: RealArray | None = None, largest: float | None = None) -> None:
        self._noise, self._largest = noise, largest
        self.said = ""

    def solved(self, limits: Sequence[Limits]) -> tuple[RealArray, float] | None:
        """The optimum (x, E), or None."""
        import cvxpy as cp

        x, E, rms = cp.Variable(limits[0].A.shape[1]), cp.Variable(), cp.Variable(nonneg=True)
        held = [] if self._noise is None else [cp.norm(self._noise @ x) <= rms]
        discs = [one for one in limits if not one.half_plane]
        A, c = np.vstack([one.A for one in discs]), np.concatenate([one.c for one in discs])
        b, d = (np.concatenate(each) for each in zip(*(_ends(one) for one in discs), strict=True))
        parts = cp.vstack([c.real - A.real @ x, c.imag - A.imag @ x])
        held.append(cp.SOC(b + d * E, parts, axis=0))
        for one in limits:
            if one.half_plane:
                b, d = _ends(one)
                end = b + d * cp.inv_pos(E) if d.any() else b
                held.append(one.c.real - one.A.real @ x >= end)
        if self._largest is not None:
            held.append(self._largest >= E)
        cost = E if self._noise is None else E + 3 * rms
        self.said = solve_in_place(cp.Problem(cp.Minimize(cost), held))
        return None if x.value is None else (x.value, float(E.value))


def _ends(limits: Limits) -> tuple[RealArray, RealArray]:
    return limits.b, np.broadcast_to(limits.d, limits.b.shape)


def solve_in_place(problem: Any) -> str:
    """Solve a cone program by the default solver and return its message.

    Variables are None if the solver failed.
    """
    context = Context()
    outcome, said = solve_conic(problem, conic_solvers()[0], context.options, context)
    if outcome not in (Outcome.SOLVED, Outcome.INACCURATE):
        for variable in problem.variables():
            variable.value = None
    return said
