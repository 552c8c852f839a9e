"""Newton's method for sets of least size plus a barrier, at all frequencies at once.

P = W_1^-1, S = W_2^-1 and Z are moved so that M_k = P (E_k - Z) S becomes exp(A) (M_k - z) exp(B),
with A and B Hermitian: P to exp(A) P, S to S exp(B), Z to Z + P^-1 z S^-1.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from workbench.arrays import Array, RealArray
from workbench.uncertainty.matrix_sets.multipliers import balanced_multipliers
from workbench.uncertainty.matrix_sets.sets import FoundSets, MatrixSets, finished
from workbench.uncertainty.matrix_sets.shapes import (
    Shape,
    ctranspose,
    directions,
    entry_directions,
)
from workbench.uncertainty.matrix_sets.size import size_derivatives

START = 0.5
"""Largest norm of a deviation in the first sets."""
STEPS = 60
"""Most Newton steps for one weight of the barrier."""
SAFE = 0.05
"""Half the square of the decrement, over the barrier's weight, up to which full steps are taken."""
LONGEST = 3.0
"""Longest step: logarithms of weights change by no more at once."""
SHORTEST = 2.0**-30
"""Shortest step along a Newton direction."""
FLAT = 1e-15
"""Least curvature, relative to the largest: what is less is rounding."""


class BarrierSets:
    """Inverse weights and centres at all frequencies, moved by Newton steps."""

    def __init__(self, program: MatrixSets) -> None:
        self.program = program
        self.F, self.moving, self.p, self.m = program.deviations.shape
        self.N = self.moving + self.p * self.m
        self.constraints = self.N * min(self.p, self.m)
        self.A = directions(program.left, self.p)
        self.B = directions(program.right, self.m)
        free = program.centre == "free"
        self.z = entry_directions(self.p, self.m)[: None if free else 0]
        self.Z = program.deviations.mean(axis=1) * float(free)
        rows, columns = program.channel_sizes
        self.P, self.S = _inverse(rows, program.left), _inverse(columns, program.right)
        self.M = self.P[:, None] @ program.away(self.Z) @ self.S[:, None]
        self._scale_to(START)

    @cached_property
    def _idle(self) -> RealArray:
        """Projection (d, d) on the direction that makes W_1 larger and W_2 as much smaller."""
        traces = [np.einsum("dii->d", self.A).real, -np.einsum("dii->d", self.B).real]
        direction = np.concatenate([*traces, np.zeros(len(self.z))])
        return np.outer(direction, direction) / (direction @ direction)

    def _scale_to(self, norm: float) -> None:
        """Scale the sets so that the largest norm of a deviation is this one."""
        largest = np.linalg.norm(self.M, 2, axis=(-2, -1)).max(axis=1)
        factor = (norm / largest)[:, None, None]
        self.P = self.P * factor
        self.M = self.M * factor[:, None]

    def minimise(self, mu: float, near: float) -> None:
        """Newton steps until half the square of the decrement, over mu, was so near to 0."""
        active = np.arange(self.F)
        for _ in range(STEPS):
            step, decrement = self._newton(mu, active)
            moved = self._moved(mu, active, step, decrement)
            active = active[moved & (decrement > near * mu)]
            if not active.size:
                return

    def _newton(self, mu: float, at: np.ndarray) -> tuple[RealArray, RealArray]:
        """Newton steps (f, d) and half the squares of their decrements (f,)."""
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
        M, A, B, z = self.M[at], self.A, self.B, self.z
        F, (a, b, c) = len(M), (len(A), len(B), len(z))
        Mh = ctranspose(M)
        S = np.linalg.inv(np.eye(self.p) - M @ Mh)
        AM = np.einsum("dij,fkjl->fdkil", A, M)
        MB = np.einsum("fkij,djl->fdkil", M, B)
        minus = np.zeros((F, c, self.N, self.p, self.m), complex)
        minus[:, :, : self.moving] = -z[None, :, None]
        first = np.concatenate([AM, MB, minus], axis=1)
        root = ctranspose(np.linalg.cholesky(S))  # S = root^* root
        V = root[:, None] @ first
        SM = S @ M
        slope = 2 * np.einsum("fkij,fdkij->fd", SM.conj(), first).real
        K = V @ ctranspose((root @ M)[:, None])
        K = K + ctranspose(K)
        curvature = 2 * _gram(V, V) + _gram(K, K)
        # what the second derivatives of M add
        left = (SM @ Mh).sum(axis=1)
        right = (Mh @ SM).sum(axis=1)
        C = ctranspose(SM[:, : self.moving].sum(axis=1))
        AA = np.einsum("dij,ejk,fki->fde", A, A, left).real
        BB = np.einsum("dij,ejk,fki->fde", B, B, right).real
        SMB = np.einsum("fkij,djl->fdkil", SM, B)
        AB = 2 * _gram(AM, SMB)
        Az = -2 * np.einsum("fij,djk,eki->fde", C, A, z).real
        zB = -2 * np.einsum("fij,eik,dkj->fde", C.swapaxes(-2, -1), z, B).real
        more = np.zeros_like(curvature)
        more[:, :a, :a] = AA + AA.swapaxes(1, 2)
        more[:, a : a + b, a : a + b] = BB + BB.swapaxes(1, 2)
        more[:, :a, a : a + b] = AB
        more[:, :a, a + b :] = Az
        more[:, a : a + b, a + b :] = zB
        more[:, a : a + b, :a] = AB.swapaxes(1, 2)
        more[:, a + b :, :a] = Az.swapaxes(1, 2)
        more[:, a + b :, a : a + b] = zB.swapaxes(1, 2)
        size_slope, size_curvature = size_derivatives(self.program, self.P[at], self.S[at], A, B)
        slope, curvature = mu * slope, mu * (curvature + more)
        slope[:, : a + b] += size_slope
        curvature[:, : a + b, : a + b] += size_curvature
        return slope, curvature

    def _value(self, mu: float, P: Array, S: Array, M: Array) -> RealArray:
        """Size + mu * barrier (f,); infinite outside."""
        Y = np.eye(self.p) - M @ ctranspose(M)
        values = np.linalg.eigvalsh(Y)
        inside = (values > 0).all(axis=(1, 2))
        barrier = -np.log(np.where(values > 0, values, 1.0)).sum(axis=(1, 2))
        return np.where(inside, self.program.size_of(P, S) + mu * barrier, np.inf)

    def _moved(
        self, mu: float, at: np.ndarray, step: RealArray, decrement: RealArray
    ) -> np.ndarray:
        """Go along the steps as far as the value falls; where it still did (f,)."""
        before = self._value(mu, self.P[at], self.S[at], self.M[at])
        todo, length = np.ones(len(at), bool), 1.0
        while todo.any() and length >= SHORTEST:
            here = at[todo]
            P, S, Z, M = self._along(here, length * step[todo])
            value = self._value(mu, P, S, M)
            fallen = value <= before[todo] - 0.2 * length * decrement[todo]
            # near the minimum the value's rounding hides the fall, and full steps are safe
            fallen |= np.isfinite(value) & (decrement[todo] <= SAFE * mu)
            chosen = here[fallen]
            self.P[chosen], self.S[chosen] = P[fallen], S[fallen]
            self.Z[chosen], self.M[chosen] = Z[fallen], M[fallen]
            todo[np.flatnonzero(todo)[fallen]] = False
            length /= 2
        return ~todo

    def _along(self, at: np.ndarray, step: RealArray) -> tuple[Array, Array, Array, Array]:
        """Inverse weights, centres and deviations after a step."""
        a, b = len(self.A), len(self.B)
        left = _exp(np.einsum("fd,dij->fij", step[:, :a], self.A))
        right = _exp(np.einsum("fd,dij->fij", step[:, a : a + b], self.B))
        z = np.einsum("fd,dij->fij", step[:, a + b :], self.z)
        P, S = self.P[at], self.S[at]
        Z = self.Z[at]
        if len(self.z):
            Z = Z + np.linalg.solve(P, z) @ np.linalg.inv(S)
        P, S = left @ P, S @ right
        return P, S, Z, P[:, None] @ self.program.away(Z, at) @ S[:, None]

    def found(self) -> FoundSets:
        """The sets, with the multipliers of the barrier's minimum as weights of a proof."""
        square = np.linalg.svd(self.M, compute_uv=False) ** 2
        weights = balanced_multipliers(self.program, self.P, self.S, self.Z, square / (1 - square))
        return finished(self.program, self.P, self.S, self.Z, weights)


def _inverse(sizes: RealArray, shape: Shape) -> Array:
    """Inverse weights (F, n, n) of a shape for channels of these sizes (F, n)."""
    if shape == "scalar":
        sizes = np.broadcast_to(sizes.max(axis=1, keepdims=True), sizes.shape)
    found: Array = (np.eye(sizes.shape[1]) / sizes[:, None]).astype(complex)
    return found


def _gram(first: Array, second: Array) -> RealArray:
    """Real inner products (f, d, e) of complex matrices (f, d, ...) and (f, e, ...)."""
    rows, columns = (
        np.ascontiguousarray(each.reshape(*each.shape[:2], -1)).view(float)
        for each in (first, second)
    )
    found: RealArray = rows @ columns.swapaxes(1, 2)
    return found


def _exp(hermitian: Array) -> Array:
    """Exponentials of Hermitian matrices (f, n, n)."""
    values, vectors = np.linalg.eigh(hermitian)
    found: Array = (vectors * np.exp(values)[:, None]) @ ctranspose(vectors)
    return found
