"""Models with faults of the literature.

A. Varga, Solving Fault Diagnosis Problems: Linear Synthesis Techniques (Springer, 2017); Z. Yuan,
G. C. Vansteenkiste, C. Y. Wen, International Journal of Control (1997). The data are those of the
scripts that accompany the book.
"""

from __future__ import annotations

import numpy as np

from workbench.diagnosis import FaultModel
from workbench.systems import realisation
from workbench.types import StateSpace

YUAN_ROWS = {"weak": 18, "strong": 12}
"""Number of attainable rows of `four_compartments`: weakly (generic), and strongly at 0 and 1
rad/s.
"""
SUBOPTIMAL = 2e-3
"""Excess of the book's matching error for `two_actuators` over the least error, with its M_r."""


def two_actuators() -> FaultModel:
    """Examples 2.2 and 5.16: two failing actuators, with noise in place of two uncertain
    parameters.

    A pair of poles of A has the real part -0.5 (1 + rho1) and the imaginary part 0.6 (1 + rho2),
    each uncertain by 25 %. The noise w enters where these parameters act, with a gain of 0.25.
    """
    B = np.array([[1.0, 1.0], [1.0, 0.0], [0.0, 1.0]])
    noise = 0.25 * np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]])
    C = np.array([[0.0, 1.0, 1.0], [1.0, 1.0, 0.0]])
    system = realisation(
        (uncertain_dynamics(0.0, 0.0), np.hstack([B, noise]), C, np.zeros((2, 4))),
        0.0,
        inputs=["u1", "u2", "w1", "w2"],
        outputs=["y1", "y2"],
    )
    return FaultModel(system, controls=("u1", "u2"), noise=("w1", "w2")).with_actuator_faults()


def uncertain_dynamics(rho1: float, rho2: float) -> np.ndarray:
    """Matrix A of `two_actuators` after relative changes rho1 and rho2 of its two parameters."""
    real, imaginary = -0.5 * (1.0 + rho1), 0.6 * (1.0 + rho2)
    return np.array([[-0.8, 0.0, 0.0], [0.0, real, imaginary], [0.0, -imaginary, real]])


def unstable_sensor() -> FaultModel:
    """Example 5.4: an unstable plant with two outputs, a disturbance, an actuator and a sensor
    fault.

    y1 = (s+1)/(s-2) (u + f_u) + (s-1)/(s+2) d, y2 = (s+2)/(s-3) (u + f_u) + f_y2.
    """
    A = np.diag([2.0, 3.0, -2.0])
    B = np.array([[3.0, 0.0], [5.0, 0.0], [0.0, -3.0]])
    C = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    D = np.array([[1.0, 1.0], [1.0, 0.0]])
    system = realisation((A, B, C, D), 0.0, inputs=["u", "d"], outputs=["y1", "y2"])
    return (
        FaultModel(system, controls=("u",), disturbances=("d",))
        .with_actuator_faults()
        .with_sensor_faults("y2")
    )


def unstable_sensor_residual(s: np.ndarray) -> np.ndarray:
    """Published residual generator (F, 1, 3) from (y1, y2, u) of `unstable_sensor`, with a pole at
    -3.
    """
    row = np.array([0.0 * s, (s - 3.0) / (s + 3.0), -(s + 2.0) / (s + 3.0)])
    return row.T[:, None, :]


def four_compartments() -> FaultModel:
    """Yuan and others: a cascade of four states, one control, three outputs, eight faults."""
    A = np.array(
        [[-1.0, 1, 0, 0], [1, -2, 1, 0], [0, 1, -2, 1], [0, 0, 1, -2]],
    )
    B = np.eye(4)[:, [0]]
    C = np.eye(4)[[0, 2, 3]]
    faults = np.hstack([np.eye(4), [[1, 0, 0, 0], [-1, 1, 0, 0], [0, -1, 1, 0], [0, 0, -1, 1]]])
    names = [f"f{k}" for k in range(1, 9)]
    system: StateSpace = realisation(
        (A, np.hstack([B, faults]), C, np.zeros((3, 9))),
        0.0,
        inputs=["u", *names],
        outputs=["y1", "y2", "y3"],
    )
    return FaultModel(system, controls=("u",), faults=tuple(names))
