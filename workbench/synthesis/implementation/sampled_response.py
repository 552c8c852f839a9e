"""The loop of a sampled controller and a held plant: its poles and its response."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.heavy_types import StateSpace
from workbench.systems.generalised_plant import response
from workbench.systems.interconnection import connected, part_of
from workbench.systems.realisation import realisation
from workbench.systems.sampling import sampled, split_delay

POINTS = 4000
"""Frequencies between the slowest mode and half the sampling rate; more about each mode."""
ABOUT = np.concatenate([-np.logspace(2, -2, 25), [0.0], np.logspace(-2, 2, 25)])
"""Of a mode, in units of its damping."""
INTEGRATOR = 1e-9
"""Modes slower than this [rad/sample] are integrators."""


@dataclass(frozen=True, eq=False)
class SampledLoop:
    """u = sign K y around a plant whose inputs are held `period` [s] and `delay` samples late."""

    plant: StateSpace
    K: StateSpace
    period: float
    delay: float
    sign: int

    def held(self, more: RealArray | None = None) -> StateSpace:
        """The sampled plant, its inputs `more` (inputs,) samples later still.

        Columns have the same states of the plant and their own inputs on the way.
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
        """The loop with every state, for its poles; inputs and outputs mean nothing."""
        m, p = self.plant.ninputs, self.plant.noutputs
        links = np.zeros((m + p, p + m))
        links[:m, p:], links[m:, :p] = self.sign * np.eye(m), np.eye(p)
        # One signal each, for python-control systems have some.
        enters, leaves = np.eye(m + p, 1), np.eye(1, m + p)
        parts = part_of(self.held(more)), part_of(self.K)
        M, n = connected(parts, links, enters, leaves)
        return realisation((M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:]), self.period)

    def angles(self) -> RealArray:
        """Frequencies [rad/sample] in (0, pi], dense where a mode makes the response steep."""
        systems = self.held(), self.K, self.closed()
        modes = np.concatenate([system.poles() for system in systems]).astype(complex)
        modes = np.log(modes[np.abs(modes) > 1e-6])
        size = np.abs(modes)
        slowest = size[size > INTEGRATOR].min(initial=math.pi)
        grid = np.geomspace(slowest / 100, math.pi, POINTS)
        damping = np.maximum(np.abs(modes.real), 1e-6 * size)
        near = np.abs(modes.imag)[:, None] + damping[:, None] * ABOUT
        near = near[(near > grid[0]) & (near < math.pi)]
        return np.unique(np.concatenate([grid, near]))

    def gain(self, angle: RealArray, channel: int, more: float = 0.0) -> ComplexArray:
        """L of one signal (F,), -1 being critical, its delay raised by `more` [samples]."""
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
