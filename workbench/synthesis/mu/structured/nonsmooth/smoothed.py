"""IPOPT, through CasADi, for a smooth function that Python evaluates together with its gradient."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.solvers import in_one_thread
from workbench.synthesis.mu.structured.nonsmooth.bfgs import Valued

QUIET: dict[str, Any] = {"print_time": False, "show_eval_warnings": False}
IPOPT: dict[str, Any] = {
    "print_level": 0,
    "sb": "yes",
    "hessian_approximation": "limited-memory",
    "tol": 1e-7,
    "acceptable_tol": 1e-5,
}
"""Options of IPOPT: no output, and Hessians approximated from gradients."""


@in_one_thread
def ipopt_minimum(valued: Valued, y: RealArray, most_steps: int, radius: float) -> RealArray:
    """The best point that IPOPT evaluates, starting at y (k,), in a box of this radius around y.

    Where the value is infinite, IPOPT gets no value and shortens its step.
    """
    import casadi

    seen = _Remembering(valued, y)

    class Slopes(casadi.Callback):
        def __init__(self) -> None:
            casadi.Callback.__init__(self)
            self.construct("slopes", {})

        def get_n_in(self) -> int:
            return 2

        def get_sparsity_in(self, i: Any) -> Any:
            return casadi.Sparsity.dense(len(y) if i == 0 else 1, 1)

        def get_sparsity_out(self, i: Any) -> Any:
            return casadi.Sparsity.dense(1, len(y))

        def eval(self, given: Any) -> Any:
            return [casadi.DM(seen.at(np.array(given[0]).ravel())[1]).T]

    slopes = Slopes()

    class Value(casadi.Callback):
        def __init__(self) -> None:
            casadi.Callback.__init__(self)
            self.construct("value", {})

        def get_sparsity_in(self, i: Any) -> Any:
            return casadi.Sparsity.dense(len(y), 1)

        def has_jacobian(self) -> bool:
            return True

        def get_jacobian(self, *_: Any) -> Any:
            return slopes

        def eval(self, given: Any) -> Any:
            value = seen.at(np.array(given[0]).ravel())[0]
            return [value if math.isfinite(value) else math.nan]

    value = Value()
    x = casadi.MX.sym("x", len(y))
    options = QUIET | {"ipopt": IPOPT | {"max_iter": most_steps}}
    statement: Any = {"x": x, "f": value(x)}
    solver = casadi.nlpsol("solver", "ipopt", statement, options)
    solver(x0=y, lbx=y - radius, ubx=y + radius)
    return seen.best


class _Remembering:
    """A function that remembers its last and its best point."""

    def __init__(self, valued: Valued, y: RealArray) -> None:
        self.valued, self.best, self.least = valued, y, math.inf
        self.last: tuple[RealArray, tuple[float, RealArray]] | None = None

    def at(self, y: RealArray) -> tuple[float, RealArray]:
        """The value and the gradient at y."""
        if self.last is None or not np.array_equal(self.last[0], y):
            self.last = y.copy(), self.valued(y)
            if self.last[1][0] < self.least:
                self.best, self.least = self.last[0], self.last[1][0]
        return self.last[1]
