"""State feedback from strategy B's estimates, and the linear loops of both (section 8.4).

The Kalman filter of strategy B estimates the states x of the error's dynamics and the command u_p
that moves the lens as the disc moves. With it,

    u = u_p - k x - h (u_last - u_p),       min  sum e^2 + r (u - u_p)^2

where u_last is the previous command, which is still delayed by the computer's one sample. There is
no integrator; the oscillators of the filter follow the rotation, as in B. The weight r is chosen so
that the loop with known states has the same crossover as the reference loop, see `matched`. With
estimated states the crossover is lower, since the filter does not trust every measurement fully.

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import solve_discrete_are
from scipy.optimize import brentq

from workbench.diagnosis import KalmanEstimator, Rotation
from workbench.errors import SolverError
from workbench.simulation import Cascade, Part, discrete_system, linear_controller
from workbench.systems import loop_response, realisation
from workbench.types import RealArray, StateSpace

from ...diagnosis.position_estimator.model import kalman
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD
from ...laboratory.experiment import MEASUREMENTS, Laboratory
from ..tactics import Strategies

MICRO = 1e-6
"""A micrometre [m], the unit of the error in the cost."""
FREQUENCY = np.geomspace(30.0, 15e3, 1500)
"""Frequencies [Hz] between which a loop's crossover is searched."""
WEIGHTS = (1e-6, 1e4)
"""Weights of the command [um^2/V^2] between which the weight is searched."""


@dataclass(frozen=True, eq=False)
class StateFeedback:
    """The law of an axis; weight: of u - u_p in the cost [um^2/V^2]."""

    axis: Axis
    rotation: float
    weight: float

    @cached_property
    def estimator(self) -> KalmanEstimator:
        """The filter of strategy B, which also returns the plant's states."""
        plain = kalman(self.axis, Rotation(self.rotation))
        plant = plain.model.plant
        C = np.vstack([plant.C, np.eye(plant.nstates)])
        told = realisation((plant.A, plant.B, C, np.zeros((len(C), 2))), plant.dt)
        return KalmanEstimator(replace(plain.model, plant=told), plain.noise)

    @cached_property
    def gain(self) -> RealArray:
        """Gains k of the plant's states and h of the delayed command, in one row (n + 1,)."""
        A, B, C = self._deviations
        P = solve_discrete_are(A, B, C.T @ C, np.array([[self.weight]]))
        row: RealArray = np.linalg.solve(self.weight + B.T @ P @ B, B.T @ P @ A)[0]
        return row / self.scale

    @property
    def target(self) -> StateSpace:
        """The loop with known states, broken at the command."""
        A, B, _ = self._deviations
        row = (self.gain * self.scale)[None]
        return realisation((A, B, row, np.zeros((1, 1))), PERIOD)

    @property
    def residual(self) -> float:
        """Relative residual of the gain's Riccati equation; its cost is the closed loop's sum."""
        A, B, C = self._deviations
        k = (self.gain * self.scale)[None]
        closed, cost = A - B @ k, C.T @ C + self.weight * k.T @ k
        P = cost.copy()
        for _ in range(60):  # P = sum of closed'^i cost closed^i, by doubling
            step = closed.T @ P @ closed
            P, closed = P + step, closed @ closed
        A, B, C = self._deviations
        better = np.linalg.solve(self.weight + B.T @ P @ B, B.T @ P @ A)
        return float(abs(better - k).max() / abs(k).max())

    @property
    def scale(self) -> RealArray:
        """Scales of the states, from their responses to a command, so that matrix entries are about
        1.
        """
        plant = self.estimator.model.plant
        column, size = plant.B[:, :1], np.zeros(plant.nstates)
        for _ in range(2000):
            size = np.maximum(size, abs(column[:, 0]))
            column = plant.A @ column
        return np.append(size, 1.0)

    @property
    def _deviations(self) -> tuple[RealArray, RealArray, RealArray]:
        """A, B, C of (x, u_last - u_p) in units of `scale`, from u - u_p to the error [um]."""
        plant, scale = self.estimator.model.plant, self.scale
        n = plant.nstates
        A, B, C = np.zeros((n + 1, n + 1)), np.zeros((n + 1, 1)), np.zeros((1, n + 1))
        A[:n, :n], A[:n, n] = plant.A, plant.B[:, 0]
        B[n, 0] = 1.0
        C[0, :n] = plant.C[1] / MICRO
        return A * scale / scale[:, None], B / scale[:, None], C * scale

    def cascade(self, strategies: Strategies) -> Cascade:
        """The strategy: detector and filter as in B, then the state feedback, also in defects."""
        estimator = self.estimator
        n = estimator.model.plant.nstates
        states = [f"state_{k}" for k in range(n)]
        told = ("f_en_hat", "e_hat", *states, "x_hat", "u_p", "rotation")
        k, h = self.gain[:n], self.gain[n]
        row = np.concatenate([-k, [-h, 1.0 + h]])[None]
        law = realisation((np.zeros((0, 0)), np.zeros((0, n + 2)), np.zeros((1, 0)), row), PERIOD)
        return Cascade(
            MEASUREMENTS,
            [
                *strategies.detector,
                Part("estimator", estimator.controller, ["f_en", "u_last", "w_Q"], outputs=told),
                Part(
                    "u",
                    linear_controller(law, PERIOD, measurements=range(n + 2)),
                    [*states, "u_last", "u_p"],
                ),
            ],
        )

    @property
    def controller(self) -> StateSpace:
        """f_en -> u at quality 1, with the filter in steady state."""
        n = self.estimator.model.plant.nstates
        return estimating(self.estimator, np.append(-self.gain[:n], 1.0 + self.gain[n]), None)


def estimated(axis: Axis, rotation: float, K: StateSpace) -> StateSpace:
    """f_en -> u of strategy B at quality 1, with the filter in steady state: K f_en + u_p."""
    filter_ = kalman(axis, Rotation(rotation))
    row = np.append(np.zeros(filter_.model.plant.nstates), 1.0)
    return estimating(filter_, row, discrete_system(K, PERIOD))


def estimating(filter_: KalmanEstimator, row: RealArray, K: StateSpace | None) -> StateSpace:
    """f_en -> u at quality 1, with the filter in steady state: gains on the estimates, plus K f_en.

    row: gains of the estimated states and of u_p. The gain of u_last is 1 minus that of u_p, so
    that the sum is zero at u = u_p. K: discrete, or None.
    """
    settled = filter_.steady_state
    model, n = settled.model, settled.model.seen
    A, B, C, g = model.A[:n, :n], model.B[:n], model.C[:n], settled.gain
    on = np.zeros(n)
    on[: len(row) - 1] = row[:-1]
    on += row[-1] * model.disturbance[:n]
    last = 1.0 - row[-1]
    seen = np.eye(n) - np.outer(g, C)
    k = 0 if K is None else K.nstates
    size = n + 1 + k
    Ac, Bc, Cc = np.zeros((size, size)), np.zeros((size, 1)), np.zeros((1, size))
    D = np.array([[on @ g]])
    Cc[0, :n], Cc[0, n] = on @ seen, last
    Ac[:n, :n], Ac[:n, n], Bc[:n, 0] = A @ seen, B, A @ g
    if K is not None:
        Cc[0, n + 1 :], D = K.C[0], D + K.D
        Ac[n + 1 :, n + 1 :], Bc[n + 1 :] = K.A, K.B
    Ac[n], Bc[n] = Cc[0], D[0]
    return realisation((Ac, Bc, Cc, D), PERIOD)


def loop(bench: Laboratory, controller: StateSpace) -> StateSpace:
    """Open loop of a drive, broken at its command, for negative feedback."""
    return -bench.sampled_error() * controller


def crossover(open_loop: StateSpace) -> float:
    """Highest frequency [Hz] at which a loop has gain 1. Raises SolverError if there is none."""
    size = abs(loop_response(open_loop, FREQUENCY))
    above = np.flatnonzero(size >= 1.0)
    if not len(above) or above[-1] == len(size) - 1:
        raise SolverError("the loop has no crossover between 30 Hz and 15 kHz")
    last = above[-1]
    ends = FREQUENCY[last], FREQUENCY[last + 1]
    found: float = brentq(
        lambda f: float(np.log(abs(loop_response(open_loop, np.array([f]))[0]))), *ends
    )
    return found


def matched(axis: Axis, rotation: float, frequency: float) -> StateFeedback:
    """The law whose loop with known states crosses over at this frequency [Hz], for the nominal
    drive.

    Raises SolverError if no weight gives this.
    """

    def excess(log_weight: float) -> float:
        law = StateFeedback(axis, rotation, float(np.exp(log_weight)))
        try:
            return float(np.log(crossover(law.target) / frequency))
        except SolverError:
            return -1.0

    low, high = (float(np.log(one)) for one in WEIGHTS)
    if not excess(low) > 0.0 > excess(high):
        raise SolverError(f"no weight gives a crossover of {frequency:g} Hz")
    found = brentq(excess, low, high, xtol=1e-6)
    return StateFeedback(axis, rotation, float(np.exp(found)))
