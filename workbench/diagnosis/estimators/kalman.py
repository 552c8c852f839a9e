"""Kalman filters whose measurement noise follows the quality of the measurement.

    R(w) = r^2 + d^2 (1/w^2 - 1)

r: white noise of a good measurement; d: what a bad one may be off by. At quality 0 nothing is
learnt. With the covariance P of the prediction x^,

    S = C P C' + R(w),   M = P C' / S,   P := A (P - M C P) A' + Q        (Kalman, 1960)

is run on line, for the gain has to grow while nothing is learnt and to fall again afterwards; it
rests where it has settled. A sample of nine states costs three times what it does at rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np
from scipy.linalg import block_diag

from workbench.arrays import RealArray
from workbench.compiled import kernel
from workbench.diagnosis.estimators.disturbed import DisturbedPlant, need_model
from workbench.diagnosis.estimators.estimator import Estimator
from workbench.diagnosis.estimators.observers import balanced
from workbench.diagnosis.estimators.streaming import (
    HEADER,
    correct,
    layout,
    predict,
    surprise,
    tell,
)
from workbench.errors import InputError, SolverError
from workbench.input_checks import need_numbers
from workbench.simulation import Controller

SETTLED = 1e-9
"""Relative change of the gain a sample at which the covariance rests."""
DOUBLINGS = 60
"""Of the horizon of a stationary covariance; far fewer do."""
SOLVED = 1e-6
"""Largest relative residual of the stationary covariance."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations a sample of what is white.

    known        of the input u of the plant, in its unit;
    disturbance  of the steps of every oscillator state, in the unit of the disturbance;
    measurement  r of y at quality 1; defect: d, that at quality w adds d sqrt(1/w^2 - 1);
                 both in the unit of y. The coloured noise is the model's.

    Raises InputError unless finite, measurement and disturbance positive, the others not negative.
    """

    known: float
    disturbance: float
    measurement: float
    defect: float

    def __post_init__(self) -> None:
        need_numbers(**vars(self))
        values = (self.known, self.disturbance, self.measurement, self.defect)
        if not all(isfinite(one) for one in values) or min(values) < 0.0:
            raise InputError(f"{self}: deviations must be finite and not negative")
        if max(values) > np.finfo(float).max ** 0.5:
            raise InputError(f"{self}: variances must be finite as well")
        if self.measurement == 0.0 or self.disturbance == 0.0:
            raise InputError(f"{self}: measurement and disturbance must be positive")


@dataclass(frozen=True, eq=False)
class KalmanEstimator:
    """The least-variance estimator of a disturbed plant, its noise following the quality.

    Adaptation of the rotation, if the model has it, moves the oscillators; the covariance keeps the
    rotation's first frequency. Raises SolverError when there is no stationary filter to start at.
    """

    model: DisturbedPlant
    noise: Noise

    def __post_init__(self) -> None:
        need_model(self.model)
        if not isinstance(self.noise, Noise):
            raise InputError(f"noise must be a Noise, not {type(self.noise).__name__}")

    @cached_property
    def Q(self) -> RealArray:
        """Covariance (seen, seen) of what drives the state in a sample."""
        model, noise = self.model, self.noise
        plant = np.outer(model.plant.B[:, 0], model.plant.B[:, 0]) * noise.known**2
        turning = np.eye(2 * len(model.rotation.harmonics)) * noise.disturbance**2
        parts = [plant, turning]
        if model.colour is not None:
            parts.append(model.colour.B @ model.colour.B.T)
        covariance: RealArray = block_diag(*parts)
        return covariance

    @cached_property
    def stationary(self) -> RealArray:
        """Covariance (seen, seen) of the prediction when all of a long record was good."""
        n, r = self.model.seen, self.noise.measurement
        # In units of the states' own size and of the noise: the equation's solver needs it.
        A, scale = balanced(self.model.A[:n, :n])
        C = self.model.C[:n] * scale / r
        Q = self.Q / np.outer(scale, scale)
        size = max(float(np.linalg.norm(Q, 2)), np.finfo(float).tiny)
        try:
            P = size * _doubled(A, np.outer(C, C) * size, Q / size)
        except np.linalg.LinAlgError as fault:
            raise SolverError(f"no stationary Kalman filter: {fault}") from fault
        M = P @ C / (C @ P @ C + 1.0)
        residual = A @ (P - np.outer(M, C @ P)) @ A.T + Q - P
        if not abs(residual).max() <= SOLVED * abs(P).max():
            worst = abs(residual).max() / abs(P).max()
            raise SolverError(f"the stationary covariance has the relative residual {worst:.2g}")
        found: RealArray = P * np.outer(scale, scale)
        return found

    @cached_property
    def settled(self) -> Estimator:
        """The estimator of constant gain that this one is on a long good record."""
        C, P = self.model.C[: self.model.seen], self.stationary
        return Estimator(self.model, P @ C / (C @ P @ C + self.noise.measurement**2))

    @cached_property
    def controller(self) -> Controller:
        """The streaming filter: `estimator.MEASURED` -> outputs (z,), disturbance, frequency [Hz].

        Starts with the stationary covariance. A quality outside 0 to 1 makes its outputs NaN.
        """
        model, m, n = self.model, self.model.seen, len(self.model.A)
        gain = np.zeros(n)
        gain[:m] = self.settled.gain
        # state: x^, room for the next x^, frequency; gain; rests; P; room for A P.
        state = np.zeros(3 * n + 2 + 2 * m * m)
        state[2 * n] = model.rotation.frequency
        state[2 * n + 1 : 3 * n + 1] = gain
        state[3 * n + 1] = 1.0
        state[3 * n + 2 : 3 * n + 2 + m * m] = self.stationary.ravel()
        own = np.array([self.noise.measurement**2, self.noise.defect**2])
        parameters: list[RealArray] = [
            layout(model, gain),
            own,
            self.Q.ravel(),
            _entries(model.A[:m, :m]),
        ]
        outputs = len(model.Z) + 2
        return Controller(_step, state, np.concatenate(parameters), outputs, 3, model.period)


def _doubled(A: RealArray, G: RealArray, Q: RealArray) -> RealArray:
    """P = A P (I + G P)^-1 A^T + Q, its solution with all of A that is left decaying.

    Structure-preserving doubling: each step is as long as all before it. Undamped oscillators put
    the equation's eigenvalues next to the unit circle, where sorting them by Schur's form may fail.
    (E. Chu, H. Fan, W. Lin, C. Wang, Int. J. Control 77, 767-788, 2004.)
    """
    A, P, one = A.T, Q, np.eye(len(A))
    for _ in range(DOUBLINGS):
        right = np.linalg.solve(one + G @ P, A)
        step = A.T @ P @ right
        G = G + A @ np.linalg.solve(one + G @ P, G) @ A.T
        A = A @ right
        P, G = P + (step + step.T) / 2, (G + G.T) / 2
        if abs(step).max() <= np.finfo(float).eps * abs(P).max():
            break
    return P


def _entries(A: RealArray) -> RealArray:
    """Of each row of A (m, m) how many entries are not zero and in which columns (m (m + 1),)."""
    rows = np.zeros((len(A), len(A) + 1))
    for row, entries in zip(rows, A, strict=True):
        columns = np.flatnonzero(entries)
        row[0] = len(columns)
        row[1 : len(columns) + 1] = columns
    return rows.ravel()


@kernel
def _own(p: RealArray) -> int:
    """Where this filter's own parameters start: r^2, d^2, Q, entries of A."""
    n, z, h = int(p[0]), int(p[1]), int(p[3])
    return HEADER + h + (3 + z) * n + n * n


@kernel
def _step(
    state: RealArray, parameters: RealArray, measurement: RealArray, output: RealArray
) -> None:
    quality, n = measurement[2], int(parameters[0])
    gain = state[2 * n + 1 : 3 * n + 1]
    moving = quality != 1.0 or state[3 * n + 1] == 0.0
    if moving:
        change = _weigh(state, parameters, quality, gain)
        state[3 * n + 1] = 1.0 if quality == 1.0 and change < SETTLED else 0.0
    error = surprise(state, parameters, measurement[0])
    correct(state, parameters, error, gain)
    tell(state, parameters, quality, output)
    predict(state, parameters, measurement[1])
    if moving:
        _spread(state, parameters, gain)


@kernel
def _weigh(state: RealArray, p: RealArray, quality: float, gain: RealArray) -> float:
    """Set the gain M of a quality; its largest change relative to its own size."""
    n, h, m = int(p[0]), int(p[3]), int(p[4])
    at_c, at_p, own = HEADER + h + 2 * n, 3 * n + 2, _own(p)
    shown = state[at_p + m * m : at_p + m * m + m]
    total = 0.0
    for i in range(m):
        shown[i] = 0.0
        for j in range(m):
            shown[i] += state[at_p + i * m + j] * p[at_c + j]
        total += p[at_c + i] * shown[i]
    if not quality > 0.0:
        gain[:] = 0.0
        return 1.0
    total += p[own] + p[own + 1] * (1.0 / (quality * quality) - 1.0)
    change = 0.0
    for i in range(m):
        new = shown[i] / total
        change = max(change, abs(new - gain[i]) / max(abs(new), 1e-300))
        gain[i] = new
    return change


@kernel
def _spread(state: RealArray, p: RealArray, gain: RealArray) -> None:
    """P := A (P - M C P) A' + Q of the states that are seen; C P as `_weigh` left it."""
    n, z, h, m = int(p[0]), int(p[1]), int(p[3]), int(p[4])
    at_a, at_q, at_p = HEADER + h + (3 + z) * n, _own(p) + 2, 3 * n + 2
    A = p[at_a : at_a + n * n].reshape(n, n)
    Q = p[at_q : at_q + m * m].reshape(m, m)
    entries = p[at_q + m * m : at_q + m * (2 * m + 1)].reshape(m, m + 1)
    P = state[at_p : at_p + m * m].reshape(m, m)
    moved = state[at_p + m * m : at_p + 2 * m * m].reshape(m, m)
    for i in range(m):
        for j in range(m):
            P[i, j] -= gain[i] * moved[0, j]
    for i in range(m):
        moved[i] = 0.0
        for e in range(int(entries[i, 0])):
            k = int(entries[i, 1 + e])
            factor = A[i, k]
            for j in range(m):
                moved[i, j] += factor * P[k, j]
    for j in range(m):
        count = int(entries[j, 0])
        for i in range(j + 1):
            total = Q[i, j]
            for e in range(count):
                k = int(entries[j, 1 + e])
                total += moved[i, k] * A[j, k]
            P[i, j] = P[j, i] = total
