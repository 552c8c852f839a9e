"""Kalman filters whose measurement noise follows the quality of the measurement.

    R(w) = r^2 + d^2 (1/w^2 - 1)

w is the quality, r the standard deviation of the white noise of a good measurement, and d the error
that a bad one may have. At quality 0 the measurement is not used. The covariance P of the
prediction x^,

    S = C P C' + R(w),   M = P C' / S,   P := A (P - M C P) A' + Q        (Kalman, 1960)

is updated at every sample, because the gain must grow while no measurement is used and fall again
afterwards. The update stops once the gain has settled; with nine states a sample then takes a third
of the time.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np
from scipy.linalg import block_diag

from workbench._core.arrays import RealArray
from workbench._core.compiled import inlined, kernel
from workbench.diagnosis.estimators.disturbed import DisturbedPlant, need_model
from workbench.diagnosis.estimators.estimator import Estimator
from workbench.diagnosis.estimators.observers import balanced_matrix
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

SETTLED_GAIN_CHANGE = 1e-9
"""The covariance stays fixed once the gain changes by less than this fraction in a sample."""
MOST_DOUBLINGS = 60
"""Largest number of doublings of the horizon; a stationary covariance needs far fewer."""
COVARIANCE_RESIDUAL = 1e-6
"""Largest relative residual of the stationary covariance in its equation."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations of white noises at each sample.

    known        noise on the input u of the plant, in the unit of u;
    disturbance  steps of every oscillator state, in the unit of the disturbance;
    measurement  r, noise of y at quality 1, in the unit of y; coloured noise is in the model;
    defect       d, in the unit of y; a quality w adds the noise d sqrt(1/w^2 - 1) to y.

    Raises InputError unless all are finite and not negative, measurement and disturbance positive.

    Examples
    --------
    >>> from workbench.diagnosis import Noise
    >>> Noise(known=0.0, disturbance=1e-3, measurement=1e-2, defect=1.0).defect
    1.0
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
    """The estimator with the least variance, its measurement noise given by the quality.

    If the model adapts the rotation, the oscillators follow its frequency; the covariance is
    computed for the first frequency. Raises SolverError if there is no stationary filter to start
    from.

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import DisturbedPlant, KalmanEstimator, Noise, Rotation
    >>> from workbench.simulation import sampled_model
    >>> A, B = [[0.0, 1.0], [-400.0, -25.0]], [[0.0, 0.0], [400.0, 400.0]]
    >>> lens = control.ss(A, B, [[1.0, 0.0]], 0.0)
    >>> model = DisturbedPlant(sampled_model(lens, 1e-3), Rotation(frequency_hz=5.0))
    >>> estimator = KalmanEstimator(model, Noise(0.0, 1e-3, 1e-2, 1.0))
    >>> bool(abs(estimator.settled.poles()).max() < 1)
    True
    """

    model: DisturbedPlant
    noise: Noise

    def __post_init__(self) -> None:
        need_model(self.model)
        if not isinstance(self.noise, Noise):
            raise InputError(f"noise must be a Noise, not {type(self.noise).__name__}")

    @cached_property
    def Q(self) -> RealArray:
        """Covariance (seen, seen) of the noise that enters the state in a sample."""
        model, noise = self.model, self.noise
        plant = np.outer(model.plant.B[:, 0], model.plant.B[:, 0]) * noise.known**2
        turning = np.eye(2 * len(model.rotation.harmonics)) * noise.disturbance**2
        parts = [plant, turning]
        if model.colour is not None:
            parts.append(model.colour.B @ model.colour.B.T)
        covariance: RealArray = block_diag(*parts)
        return covariance

    @cached_property
    def stationary_covariance(self) -> RealArray:
        """Covariance (seen, seen) of the prediction after a long record of quality 1."""
        n, r = self.model.seen, self.noise.measurement
        # The solver of the equation needs states scaled to one size, and y in units of its noise.
        A, scale = balanced_matrix(self.model.A[:n, :n])
        C = self.model.C[:n] * scale / r
        Q = self.Q / np.outer(scale, scale)
        size = max(float(np.linalg.norm(Q, 2)), np.finfo(float).tiny)
        try:
            P = size * _riccati_by_doubling(A, np.outer(C, C) * size, Q / size)
        except np.linalg.LinAlgError as fault:
            raise SolverError(f"no stationary Kalman filter: {fault}") from fault
        M = P @ C / (C @ P @ C + 1.0)
        residual = A @ (P - np.outer(M, C @ P)) @ A.T + Q - P
        if not abs(residual).max() <= COVARIANCE_RESIDUAL * abs(P).max():
            worst = abs(residual).max() / abs(P).max()
            raise SolverError(f"the stationary covariance has the relative residual {worst:.2g}")
        found: RealArray = P * np.outer(scale, scale)
        return found

    @cached_property
    def steady_state(self) -> Estimator:
        """The estimator of constant gain that this one approaches on a long record of quality 1."""
        C, P = self.model.C[: self.model.seen], self.stationary_covariance
        return Estimator(self.model, P @ C / (C @ P @ C + self.noise.measurement**2))

    @cached_property
    def controller(self) -> Controller:
        """The streaming filter: `estimator.MEASURED` to outputs (z,), disturbance, frequency [Hz].

        It starts with the stationary covariance. A quality outside 0 to 1 makes its outputs NaN.
        """
        model, m, n = self.model, self.model.seen, len(self.model.A)
        gain = np.zeros(n)
        gain[:m] = self.steady_state.gain
        # state: x^, work space for the next x^, frequency; gain; whether it has settled; P; work
        # space for A P.
        state = np.zeros(3 * n + 2 + 2 * m * m)
        state[2 * n] = model.rotation.frequency_hz
        state[2 * n + 1 : 3 * n + 1] = gain
        state[3 * n + 1] = 1.0
        state[3 * n + 2 : 3 * n + 2 + m * m] = self.stationary_covariance.ravel()
        own = np.array([self.noise.measurement**2, self.noise.defect**2])
        parameters: list[RealArray] = [
            layout(model, gain),
            own,
            self.Q.ravel(),
            _entries(model.A[:m, :m]),
        ]
        outputs = len(model.Z) + 2
        return Controller(
            _step, state, np.concatenate(parameters), outputs=outputs, reads=3, dt=model.dt
        )


def _riccati_by_doubling(A: RealArray, G: RealArray, Q: RealArray) -> RealArray:
    """The stabilising solution of P = A P (I + G P)^-1 A^T + Q, by structure-preserving doubling.

    Each step doubles the horizon. A method that sorts the equation's eigenvalues by Schur's form
    may fail here, because undamped oscillators put them next to the unit circle. (E. Chu, H. Fan,
    W. Lin, C. Wang, Int. J. Control 77, 767-788, 2004.)
    """
    A, P, one = A.T, Q, np.eye(len(A))
    for _ in range(MOST_DOUBLINGS):
        right = np.linalg.solve(one + G @ P, A)
        step = A.T @ P @ right
        G = G + A @ np.linalg.solve(one + G @ P, G) @ A.T
        A = A @ right
        P, G = P + (step + step.T) / 2, (G + G.T) / 2
        if abs(step).max() <= np.finfo(float).eps * abs(P).max():
            break
    return P


def _entries(A: RealArray) -> RealArray:
    """For each row of A (m, m), the number and the columns of its nonzero entries: (m (m + 1),)."""
    rows = np.zeros((len(A), len(A) + 1))
    for row, entries in zip(rows, A, strict=True):
        columns = np.flatnonzero(entries)
        row[0] = len(columns)
        row[1 : len(columns) + 1] = columns
    return rows.ravel()


@inlined
def _own_parameters_start(p: RealArray) -> int:
    """Index at which this filter's own parameters start: r^2, d^2, Q, entries of A."""
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
        change = _set_gain(state, parameters, quality, gain)
        state[3 * n + 1] = 1.0 if quality == 1.0 and change < SETTLED_GAIN_CHANGE else 0.0
    error = surprise(state, parameters, measurement[0])
    correct(state, parameters, error, gain)
    tell(state, parameters, quality, output)
    predict(state, parameters, measurement[1])
    if moving:
        _advance_covariance(state, parameters, gain)


@inlined
def _set_gain(state: RealArray, p: RealArray, quality: float, gain: RealArray) -> float:
    """Set the gain M for a quality, and return its largest relative change."""
    n, h, m = int(p[0]), int(p[3]), int(p[4])
    at_c, at_p, own = HEADER + h + 2 * n, 3 * n + 2, _own_parameters_start(p)
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


@inlined
def _advance_covariance(state: RealArray, p: RealArray, gain: RealArray) -> None:
    """Set P := A (P - M C P) A' + Q for the states that are seen; `_set_gain` has left C P."""
    n, z, h, m = int(p[0]), int(p[1]), int(p[3]), int(p[4])
    at_a, at_q, at_p = HEADER + h + (3 + z) * n, _own_parameters_start(p) + 2, 3 * n + 2
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
