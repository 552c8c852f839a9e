"""An experiment whose input reduces the uncertainty where it costs most mu."""

from __future__ import annotations

from functools import cache
from typing import Annotated

import numpy as np
from pydantic import Field

from workbench import problem, solve
from workbench.fitting import Rational
from workbench.identification import ExperimentDesign
from workbench.synthesis import HinfSynthesis
from workbench.systems import response
from workbench.types import ComplexArray, RealArray, StateSpace

from .estimate_to_mu import TRUE_PLANT, weighted_loop

BASE = 0.1
"""Spacing of the lines [rad/s]."""
VARIANCE = 0.05
"""Variance of the response that is measured in one period at a line of unit power."""
WATCHED = np.geomspace(0.05, 10.0, 40)
"""Angular frequencies [rad/s] at which errors of the estimate cost."""


@cache
def nominal_controller() -> StateSpace:
    """The H-infinity controller of the true plant."""
    parts = TRUE_PLANT.state_space()
    import control

    plant = control.ss(parts.A, parts.B, parts.C, parts.D, inputs="u", outputs="y")
    found: StateSpace = solve(HinfSynthesis(weighted_loop(plant))).lti
    return found


def coefficient_slopes(plant: Rational, omega: RealArray) -> ComplexArray:
    """Derivatives (F, 3) of b / (s^2 + a1 s + a0) with respect to b, a1 and a0."""
    s, values = 1j * omega, plant.response(omega)
    pole_part = values / plant.gain
    return np.stack([pole_part, -values * s * pole_part, -values * pole_part], axis=1)


def error_cost(omega: RealArray) -> RealArray:
    """|K S|^2 at omega [rad/s]: a response error e uses up the share |K S e| of the stability
    margin.
    """
    k = response(nominal_controller(), omega)[:, 0, 0]
    return np.abs(k / (1.0 + k * TRUE_PLANT.response(omega))) ** 2


@problem("textbook/experiment-design", slow=True)
def experiment_design(
    lines: Annotated[int, Field(ge=3, le=200)] = 30,
    largest: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0,
) -> ExperimentDesign:
    """Powers of a multisine that leave a robust controller the least uncertainty where it costs.

    An oscillator of 1 rad/s is excited at multiples of 0.1 rad/s with a total power of 1. The cost
    of a response error is the share of the stability margin that it uses up in the loop with the
    H-infinity controller.

    lines: number of lines. largest: largest power of one line.
    """
    omega: RealArray = BASE * np.arange(1.0, lines + 1.0)
    uses = np.vstack([np.ones(lines), np.eye(lines) / largest])
    return ExperimentDesign(
        coefficient_slopes(TRUE_PLANT, omega),
        np.full(lines, VARIANCE),
        coefficient_slopes(TRUE_PLANT, WATCHED),
        error_cost(WATCHED),
        uses=uses,
    )
