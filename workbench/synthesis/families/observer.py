"""Observer-based controllers: a model of the plant with static gains."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError, schur, solve_continuous_are

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError, SolverError
from workbench.synthesis.families.family import Family, need_size
from workbench.synthesis.families.matrices import matrix_slopes
from workbench.systems.bilinear import bilinear_continuous
from workbench.systems.conversion import as_system
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import Matrices, matrices_of, realisation

MEMBER_TOLERANCE = 1e-6
"""Relative distance of matrices, or of responses, within which a controller is a member."""
WEIGHTS = (1.0, 1e-2, 1e2)
"""Weights of the control and of the noise in examples, in units of the model's signals."""
ZERO_WEIGHT = 1e-8
"""Weight of all states, and of noise on all states, with which the Riccati equations have a
solution.
"""
MOST_CONDITION = 1e8
"""Largest condition number of a change of coordinates that is trusted."""


@dataclass(frozen=True, eq=False)
class ObserverForm(Family):
    """A controller that estimates the states of a model and feeds them back by constant gains.

        x' = A x + B u + L (y - C x - D u),    u = F x,

    with a ``model`` A, B, C, D of n states from the controls to the measurements. Feedback is
    positive, so A + B F should be stable. The parameters are F (controls, n) and L (n,
    measurements), row by row. The model may be unstable. Every strictly proper controller with n
    states has this form, in suitable states (D. Alazard, P. Apkarian, Exact observer-based
    structures for arbitrary compensators, Int. J. Robust and Nonlinear Control 9 (1999) 101-118). A
    sampled model is transformed by s = (2 / T) (z - 1) / (z + 1).

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import ObserverForm
    >>> family = ObserverForm(control.ss([[1.0]], [[1.0]], [[1.0]], 0))
    >>> family.system([-3.0, 4.0]).poles().real.tolist()  # A + B F - L C
    [-6.0]
    """

    model: StateSpace

    def __init__(self, model: Any) -> None:
        system = as_system(model, "model")
        system = bilinear_continuous(system) if system.dt else system
        if not system.nstates:
            raise InputError("model has no states, so an observer has nothing to estimate")
        if not all(np.isfinite(part).all() for part in matrices_of(system)):
            raise InputError("model has entries that are not finite")
        object.__setattr__(self, "model", system)

    def __repr__(self) -> str:
        return f"ObserverForm(a model of {self.model.nstates} states)"

    @property
    def count(self) -> int:
        n, m, p = self._sizes
        return n * (m + p)

    @property
    def _sizes(self) -> tuple[int, int, int]:
        return self.model.nstates, self.model.ninputs, self.model.noutputs

    def sized(self, inputs: int, outputs: int) -> ObserverForm:
        _, m, p = self._sizes
        do = "the model must be that from the controls to the measurements"
        need_size(self, (p, m), inputs, outputs, do)
        return self

    def gains(self, x: RealArray) -> tuple[RealArray, RealArray]:
        """Gains F (controls, n) and L (n, measurements) from the parameters x."""
        n, m, p = self._sizes
        F, L = np.split(np.asarray(x, dtype=float), [m * n])
        return F.reshape(m, n), L.reshape(n, p)

    def system(self, x: RealArray) -> StateSpace:
        return realisation(self._matrices(*self.gains(x)), 0.0)

    def response(self, x: RealArray, omega: RealArray) -> tuple[ComplexArray, ComplexArray]:
        _, B, C, D = matrices_of(self.model)
        n, m, p = self._sizes
        F, L = self.gains(x)
        k = m * n
        dA, dB = np.zeros((len(x), n, n)), np.zeros((len(x), n, p))
        dC, dD = np.zeros((len(x), m, n)), np.zeros((len(x), m, p))
        for place in range(k):
            i, j = divmod(place, n)
            dC[place, i, j] = 1.0
            dA[place, :, j] = (B - L @ D)[:, i]
        for place in range(k, len(x)):
            i, j = divmod(place - k, p)
            dB[place, i, j] = 1.0
            dA[place, i] = -(C + D @ F)[j]
        return matrix_slopes(self._matrices(F, L), (dA, dB, dC, dD), omega)

    def parameters(self, controller: StateSpace) -> RealArray:
        n, m, p = self._sizes
        has = controller.nstates, controller.ninputs, controller.noutputs
        if has != (n, p, m) or controller.dt:
            raise InputError(
                f"the controller has {has[0]} states, {has[1]} inputs and {has[2]} outputs; a "
                f"member of {self} has {n}, {p} and {m}, in continuous time"
            )
        if np.abs(controller.D).max(initial=0.0) > 0:
            raise InputError("the controller has a direct term; an observer has none")
        A, B, C, _ = matrices_of(controller)
        own = self._matrices(C, B)[0]
        if np.abs(own - A).max() <= MEMBER_TOLERANCE * np.abs(own).max():
            return np.concatenate([C.ravel(), B.ravel()])
        for T in self._coordinate_changes(A, B, C):
            if np.linalg.cond(T) > MOST_CONDITION:
                continue
            F, L = C @ T, np.asarray(np.linalg.solve(T, B), dtype=float)
            if self._is_same_response(controller, F, L):
                return np.concatenate([F.ravel(), L.ravel()])
        raise InputError(
            f"the controller is no member of {self}: no change of its states gives it that form"
        )

    def examples(self, omega: float, gain: float) -> Sequence[StateSpace]:
        """LQG controllers for several sizes of the control weight and of the noise."""
        return [self.system(x) for x in self._quadratic]

    def nearest(
        self, controller: StateSpace, omega: RealArray, weight: RealArray
    ) -> StateSpace | None:
        """The controller itself without its direct term, if it has as many states as the model."""
        if controller.nstates == self.model.nstates:
            A, B, C, D = matrices_of(controller)
            try:
                return self.system(self.parameters(realisation((A, B, C, 0.0 * D), 0.0)))
            except InputError:
                pass
        return super().nearest(controller, omega, weight)

    @cached_property
    def _quadratic(self) -> list[RealArray]:
        """Parameters of LQG controllers; raises SolverError if none stabilises the model."""
        A, B, C, _ = matrices_of(self.model)
        found = []
        size = float(np.linalg.norm(A, 2)) or 1.0
        for share in WEIGHTS:
            try:
                F = -_regulator(A / size, B, C, share) * size
                L = _regulator((A / size).T, C.T, B.T, share).T * size
            except (LinAlgError, ValueError):
                continue
            found.append(np.concatenate([F.ravel(), L.ravel()]))
        if not found:
            raise SolverError(
                "no observer-based controller stabilises the model: a mode is unstable that the "
                "controls do not reach, or that the measurements do not show"
            )
        return found

    def _matrices(self, F: RealArray, L: RealArray) -> Matrices:
        A, B, C, D = matrices_of(self.model)
        none = np.zeros((len(F), L.shape[1]))
        return A + B @ F - L @ (C + D @ F), L, F, none

    def _coordinate_changes(self, A: RealArray, B: RealArray, C: RealArray) -> Iterator[RealArray]:
        """Changes of coordinates T of the controller's states, with F = C T and L = inv(T) B.

        [I; T] spans an invariant subspace of the loop of model and controller. The poles of this
        subspace are those of the state feedback: the right, the left, the slow or the fast half of
        the loop's poles.
        """
        n = self.model.nstates
        G, H, K, D = matrices_of(self.model)
        loop = np.block([[G, H @ C], [B @ K, A + B @ D @ C]])
        poles = np.linalg.eigvals(loop)
        orders = np.sort(poles.real)
        middle = (orders[n - 1] + orders[n]) / 2
        sizes = np.sort(np.abs(poles))
        size = (sizes[n - 1] + sizes[n]) / 2
        rules: list[Any] = [
            lambda re, im: re > middle,
            lambda re, im: np.hypot(re, im) < size,
            lambda re, im: re < middle,
            lambda re, im: np.hypot(re, im) > size,
        ]
        for rule in rules:
            _, U, count = schur(loop, sort=rule)
            if count in (n, n - 1, n + 1) and np.linalg.cond(U[:n, :n]) < MOST_CONDITION:
                yield np.linalg.solve(U[:n, :n].T, U[n:, :n].T).T

    def _is_same_response(self, controller: StateSpace, F: RealArray, L: RealArray) -> bool:
        """Whether the observer with these gains has the controller's response."""
        omega = np.abs(controller.poles())
        omega = np.geomspace(0.1, 10.0, 5)[:, None] * np.where(omega > 0, omega, 1.0)
        omega = omega.ravel() * 1.0123
        wanted = response(controller, omega)
        own = response(realisation(self._matrices(F, L), 0.0), omega)
        return bool(np.abs(own - wanted).max() <= MEMBER_TOLERANCE * np.abs(wanted).max())


def _regulator(A: RealArray, B: RealArray, C: RealArray, share: float) -> RealArray:
    """The gain of the quadratic regulator whose cost is the outputs, with a small weight on all
    states.
    """
    scale = float(np.linalg.norm(B, 2)) or 1.0
    seen = C / (float(np.linalg.norm(C, 2)) or 1.0)
    Q, b = seen.T @ seen + ZERO_WEIGHT * np.eye(len(A)), B / scale
    X = solve_continuous_are(A, b, Q, share * np.eye(b.shape[1]))
    found: RealArray = b.T @ X / share / scale
    return found
