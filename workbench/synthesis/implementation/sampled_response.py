"""Poles and response of the loop of a sampled controller and a plant with held inputs."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.heavy_types import StateSpace
from workbench.systems.generalised_plant import response
from workbench.systems.interconnection import connected, named_realisation
from workbench.systems.realisation import realisation
from workbench.systems.sampling import sampled, split_delay

SAMPLED_GRID_POINTS = 4000
"""Number of frequencies up to half the sampling rate, before those around each mode are added."""
MODE_OFFSETS = np.concatenate([-np.logspace(2, -2, 25), [0.0], np.logspace(-2, 2, 25)])
"""Distances of the added frequencies from each mode, in units of its decay rate."""
SLOWEST_MODE = 1e-9
"""Modes slower than this [rad/sample] count as integrators."""


@dataclass(frozen=True, eq=False)
class HeldPlantLoop:
    """The loop u = sign K y of a sampled controller around a plant with held inputs.

    The inputs are held for `period` [s] and arrive `delay` samples late.
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
        G = self.plant
        n, m = G.nstates, G.ninputs
        delays = self.delay + (np.zeros(m) if more is None else more)
        columns = [
            sampled(realisation((G.A, G.B[:, [j]], G.C, G.D[:, [j]]), 0.0), self.period, delays[j])
            for j in range(m)
        ]
        ends = n + np.cumsum([column.nstates - n for column in columns])
        size = int(ends[-1])
        A, B = np.zeros((size, size)), np.zeros((size, m))
        C, D = np.zeros((G.noutputs, size)), np.zeros((G.noutputs, m))
        A[:n, :n], C[:, :n] = columns[0].A[:n, :n], G.C
        for j, (column, end) in enumerate(zip(columns, ends, strict=True)):
            own = slice(int(end) - column.nstates + n, int(end))
            A[:n, own], A[own, own] = column.A[:n, n:], column.A[n:, n:]
            B[:n, j], B[own, j] = column.B[:n, 0], column.B[n:, 0]
            C[:, own], D[:, j] = column.C[:, n:], column.D[:, 0]
        return realisation((A, B, C, D), self.period)

    def closed(self, more: RealArray | None = None) -> StateSpace:
        """The closed loop with every state, for its poles; its inputs and outputs are arbitrary."""
        m, p = self.plant.ninputs, self.plant.noutputs
        links = np.zeros((m + p, p + m))
        links[:m, p:], links[m:, :p] = self.sign * np.eye(m), np.eye(p)
        # One input and one output, since python-control systems need them.
        enters, leaves = np.eye(m + p, 1), np.eye(1, m + p)
        parts = named_realisation(self.held(more)), named_realisation(self.K)
        M, n = connected(parts, links, enters, leaves)
        return realisation((M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:]), self.period)

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
        columns = []
        for j in range(m):
            whole, rest = split_delay(self.delay + (more if j == channel else 0.0))
            parts = self.plant.A, self.plant.B[:, [j]], self.plant.C, self.plant.D[:, [j]]
            held = sampled(realisation(parts, 0.0), self.period, rest)
            turned = np.exp(-1j * angle * whole)[:, None, None]
            columns.append(response(held, angle / self.period) * turned)
        L = -self.sign * response(self.K, angle / self.period) @ np.concatenate(columns, axis=-1)
        other = np.delete(np.arange(m), channel)
        own = L[:, channel, channel]
        if m == 1:
            return own
        others = np.eye(m - 1) + L[:, other[:, None], other]
        through = np.linalg.solve(others, L[:, other, channel, None])[..., 0]
        return own - (L[:, channel, other] * through).sum(axis=-1)
