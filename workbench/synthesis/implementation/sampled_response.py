"""Poles and response of the loop of a sampled controller and a plant with held inputs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.systems.frequency_response import response_of_scaled, with_scaled_states
from workbench.systems.generalised_plant import response
from workbench.systems.interconnection import connected, named_realisation
from workbench.systems.realisation import realisation
from workbench.systems.sampling import held_matrices, held_pieces, split_delay

SAMPLED_GRID_POINTS = 4000
"""Number of frequencies up to half the sampling rate, before those around each mode are added."""
MODE_OFFSETS = np.concatenate([-np.logspace(2, -2, 25), [0.0], np.logspace(-2, 2, 25)])
"""Distances of the added frequencies from each mode, in units of its decay rate."""
SLOWEST_MODE = 1e-9
"""Modes slower than this [rad/sample] count as integrators."""


@dataclass(frozen=True, eq=False)
class HeldPlantLoop:
    """The loop u = sign K y of a sampled controller around a plant with held inputs.

    Unlike a closed `StateSpace`, it has a continuous plant behind a hold and a delay.

    The inputs are held for `period` [s] and are delayed by `delay` samples.
    """

    plant: StateSpace
    K: StateSpace
    period: float
    delay: float
    sign: int

    def held(self, more: RealArray | None = None) -> StateSpace:
        """The sampled plant with the delays of its inputs raised by `more` (inputs,) [samples].

        All inputs share the states of the plant; each has its own states for delayed values.
        """
        return realisation(self._held(more), self.period)

    def _held(self, more: RealArray | None) -> tuple[RealArray, RealArray, RealArray, RealArray]:
        G = self.plant
        n, m = G.nstates, G.ninputs
        delays = self.delay + (np.zeros(m) if more is None else more)
        columns = [held_matrices(self._column(j), self.period, delays[j]) for j in range(m)]
        ends = n + np.cumsum([len(column[0]) - n for column in columns])
        size = int(ends[-1])
        A, B = np.zeros((size, size)), np.zeros((size, m))
        C, D = np.zeros((G.noutputs, size)), np.zeros((G.noutputs, m))
        A[:n, :n], C[:, :n] = columns[0][0][:n, :n], G.C
        for j, ((a, b, c, d), end) in enumerate(zip(columns, ends, strict=True)):
            own = slice(int(end) - len(a) + n, int(end))
            A[:n, own], A[own, own] = a[:n, n:], a[n:, n:]
            B[:n, j], B[own, j] = b[:n, 0], b[n:, 0]
            C[:, own], D[:, j] = c[:, n:], d[:, 0]
        return A, B, C, D

    def _column(self, j: int) -> tuple[RealArray, RealArray, RealArray, RealArray]:
        """A, B, C and D of the continuous plant from one of its inputs."""
        G = self.plant
        return G.A, G.B[:, [j]], G.C, G.D[:, [j]]

    def closed(self, more: RealArray | None = None) -> StateSpace:
        """The closed loop with every state, for its poles; its inputs and outputs are arbitrary."""
        m, p = self.plant.ninputs, self.plant.noutputs
        links = np.zeros((m + p, p + m))
        links[:m, p:], links[m:, :p] = self.sign * np.eye(m), np.eye(p)
        # python-control systems need at least one input and one output.
        enters, leaves = np.eye(m + p, 1), np.eye(1, m + p)
        parts = named_realisation(self.held(more)), named_realisation(self.K)
        M, n = connected(parts, links, enters, leaves)
        return realisation((M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:]), self.period)

    def largest_pole(self, more: RealArray) -> float:
        """The largest magnitude of a pole of `closed`; fast, for a search over many delays."""
        A, B, C, D = self._held(more)
        K, n = self.K, len(A)
        # Solve u = sign K y and y = C x + D u for u, from the states of plant and controller.
        u = np.linalg.solve(np.eye(len(K.D)) - self.sign * K.D @ D, np.hstack([K.D @ C, K.C]))
        u *= self.sign
        y = D @ u
        y[:, :n] += C
        whole = np.vstack([B @ u, K.B @ y])
        whole[:n, :n] += A
        whole[n:, n:] += K.A
        return float(np.abs(np.linalg.eigvals(whole)).max(initial=0.0))

    def angles(self) -> RealArray:
        """Frequencies [rad/sample] in (0, pi], dense around the modes."""
        systems = self.held(), self.K, self.closed()
        modes = np.concatenate([system.poles() for system in systems]).astype(complex)
        modes = np.log(modes[np.abs(modes) > 1e-6])
        size = np.abs(modes)
        slowest = size[size > SLOWEST_MODE].min(initial=math.pi)
        grid = np.geomspace(slowest / 100, math.pi, SAMPLED_GRID_POINTS)
        damping = np.maximum(np.abs(modes.real), 1e-6 * size)
        near = np.abs(modes.imag)[:, None] + damping[:, None] * MODE_OFFSETS
        near = near[(near > grid[0]) & (near < math.pi)]
        return np.unique(np.concatenate([grid, near]))

    def gain(self, angle: RealArray, channel: int, more: float = 0.0) -> ComplexArray:
        """Loop gain L (F,) of one control signal with the other loops closed; -1 is critical.

        The delay of the signal is raised by `more` [samples].
        """
        m = self.plant.ninputs
        columns = [
            self._held_response(angle, j, self.delay + (more if j == channel else 0.0))
            for j in range(m)
        ]
        L = -self.sign * response(self.K, angle / self.period) @ np.stack(columns, axis=-1)
        other = np.delete(np.arange(m), channel)
        own = L[:, channel, channel]
        if m == 1:
            return own
        others = np.eye(m - 1) + L[:, other[:, None], other]
        through = np.linalg.solve(others, L[:, other, channel, None])[..., 0]
        return own - (L[:, channel, other] * through).sum(axis=-1)

    def _held_response(self, angle: RealArray, j: int, delay: float) -> ComplexArray:
        """Response (F, outputs) of the plant with hold from one of its inputs, delayed by
        `delay`.
        """
        n, m = self.plant.nstates, self.plant.ninputs
        M = np.delete(self._scaled, [n + k for k in range(m) if k != j], axis=1)
        whole, rest = split_delay(delay)
        through, new, old = held_pieces(M[:n, :n], M[:n, n:], self.period, rest)
        direct = np.zeros((len(M) - n, 2))
        direct[:, [int(rest > 0.0)]] = M[n:, n:]
        pieces = np.block([[through, new, old], [M[n:, :n], direct]])
        found = response_of_scaled(pieces, n, np.exp(1j * angle))
        # The newer input is `whole` samples old, the older one a sample more.
        late = np.exp(-1j * np.outer(angle, [whole, whole + 1]))
        return np.asarray((found * late[:, None, :]).sum(axis=-1))

    @cached_property
    def _scaled(self) -> RealArray:
        """[A B; C D] of the continuous plant with scaled states."""
        part = named_realisation(self.plant)
        return with_scaled_states(part.M, part.states)
