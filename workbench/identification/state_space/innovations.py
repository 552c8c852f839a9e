"""State-space models in innovations form, with their predictions and simulations of a record.

    x(t+1) = A x + B u + K e,    y = C x + D u + e,    e white

Discrete time with a sampling time of one; u and y are deviations from offsets.
Source: L. Ljung, System Identification, 2nd ed., 1999, sections 4.3 and 16.4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import dlsim

from workbench.arrays import ComplexArray, RealArray
from workbench.heavy_types import StateSpace


@dataclass(frozen=True, eq=False)
class InnovationsModel:
    """Innovations model: A (n, n), B (n, nu), C (ny, n), D (ny, nu), K (n, ny).

    The offsets (nu,) and (ny,) are subtracted from u and y.
    """

    A: RealArray
    B: RealArray
    C: RealArray
    D: RealArray
    K: RealArray
    u_offset: RealArray
    y_offset: RealArray

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.A)

    @property
    def radius(self) -> float:
        """Spectral radius of A; the model is stable if it is below 1."""
        return float(np.max(np.abs(np.linalg.eigvals(self.A)), initial=0.0))

    @property
    def predictor_radius(self) -> float:
        """Spectral radius of A - K C; the one-step predictor is stable if it is below 1."""
        return float(np.max(np.abs(np.linalg.eigvals(self.A - self.K @ self.C)), initial=0.0))

    def system(self) -> StateSpace:
        """System from u to y, with a sampling time of one."""
        import control

        return control.ss(self.A, self.B, self.C, self.D, 1.0)

    def response(self, frequency: ArrayLike) -> ComplexArray:
        """Response (F, ny, nu) from u to y at frequencies (F,) [cycles/sample]."""
        z = np.exp(2j * np.pi * np.asarray(frequency, dtype=float))[:, None, None]
        states = np.linalg.solve(z * np.eye(self.order) - self.A, self.B + 0j * z)
        return np.asarray(self.C @ states + self.D, dtype=complex)

    def one_step(self, u: RealArray, y: RealArray, washout: int) -> RealArray:
        """One-step predictions (N, ny) of y from a record u (N, nu), y (N, ny).

        The initial state is the one that predicts the first `washout` samples best.
        """
        inputs = np.hstack([u - self.u_offset, y - self.y_offset])
        B = np.hstack([self.B - self.K @ self.D, self.K])
        D = np.hstack([self.D, np.zeros((len(self.C), len(self.C)))])
        return self._run(self.A - self.K @ self.C, B, D, inputs, y, washout)

    def free_run(self, u: RealArray, y: RealArray, washout: int) -> RealArray:
        """Simulation (N, ny) of y from u (N, nu) alone.

        Only the initial state is computed from the first `washout` samples of y.
        """
        return self._run(self.A, self.B, self.D, u - self.u_offset, y, washout)

    def _run(
        self,
        A: RealArray,
        B: RealArray,
        D: RealArray,
        inputs: RealArray,
        y: RealArray,
        washout: int,
    ) -> RealArray:
        """Output of a system with this model's C, from the initial state that suits y best."""
        x0 = initial_state((A, B, self.C, D), inputs[:washout], (y - self.y_offset)[:washout])
        output: RealArray = dlsim((A, B, self.C, D, 1.0), inputs, x0=x0)[1]
        return output + self.y_offset


def initial_state(
    system: tuple[RealArray, RealArray, RealArray, RealArray], u: RealArray, y: RealArray
) -> RealArray:
    """Initial state (n,) for which a system's output fits y (N, ny) best, with inputs u (N, nu)."""
    A, _, C, _ = system
    observed = np.empty((len(y), *C.shape))
    row = C
    for t in range(len(y)):
        observed[t] = row
        row = row @ A
    forced = dlsim((*system, 1.0), u)[1]
    left = (y - forced).ravel()
    state: RealArray = np.linalg.lstsq(observed.reshape(-1, len(A)), left, rcond=None)[0]
    return state
