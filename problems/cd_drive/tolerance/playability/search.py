"""Parameters of a strategy by direct search over an ensemble.

The size of a balloon is a mean of shares of time. It is not continuous, so gradients are useless;
Nelder and Mead's simplex is used, with the same circumstances for every trial. An ensemble alone
does not show how close a loop is to instability, so the sensitivity of every drive's loop is
bounded, too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.optimize import minimize

from workbench.systems import modulus_margin
from workbench.types import ComplexArray, RealArray, StateSpace

from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD
from ...laboratory.experiment import Laboratory
from .runs import Design

PARAMETERS = ("gain_db", "dist_max", "corner")
BOUNDS = {"gain_db": (-9.0, 9.0), "dist_max": (0.2, 0.7), "corner": (60.0, 600.0)}
"""Least and largest values of the parameters: gain [dB], threshold [1], corner [Hz]."""
FIRST_STEPS = {"gain_db": 2.0, "dist_max": 0.1, "corner": 150.0}
"""Distances of the first simplex's corners from the start, in the units of `BOUNDS`."""
LARGEST_SENSITIVITY = 2.0
"""Largest |S| that a drive's loop may have: M of the performance weight (eq. 6.11)."""
FREQUENCY = np.geomspace(20.0, 15e3, 600)
"""Frequencies [Hz] at which the sensitivity is computed."""


def peak_sensitivity(axis: Axis, law: StateSpace) -> float:
    """Largest |S| of the twelve drives' loops with a discrete controller; infinite if unstable."""
    import control

    K = law(np.exp(2j * np.pi * FREQUENCY * PERIOD))
    peak = 0.0
    for drive, response in _drives(axis):
        # f_en falls as the lens rises, so the response includes the sign of the feedback.
        if abs(control.feedback(law, drive, sign=1).poles()).max() >= 1.0:
            return np.inf
        peak = max(peak, 1.0 / modulus_margin(-K * response))
    return peak


@lru_cache(maxsize=2)
def _drives(axis: Axis) -> list[tuple[StateSpace, ComplexArray]]:
    """Sampled models u -> f_en of the twelve drives, and their responses at FREQUENCY."""
    benches = [Laboratory(axis, f"CD{n}") for n in range(1, 13)]
    return [(one.sampled_error(), one.response(FREQUENCY)["f_en"]) for one in benches]


@dataclass
class Search:
    """Search for the design of least cost with at most ``trials`` trials, beginning at ``start``.

    The corner is searched only if the strategy has one.
    """

    start: Design
    cost: Callable[[Design], float]
    trials: int
    tried: list[RealArray] = field(default_factory=list)
    costs: list[float] = field(default_factory=list)

    @property
    def free(self) -> list[str]:
        return list(PARAMETERS if self.start.strategy == "A" else PARAMETERS[:2])

    def run(self) -> tuple[Design, RealArray, RealArray]:
        """The best design, all designs tried (trials, PARAMETERS), and their costs.

        If the search ends early, the last trial is repeated until there are ``trials`` rows.
        """
        first = np.array([getattr(self.start, name) for name in self.free])
        scale = np.array([FIRST_STEPS[name] for name in self.free])
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
