"""State-space models in innovations form, with their predictions and simulations of a record.

    x(t+1) = A x + B u + K e,    y = C x + D u + e,    e white

Time is discrete. u and y are deviations from offsets, and each input may have a delay in samples.
Source: L. Ljung, System Identification, 2nd ed., 1999, sections 4.3 and 16.4.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.identification.innovations.recursions import observability, predictions

STATE_SAMPLES = 300
"""Largest number of samples from which an initial state is estimated."""


@dataclass(frozen=True, eq=False)
class InnovationsModel:
    """Innovations model: A (n, n), B (n, nu), C (ny, n), D (ny, nu), K (n, ny).

    Unlike a `StateSpace`, it also has the gain of the innovations, the offsets and the delays.

    The offsets (nu,) and (ny,) are subtracted from u and y. ``delay_samples`` [samples] (nu,) is
    the delay of each input; empty if there are no delays. ``dt`` [s] and the names and units of the
    channels are those of the record. ``members`` are the averaged models, if this model is an
    average: its runs are then the means of their runs, each with its own initial state. The last
    ``resting`` states start every run at zero, because a few samples do not distinguish them from
    the others.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import InnovationsModel
    >>> one = np.ones((1, 1))
    >>> model = InnovationsModel(0.5 * one, one, one, 0 * one, 0.2 * one, np.zeros(1), np.zeros(1))
    >>> model.order, model.radius, round(model.predictor_radius, 6)
    (1, 0.5, 0.3)
    """

    A: RealArray
    B: RealArray
    C: RealArray
    D: RealArray
    K: RealArray
    u_offset: RealArray
    y_offset: RealArray
    delay_samples: tuple[int, ...] = field(default=(), kw_only=True)
    dt: float = field(default=1.0, kw_only=True)
    inputs: tuple[str, ...] = field(default=(), kw_only=True)
    outputs: tuple[str, ...] = field(default=(), kw_only=True)
    input_units: tuple[str, ...] = field(default=(), kw_only=True)
    output_units: tuple[str, ...] = field(default=(), kw_only=True)
    members: tuple[InnovationsModel, ...] = field(default=(), kw_only=True)
    resting: int = field(default=0, kw_only=True)

    @property
    def order(self) -> int:
        """Number of states, without the states of input delays."""
        return len(self.A)

    @property
    def radius(self) -> float:
        """Spectral radius of A; the model is stable if it is below 1."""
        return float(np.max(np.abs(np.linalg.eigvals(self.A)), initial=0.0))

    @property
    def predictor_radius(self) -> float:
        """Spectral radius of A - K C; the one-step predictor is stable if it is below 1."""
        return float(np.max(np.abs(np.linalg.eigvals(self.A - self.K @ self.C)), initial=0.0))

    @property
    def lti(self) -> StateSpace:
        """As `system`."""
        return self.system()

    def system(self) -> StateSpace:
        """System from u to y, at the record's sampling time, with the names of its channels.

        A delayed input has one state for each sample of its delay.
        """
        import control

        A, B, C, D = self.A, self.B, self.C, self.D
        delays = self.delay_samples or (0,) * B.shape[1]
        chains = [np.eye(delay, k=-1) for delay in delays]
        count = sum(delays)
        enters, leaves = np.zeros((count, B.shape[1])), np.zeros((B.shape[1], count))
        end, now = 0, np.eye(B.shape[1])
        for j, delay in enumerate(delays):
            if delay:
                enters[end, j], leaves[j, end + delay - 1], now[j, j] = 1.0, 1.0, 0.0
                end += delay
        chain = block_diag(*chains) if count else np.zeros((0, 0))
        names = {
            **({"inputs": list(self.inputs)} if self.inputs else {}),
            **({"outputs": list(self.outputs)} if self.outputs else {}),
        }
        return control.ss(
            np.block([[A, B @ leaves], [np.zeros((count, len(A))), chain]]),
            np.vstack([B @ now, enters]),
            np.hstack([C, D @ leaves]),
            D @ now,
            self.dt,
            **names,
        )

    def response(self, cycles_per_sample: ArrayLike) -> ComplexArray:
        """Response (F, ny, nu) from u to y at frequencies (F,) [cycles/sample]."""
        z = np.exp(2j * np.pi * np.asarray(cycles_per_sample, dtype=float))[:, None, None]
        states = np.linalg.solve(z * np.eye(self.order) - self.A, self.B + 0j * z)
        found = np.asarray(self.C @ states + self.D, dtype=complex)
        return (
            found * z ** -np.asarray(self.delay_samples, dtype=float)
            if self.delay_samples
            else found
        )

    def one_step(self, u: RealArray, y: RealArray, washout: int) -> RealArray:
        """One-step predictions (N, ny) of y from a record u (N, nu), y (N, ny).

        The initial state is the one that predicts the first `washout` samples best, of those whose
        delayed inputs are in the record. Missing samples (NaN) of y are predicted too.
        """
        if self.members:
            return np.asarray(np.mean([m.one_step(u, y, washout) for m in self.members], axis=0))
        return self._run(self.K, u, y, washout)

    def free_run(self, u: RealArray, y: RealArray, washout: int) -> RealArray:
        """Simulation (N, ny) of y from u (N, nu) alone.

        Only the initial state is computed from the first `washout` samples of y.
        """
        if self.members:
            return np.asarray(np.mean([m.free_run(u, y, washout) for m in self.members], axis=0))
        return self._run(np.zeros_like(self.K), u, y, washout)

    def _run(self, K: RealArray, u: RealArray, y: RealArray, washout: int) -> RealArray:
        """Predictions with a gain K, from the initial state that fits y best.

        The first samples, whose inputs were before the record, have an initial state of their own.
        """
        drive, measured = self.acting_inputs(u) - self.u_offset, y - self.y_offset
        late = self.longest_delay_samples
        found = np.empty(measured.shape)
        ends = late, max(washout, late + 1)
        for part, end in zip((slice(0, late), slice(late, None)), ends, strict=True):
            if len(drive[part]):
                seen = slice(part.start, end)
                x0 = initial_state(self, K, drive[seen], measured[seen])
                found[part] = predictions(*self.matrices(K), x0, drive[part], measured[part])
        return np.asarray(found + self.y_offset)

    @property
    def longest_delay_samples(self) -> int:
        """The longest delay of an input [samples]."""
        return max(self.delay_samples, default=0)

    def driven_part(self, u: RealArray, y: RealArray) -> tuple[RealArray, RealArray]:
        """Inputs that act, and outputs, of the samples whose inputs are all in the record."""
        late = self.longest_delay_samples
        return self.acting_inputs(u)[late:], np.ascontiguousarray(y[late:], dtype=float)

    def matrices(self, K: RealArray) -> tuple[RealArray, ...]:
        """A, B, C, D and another gain K, in the form for compiled code."""
        own = (self.A, self.B, self.C, self.D, K)
        return tuple(np.ascontiguousarray(matrix, dtype=float) for matrix in own)

    def acting_inputs(self, u: RealArray) -> RealArray:
        """Inputs (N, nu) that act at each sample.

        Before the record they equal their first sample.
        """
        if not any(self.delay_samples):
            return np.ascontiguousarray(u, dtype=float)
        now = np.arange(len(u))
        late = [u[np.maximum(now - delay, 0), j] for j, delay in enumerate(self.delay_samples)]
        return np.column_stack(late)


def initial_state(model: InnovationsModel, K: RealArray, u: RealArray, y: RealArray) -> RealArray:
    """Initial state (n,) for which predictions with a gain K fit y (N, ny) best.

    u (N, nu) and y are deviations from the model's offsets. Resting states are zero.
    """
    u, y = np.ascontiguousarray(u[:STATE_SAMPLES]), np.ascontiguousarray(y[:STATE_SAMPLES])
    matrices = model.matrices(K)
    closed = np.ascontiguousarray(model.A - K @ model.C)
    left = (y - predictions(*matrices, np.zeros(model.order), u, y)).ravel()
    rows = observability(closed, matrices[2], len(y)).reshape(len(left), model.order)
    seen = np.isfinite(left) & np.isfinite(rows).all(axis=1)
    moving = model.order - model.resting
    state = np.zeros(model.order)
    state[:moving] = np.linalg.lstsq(rows[seen, :moving], left[seen], rcond=None)[0]
    return state
