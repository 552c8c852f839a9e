"""Newton's method that minimises size plus barrier of sets, at all frequencies at once.

A step moves P = W_1^-1 to exp(A) P, S = W_2^-1 to S exp(B) and Z to Z + P^-1 z S^-1, with A and B
Hermitian. So M_k = P (E_k - Z) S becomes exp(A) (M_k - z) exp(B).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench.uncertainty.matrix_covers.sets.finish import containing_sets
from workbench.uncertainty.matrix_covers.sets.log_det import log_det_derivatives, log_det_value
from workbench.uncertainty.matrix_covers.sets.loop import LoopBarrier, loop_level
from workbench.uncertainty.matrix_covers.sets.program import FoundSets, MatrixSets
from workbench.uncertainty.matrix_covers.sets.shapes import (
    WeightShape,
    ctranspose,
    directions,
    entry_directions,
)
from workbench.uncertainty.matrix_covers.sets.size import size_derivatives

START = 0.5
"""Largest norm of a deviation, in units of the first sets. It must be below 1, where the barrier
ends. Half or double: a step more, or a start on the border, which no barrier allows.
"""
STEPS = 60
"""Largest number of Newton steps for one weight of the barrier. With half of them a frequency may
end before the decrement does, and its proof tells a larger gap; double costs time only.
"""
SAFE = 0.05
"""Full steps are taken if half the squared decrement, relative to the barrier's weight, is below
this. Newton's method converges quadratically below 0.07, by the theory of self-concordant barriers.
Half searches along a line once more; double may take a step too far, which the next one mends.
"""
LONGEST = 3.0
"""Longest step: largest change of the logarithms of weights in one step. It is a factor of 20. Half
or double changes the number of steps far from the optimum.
"""
SHORTEST = 2.0**-30
"""Shortest step along a Newton direction. Then the decrease is rounding. Half or double: a halving
more or less before a step is given up.
"""
FLAT = 1e-15
"""Curvatures below this, relative to the largest, are rounding. It is four roundings. With half of
it a step may follow rounding; with double of it directions that flat are left a little earlier.
"""


@dataclass
class SetsAt:
    """Inverse weights P and S, centres Z, contained matrices M, and loops K with their scalings.

    The first axis of each array is frequency. Without a loop K is empty.
    """

    P: Array
    S: Array
    Z: Array
    M: Array
    gamma: RealArray
    delta: RealArray
    K: Array

    def __getitem__(self, at: np.ndarray) -> SetsAt:
        return SetsAt(*(getattr(self, each.name)[at] for each in fields(self)))

    def put(self, at: np.ndarray, other: SetsAt) -> None:
        """Replace the values at these frequencies."""
        for each in fields(self):
            getattr(self, each.name)[at] = getattr(other, each.name)


class BarrierSets:
    """Inverse weights and centres at all frequencies, which Newton steps improve."""

    def __init__(self, program: MatrixSets) -> None:
        self.program = program
        F, self.moving, self.p, self.m = program.deviations.shape
        self.A = directions(program.left, self.p)
        self.B = directions(program.right, self.m)
        free = program.centre == "free"
        self.z = entry_directions(self.p, self.m)[: None if free else 0]
        self.plain = len(self.A) + len(self.B) + len(self.z)
        Z = program.deviations.mean(axis=1) * float(free)
        rows, columns = program.channel_sizes
        P, S = _inverse(rows, program.left), _inverse(columns, program.right)
        M = P[:, None] @ program.away(Z) @ S[:, None]
        factor = (START / np.linalg.norm(M, 2, axis=(-2, -1)).max(axis=1))[:, None, None]
        P, M = P * factor, M * factor[:, None]
        self.loop = None
        gamma, delta, K = np.zeros(F), np.zeros(F), np.zeros((F, 0, 0), complex)
        if program.loop is not None:
            self.loop = LoopBarrier(program.loop, self.A, self.B)
            gamma, delta = loop_level(program.loop, P, S)
            gamma = gamma - np.log(START)
            K = self.loop.at(slice(None), P, S, gamma, delta)
        self.point = SetsAt(P, S, Z, M, gamma, delta, K)
        self.count = self.plain + (self.loop.count if self.loop else 0)
        self.constraints = M.shape[1] * min(self.p, self.m) + min(K.shape[1:])

    @cached_property
    def _idle(self) -> RealArray:
        """Projection (d, d) on the direction that enlarges W_1 and shrinks W_2 by the same
        factor.
        """
        traces = [np.einsum("dii->d", self.A).real, -np.einsum("dii->d", self.B).real]
        rest = np.zeros(self.count - len(self.A) - len(self.B))
        if self.loop is not None and self.loop.performing:
            rest[-1] = -1.0
        direction = np.concatenate([*traces, rest])
        return np.outer(direction, direction) / (direction @ direction)

    def minimise(self, mu: float, near: float) -> None:
        """Newton steps until half the squared decrement, relative to mu, is at most `near`."""
        active = np.arange(len(self.point.P))
        for _ in range(STEPS):
            step, decrement = self._newton(mu, active)
            moved = self._line_search(mu, active, step, decrement)
            active = active[moved & (decrement > near * mu)]
            if not active.size:
                return

    def _newton(self, mu: float, at: np.ndarray) -> tuple[RealArray, RealArray]:
        """Newton steps (f, d) and half their squared decrements (f,)."""
        slope, curvature = self._derivatives(mu, at)
        curvature += np.trace(curvature, axis1=1, axis2=2)[:, None, None] * self._idle
        values, vectors = np.linalg.eigh(curvature)
        size = np.abs(values)
        along = np.einsum("fdk,fd->fk", vectors, slope)
        along /= np.maximum(size, FLAT * size.max(axis=1, keepdims=True))
        step = -np.einsum("fdk,fk->fd", vectors, along)
        step /= np.maximum(np.linalg.norm(step, axis=1, keepdims=True) / LONGEST, 1.0)
        return step, -np.einsum("fd,fd->f", slope, step) / 2

    def _derivatives(self, mu: float, at: np.ndarray) -> tuple[RealArray, RealArray]:
        """Slope (f, d) and curvature (f, d, d) of size + mu * barrier along the directions."""
        here = self.point[at]
        of_sets, n = log_det_derivatives(here.M, self.A, self.B, self.z, self.moving), self.plain
        slope, curvature = np.zeros((len(at), self.count)), np.zeros((len(at),) + (self.count,) * 2)
        slope[:, :n], curvature[:, :n, :n] = mu * of_sets[0], mu * of_sets[1]
        if self.loop is not None:
            of_loop = self.loop.derivatives(here.K)
            slope += mu * of_loop[0]
            curvature += mu * of_loop[1]
            slope[:, n] += 2 * self.p * self.m
        size_slope, size_curvature = size_derivatives(self.program, here.P, here.S, self.A, self.B)
        weights = size_slope.shape[1]
        slope[:, :weights] += size_slope
        curvature[:, :weights, :weights] += size_curvature
        return slope, curvature

    def _value(self, mu: float, point: SetsAt) -> RealArray:
        """Size + mu * barrier (f,); infinite outside the domain of the barrier."""
        barrier = log_det_value(point.M)
        level = point.gamma if self.loop is not None else None
        if self.loop is not None:
            barrier = barrier + log_det_value(point.K[:, None])
        return self.program.size_of(point.P, point.S, level=level) + mu * barrier

    def _line_search(
        self, mu: float, at: np.ndarray, step: RealArray, decrement: RealArray
    ) -> np.ndarray:
        """Take the longest halving of each step that decreases the value; mask (f,) of success."""
        before = self._value(mu, self.point[at])
        todo, length = np.ones(len(at), bool), 1.0
        while todo.any() and length >= SHORTEST:
            here = at[todo]
            point = self._along(here, length * step[todo])
            value = self._value(mu, point)
            fallen = value <= before[todo] - 0.2 * length * decrement[todo]
            # near the minimum rounding hides the decrease, and full steps are safe
            fallen |= np.isfinite(value) & (decrement[todo] <= SAFE * mu)
            self.point.put(here[fallen], point[fallen])
            todo[np.flatnonzero(todo)[fallen]] = False
            length /= 2
        return ~todo

    def _along(self, at: np.ndarray, step: RealArray) -> SetsAt:
        """Inverse weights, centres, deviations and loops after a step."""
        a, b = len(self.A), len(self.B)
        left = _exp(np.einsum("fd,dij->fij", step[:, :a], self.A))
        right = _exp(np.einsum("fd,dij->fij", step[:, a : a + b], self.B))
        z = np.einsum("fd,dij->fij", step[:, a + b : self.plain], self.z)
        here = self.point[at]
        P, S, Z = here.P, here.S, here.Z
        if len(self.z):
            Z = Z + np.linalg.solve(P, z) @ np.linalg.inv(S)
        P, S = left @ P, S @ right
        M = P[:, None] @ self.program.away(Z, at=at) @ S[:, None]
        if self.loop is None:
            return SetsAt(P, S, Z, M, here.gamma, here.delta, here.K)
        more = step[:, self.plain :]
        gamma = here.gamma + more[:, 0]
        delta = here.delta + (more[:, 1] if self.loop.performing else 0.0)
        return SetsAt(P, S, Z, M, gamma, delta, self.loop.at(at, P, S, gamma, delta))

    def found(self) -> FoundSets:
        """The sets, with the multipliers of the barrier's minimum."""
        here = self.point
        of_loop = None if self.loop is None else (here.delta, _multipliers(here.K))
        return containing_sets(self.program, here.P, here.S, here.Z, _multipliers(here.M), of_loop)


def _multipliers(M: Array) -> RealArray:
    """Multipliers (..., r) of singular values of matrices (..., p, m) at the barrier's minimum."""
    square = np.linalg.svd(M, compute_uv=False) ** 2
    found: RealArray = square / (1 - square)
    return found


def _inverse(sizes: RealArray, shape: WeightShape) -> Array:
    """Inverse weights (F, n, n) of a shape, for channels with these sizes (F, n)."""
    if shape == "scalar":
        sizes = np.broadcast_to(sizes.max(axis=1, keepdims=True), sizes.shape)
    found: Array = (np.eye(sizes.shape[1]) / sizes[:, None]).astype(complex)
    return found


def _exp(hermitian: Array) -> Array:
    """Exponentials of Hermitian matrices (f, n, n)."""
    values, vectors = np.linalg.eigh(hermitian)
    found: Array = (vectors * np.exp(values)[:, None]) @ ctranspose(vectors)
    return found
