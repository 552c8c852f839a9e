"""Filters for comparison with the robust fault filter: a nominal H-infinity filter, and a
high-pass.
"""

from __future__ import annotations

import numpy as np

from workbench import solve
from workbench.diagnosis import FaultEstimation, FaultLoop, Requirement
from workbench.errors import SolverError
from workbench.fitting import Rational
from workbench.types import StateSpace
from workbench.uncertainty import GeneralisedPlant

from ..stand_in import low_pass

M, A, X, BANDWIDTH = 250.0, 0.001, 3.0, 2 * np.pi * 230.0
"""Peak, floor, widening and bandwidth [rad/s] of the weight of eq. 7.32."""
ELECTRONICS = 1e-9
"""Noise of the measured error [m]. It keeps the problem regular, since S alone is zero where the
loop integrates.
"""


def defect_weight() -> StateSpace:
    """Weight W_sd of defects (eq. 7.32), 1 at high frequency."""
    zeros = np.full(3, -X * BANDWIDTH * A ** (1 / 3), complex)
    poles = np.full(3, -X * BANDWIDTH * M ** (1 / 3), complex)
    return Rational(zeros, poles, 1.0).state_space()


def nominal_loop(loop: FaultLoop) -> GeneralisedPlant:
    """The nominal loop (x_cd, f_sd, n) -> e + n."""
    import control

    S = loop.plant.nominal().system
    read = control.StateSpace(
        S.A, np.hstack([S.B, np.zeros((S.nstates, 1))]), S.C, np.hstack([S.D, [[1.0]]]),
        inputs=["x_cd", "f_sd", "n"], outputs=["e"], remove_useless_states=False,
    )  # fmt: skip
    return GeneralisedPlant(read, None, 0, 1)


def peer_filters(loop: FaultLoop, error: float, leakage: float) -> dict[str, StateSpace]:
    """Filters F [m/m] in continuous time, by name.

    "H-infinity": least stacked norm for the nominal plant, with defects weighted as in eq. 7.32 for
    the relative error, and the disc for the leakage. "high-pass": of first order. Raises
    SolverError if the synthesis fails.
    """
    program = FaultEstimation(
        nominal_loop(loop),
        "f_sd",
        requirements=[
            Requirement("error", "f_sd", weight=defect_weight(), bound=error),
            Requirement("leakage", "x_cd", weight=loop.demands.disturbance, bound=leakage),
            Requirement("noise", "n", weight=ELECTRONICS, bound=leakage),
        ],
    )
    solution = solve(program, method="riccati")
    if solution.answer is None:
        raise SolverError(f"the nominal H-infinity filter: {solution.message}")
    return {"H-infinity": solution.answer.K, "high-pass": 1 - low_pass()}
