"""Prediction-error refinement of innovations models, with exact gradients.

The criterion is, up to constants, a negative log likelihood with unknown noise covariance,

    N/2 log det(sum e e'/N) + w N/2 log det(sum s s'/N),

of the one-step errors e and, weighted by w, of the free-run errors s. With w = 0 it gives the
classical maximum-likelihood estimate, which is best for prediction. Real records are never quite
linear, and with one-step errors alone slow errors of the plant model are then modelled as noise;
w > 0 requires that the same model also simulates the whole record. Free-run errors are correlated
over many samples, so that tens of them carry as much information as one independent error.
Therefore w = 0.1 weights both kinds about equally, and w = 1 favours simulation.

Source: L. Ljung, System Identification, 2nd ed., 1999, sections 7.2, 10.2 and 15.2.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from workbench.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.experiments.quality import checked_record
from workbench.identification.state_space.innovations import (
    InnovationsModel,
    initial_state,
)

MIN_LIKELIHOOD_GAIN = 1.0
"""Gain in log likelihood below which an iteration is the last: Akaike's penalty for one parameter.

Iterations that gain less fit the noise of this record.
"""


def refine(
    model: InnovationsModel,
    u: RealArray,
    y: RealArray,
    simulation_weight: float = 0.1,
    iterations: int = 100,
) -> tuple[InnovationsModel, int]:
    """Refine a stable model on a record u (N, nu), y (N, ny) by Levenberg-Marquardt iterations.

    All entries of A, B, C, D, K and the initial states are free. Directions that only change the
    basis of the state have no effect on the criterion, and the damping keeps them unchanged. Steps
    are refused if they make the model or its predictor unstable or give a time constant longer than
    the record.

    Returns
    -------
    The refined model and the number of iterations.

    Raises
    ------
    InputError
        The same as for `checked_record`; the starting model or its predictor is unstable.
    """
    u, y = checked_record(u, y)
    slowest = 1 - 1 / len(u)
    if max(model.radius, model.predictor_radius) >= slowest:
        raise InputError("the model to start from or its predictor is unstable; lower the order")
    criterion = Criterion(model, u - model.u_offset, y - model.y_offset, simulation_weight)
    theta = criterion.start(model)
    value, gradient, hessian = criterion.expand(theta)
    damping, done = 1e-2, 0
    while done < iterations:
        # Scale to a unit diagonal, so that the step does not depend on the units of the signals.
        scale = np.sqrt(np.diag(hessian)) + 1e-300
        unit = hessian / np.outer(scale, scale)
        decrease = 0.0
        while damping < 1e10:
            damped = unit + (damping + 1e-9) * np.eye(len(unit))
            trial = theta - np.linalg.solve(damped, gradient / scale) / scale
            candidate = criterion.model(trial)
            if max(candidate.radius, candidate.predictor_radius) < slowest:
                decrease = value - criterion(trial)
                if decrease > 0:
                    break
            damping *= 4
        if decrease <= 0:
            break
        theta, damping, done = trial, max(damping / 5, 1e-8), done + 1
        if decrease < MIN_LIKELIHOOD_GAIN:
            break
        value, gradient, hessian = criterion.expand(theta)
    return criterion.model(theta), done


class Criterion:
    """The criterion as a function of all entries of A, B, C, D, K and the initial states.

    u (N, nu) and y (N, ny) are deviations from the model's offsets.
    """

    def __init__(
        self, model: InnovationsModel, u: RealArray, y: RealArray, simulation_weight: float
    ) -> None:
        self._template, self._u, self._y = model, u, y
        self._weights = (1.0, simulation_weight) if simulation_weight > 0 else (1.0,)
        matrices = (model.A, model.B, model.C, model.D, model.K)
        self._shapes = [matrix.shape for matrix in matrices]
        self._ends = np.cumsum([0] + [matrix.size for matrix in matrices])

    def start(self, model: InnovationsModel) -> RealArray:
        """Parameters (P,) of a model, with the initial states that fit the record best."""
        A, B, C, D, K = model.A, model.B, model.C, model.D, model.K
        ny = len(C)
        predictor = (A - K @ C, np.hstack([B - K @ D, K]), C, np.hstack([D, np.zeros((ny, ny))]))
        states = [
            initial_state(predictor, np.hstack([self._u, self._y]), self._y),
            initial_state((A, B, C, D), self._u, self._y),
        ]
        parts = [A, B, C, D, K, *states[: len(self._weights)]]
        return np.concatenate([part.ravel() for part in parts])

    def model(self, theta: RealArray) -> InnovationsModel:
        """Model with given parameters (P,)."""
        A, B, C, D, K = (
            theta[a:b].reshape(shape)
            for (a, b), shape in zip(pairwise(self._ends), self._shapes, strict=True)
        )
        return replace(self._template, A=A, B=B, C=C, D=D, K=K)

    def __call__(self, theta: RealArray) -> float:
        """Value of the criterion; infinite where the errors overflow."""
        with np.errstate(all="ignore"):
            value = sum(
                weight * _log_likelihood(self._recursion(theta, run)[1])
                for run, weight in enumerate(self._weights)
            )
        return value if np.isfinite(value) else np.inf

    def expand(self, theta: RealArray) -> tuple[float, RealArray, RealArray]:
        """Value, gradient (P,) and Gauss-Newton Hessian (P, P) of the criterion."""
        value, gradient = 0.0, np.zeros(len(theta))
        hessian = np.zeros((len(theta), len(theta)))
        for run, weight in enumerate(self._weights):
            states, errors = self._recursion(theta, run)
            jacobian = self._jacobian(theta, run, states, errors)
            covariance = errors.T @ errors / len(errors)
            whiten = np.linalg.cholesky(weight * np.linalg.inv(covariance))
            rows = np.einsum("tip,ij->tjp", jacobian, whiten).reshape(-1, len(theta))
            value += weight * _log_likelihood(errors)
            gradient += rows.T @ (errors @ whiten).ravel()
            hessian += rows.T @ rows
        return value, gradient, hessian

    def _unpack(self, theta: RealArray, run: int) -> tuple[InnovationsModel, RealArray]:
        """Model and initial state of a run: 0 is one-step prediction, 1 is free run with K = 0."""
        model = self.model(theta)
        first = self._ends[-1] + run * model.order
        gain = np.zeros_like(model.K) if run else model.K
        return replace(model, K=gain), theta[first : first + model.order]

    def _recursion(self, theta: RealArray, run: int) -> tuple[RealArray, RealArray]:
        """States (N, n) and errors (N, ny) of a run."""
        model, x = self._unpack(theta, run)
        A, C, K = model.A, model.C, model.K
        forced, direct = self._u @ model.B.T, self._y - self._u @ model.D.T
        states, errors = np.empty((len(forced), len(x))), np.empty_like(direct)
        for t in range(len(states)):
            states[t] = x
            errors[t] = direct[t] - C @ x
            x = A @ x + forced[t] + K @ errors[t]
        return states, errors

    def _jacobian(
        self, theta: RealArray, run: int, states: RealArray, errors: RealArray
    ) -> RealArray:
        """Derivatives (N, ny, P) of the errors with respect to the parameters.

        A change of entry (i, j) of [A B K] adds signal j of (x, u, e) to state equation i; a change
        of C or D also changes the errors directly.
        """
        model, _ = self._unpack(theta, run)
        A, C, K = model.A - model.K @ model.C, model.C, model.K
        n, nu, ny, samples = len(A), self._u.shape[1], len(C), len(states)
        signals = np.hstack([states, self._u, errors])
        moved = np.zeros((n, n, signals.shape[1]))  # state, direction, signal
        seen = np.empty((samples, ny, *moved.shape[1:]))
        free = np.empty((samples, ny, n))
        row, each = C, np.arange(n)
        for t in range(samples):
            seen[t] = (C @ moved.reshape(n, -1)).reshape(ny, n, -1)
            free[t] = row
            moved = (A @ moved.reshape(n, -1)).reshape(moved.shape)
            moved[each, each] += signals[t]
            row = row @ A
        by_x, by_u, by_e = np.split(seen, [n, n + nu], axis=3)
        by_c, by_d = (np.einsum("tyij,io->tyoj", part, K) for part in (by_x, by_u))
        for o in range(ny):
            by_c[:, o, o] -= states
            by_d[:, o, o] -= self._u
        jacobian = np.zeros((samples, ny, len(theta)))
        parts = (-by_x, -by_u, by_c, by_d, 0 * by_e if run else -by_e)
        for (a, b), part in zip(pairwise(self._ends), parts, strict=True):
            jacobian[:, :, a:b] = part.reshape(samples, ny, -1)
        first = self._ends[-1] + run * n
        jacobian[:, :, first : first + n] = -free
        return jacobian


def _log_likelihood(errors: RealArray) -> float:
    """Negative log likelihood of errors (N, ny) with unknown covariance, up to a constant."""
    return 0.5 * len(errors) * float(np.linalg.slogdet(errors.T @ errors / len(errors))[1])
