"""Parameters of a strategy by direct search over an ensemble.

The size of a balloon is a mean of shares of time: it jumps, so no gradient is of use. Nelder and
Mead's simplex with the same circumstances for every trial. An ensemble alone does not see how near
to instability a loop is, so the sensitivity of every drive's loop is bounded beside.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize

from workbench.arrays import RealArray
from workbench.heavy_types import StateSpace

from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD
from ...laboratory.experiment import Laboratory
from .runs import Design

PARAMETERS = ("gain_db", "dist_max", "corner")
BOUNDS = {"gain_db": (-9.0, 9.0), "dist_max": (0.2, 0.7), "corner": (60.0, 600.0)}
"""Within which the parameters are looked for: gain [dB], threshold [1], corner [Hz]."""
STEPS = {"gain_db": 2.0, "dist_max": 0.1, "corner": 150.0}
"""First steps of the simplex from where it starts."""
LARGEST = 2.0
"""Sensitivity that no drive's loop may exceed: M of the performance weight (eq. 6.11)."""
FREQUENCY = np.geomspace(20.0, 15e3, 600)
"""At which the sensitivity is looked at [Hz]."""


def peak_sensitivity(axis: Axis, law: StateSpace) -> float:
    """Largest |S| of the twelve drives' loops with a discrete controller; unstable: infinite."""
    import control

    K = law(np.exp(2j * np.pi * FREQUENCY * PERIOD))
    peak = 0.0
    for n in range(1, 13):
        bench = Laboratory(axis, f"CD{n}")
        # f_en falls as the lens rises: the response has the feedback's sign in it.
        if abs(control.feedback(law, bench.sampled_error(), sign=1).poles()).max() >= 1.0:
            return np.inf
        returned = 1.0 - K * bench.response(FREQUENCY)["f_en"]
        peak = max(peak, float(1.0 / abs(returned).min()))
    return peak


@dataclass
class Search:
    """At most `trials` designs from a first one on; the corner only where there is one."""

    start: Design
    cost: Callable[[Design], float]
    trials: int
    tried: list[RealArray] = field(default_factory=list)
    costs: list[float] = field(default_factory=list)

    @property
    def free(self) -> list[str]:
        return list(PARAMETERS if self.start.strategy == "A" else PARAMETERS[:2])

    def run(self) -> tuple[Design, RealArray, RealArray]:
        """The best design met, all of them (trials, PARAMETERS), and their costs (trials,).

        What is missing at an early end is the last one again.
        """
        first = np.array([getattr(self.start, name) for name in self.free])
        scale = np.array([STEPS[name] for name in self.free])
        simplex = np.vstack([first, first + np.diag(scale)]) / scale
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

    def _trial(self, values: RealArray) -> float:
        design = self._design(values)
        self.tried.append(np.array([getattr(design, name) for name in PARAMETERS]))
        self.costs.append(self.cost(design))
        return self.costs[-1]

    def _design(self, values: RealArray) -> Design:
        inside: dict[str, Any] = {
            name: float(np.clip(value, *BOUNDS[name]))
            for name, value in zip(self.free, values, strict=True)
        }
        return replace(self.start, **inside)
