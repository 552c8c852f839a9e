"""Parameters of a strategy by direct search over an ensemble.

The size of a balloon is a mean of shares of time: it jumps, so no gradient is of use. Nelder and
Mead's simplex with the same circumstances for every trial.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import minimize

from .actuator import Real
from .playability_runs import Design

PARAMETERS = ("gain_db", "dist_max", "corner")
BOUNDS = {"gain_db": (-9.0, 12.0), "dist_max": (0.2, 0.7), "corner": (60.0, 600.0)}
"""Within which the parameters are looked for: gain [dB], threshold [1], corner [Hz]."""
STEPS = {"gain_db": -4.0, "dist_max": 0.1, "corner": 150.0}
"""First steps of the simplex from where it starts."""


@dataclass
class Search:
    """At most `trials` designs from a first one on; the corner only where there is one."""

    start: Design
    cost: Callable[[Design], float]
    trials: int
    tried: list[Real] = field(default_factory=list)
    costs: list[float] = field(default_factory=list)

    @property
    def free(self) -> list[str]:
        return list(PARAMETERS if self.start.strategy == "A" else PARAMETERS[:2])

    def run(self) -> tuple[Design, Real, Real]:
        """The best design met, all of them (trials, PARAMETERS), and their costs (trials,).

        What is missing at an early end is the last one again.
        """
        first = np.array([getattr(self.start, name) for name in self.free])
        scale = np.array([abs(STEPS[name]) for name in self.free])
        steps = np.array([STEPS[name] for name in self.free])
        simplex = np.vstack([first, first + np.diag(steps)]) / scale
        bounds = np.array([BOUNDS[name] for name in self.free]) / scale[:, None]
        minimize(
            lambda x: self._trial(x * scale),
            first / scale,
            method="Nelder-Mead",
            bounds=bounds,
            options={"initial_simplex": simplex, "maxfev": self.trials, "xatol": 1e-2, "fatol": 0},
        )
        found = self._design(self.tried[int(np.argmin(self.costs))][: len(self.free)])
        missing = self.trials - len(self.tried)
        rows = [*self.tried, *[self.tried[-1]] * missing]
        return found, np.array(rows), np.array([*self.costs, *[self.costs[-1]] * missing])

    def _trial(self, values: Real) -> float:
        design = self._design(values)
        self.tried.append(np.array([getattr(design, name) for name in PARAMETERS]))
        self.costs.append(self.cost(design))
        return self.costs[-1]

    def _design(self, values: Real) -> Design:
        inside = {
            name: float(np.clip(value, *BOUNDS[name]))
            for name, value in zip(self.free, values, strict=True)
        }
        return replace(self.start, **inside)
