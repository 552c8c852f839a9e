"""The left null space of a system's disturbances and states: what residuals can be made of.

Stack y and its derivatives (or its next samples) up to order nu. With x = W a + P b,

    Y = O W a + O P b + T_u U + T_d D + T_f F,

where the columns of W span what controls and disturbances reach and every unstable mode; P spans
the rest, which faults and noise alone excite. A row v with v [O W, T_d] = 0 leaves
v (Y - T_u U) = v O P b + v T_f F: a residual, its order nu (Chow and Willsky, IEEE TAC 29 (1984)).
Rows that are no combination of delayed earlier ones form a minimal polynomial basis, as many as
there are outputs less the generic rank of the disturbances (Forney, SIAM J. Control 13 (1975)).

Continuous time is counted in units of the fastest pole here, outputs and inputs in units of their
rows and columns; `Parity` hides that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import matrix_balance, null_space, schur

from workbench.arrays import Array
from workbench.diagnosis.models.fault_model import FaultModel
from workbench.errors import SolverError
from workbench.systems.frequency_response import frequency_response

REACH = 1e-9
"""Directions below this share of the largest count as not reached."""
NULL = 1e-10
"""Singular values of [O W, T_d] below this share of the largest count as 0."""
GENERIC = 1e-8
"""Singular values of a scaled response at random points below this share count as 0."""
BOUNDARY = 1e-9
"""Modes nearer than this to the stability boundary, of the fastest, count as unstable."""
NEAR_ZERO = 1e-7
"""A singular value of a pencil below this share of the largest may be a zero's."""
POINTS = 5


@dataclass(frozen=True, eq=False)
class Parity:
    """The rows that decouple `decoupled` inputs, beside the controls, from a model's outputs."""

    model: FaultModel
    decoupled: tuple[str, ...]

    # --- scaled data --------------------------------------------------------------------------

    @cached_property
    def rate(self) -> float:
        """Unit of frequency [rad/s]; 1 where sampled."""
        if self.model.dt:
            return 1.0
        poles = np.linalg.eigvals(self.model.system.A) if self.model.system.nstates else np.ones(1)
        return float(np.abs(poles).max()) or 1.0

    @cached_property
    def _balanced(self) -> tuple[Array, Array, Array]:
        """A, the states' units, and C: balanced, in units of time."""
        system = self.model.system
        if not system.nstates:
            return np.asarray(system.A), np.ones(0), np.asarray(system.C)
        A, (units, _) = matrix_balance(system.A, permute=False, separate=True)
        return A / self.rate, units, np.asarray(system.C) * units

    @cached_property
    def y_units(self) -> Array:
        """Units (p,) of the outputs: the sizes of their rows."""
        A, _, C = self._balanced
        names = self.model.system.input_labels
        B, D = self._entry(names)
        rows = np.hstack([C, C @ A, C @ B, D])
        size: Array = np.linalg.norm(rows, axis=1)
        return np.where(size > 0.0, size, 1.0)

    def _entry(self, names: Sequence[str]) -> tuple[Array, Array]:
        """B and D of inputs in units of time and states."""
        B, D = self.model.matrices(names)
        return B / self._balanced[1][:, None] / self.rate, D

    def entry(self, names: Sequence[str]) -> tuple[Array, Array]:
        """B and D of inputs, outputs in their units."""
        B, D = self._entry(names)
        return B, D / self.y_units[:, None]

    def scaled_entry(self, names: Sequence[str]) -> tuple[Array, Array, Array]:
        """As `entry` with columns of size 1, and their sizes."""
        B, D = self.entry(names)
        size: Array = np.linalg.norm(np.vstack([B, D]), axis=0)
        size = np.where(size > 0.0, size, 1.0)
        return B / size, D / size, size

    @property
    def A(self) -> Array:
        return self._balanced[0]

    @cached_property
    def C(self) -> Array:
        return self._balanced[2] / self.y_units[:, None]

    # --- subspaces ----------------------------------------------------------------------------

    @cached_property
    def _split(self) -> tuple[Array, Array]:
        """Orthonormal W and P."""
        n = len(self.A)
        B, _, _ = self.scaled_entry((*self.model.controls, *self.decoupled))
        basis = _span(np.hstack([B, self._unstable]))
        while 0 < basis.shape[1] < n:
            larger = _span(np.hstack([basis, self.A @ basis]))
            if larger.shape[1] == basis.shape[1]:
                break
            basis = larger
        full = np.linalg.qr(np.hstack([basis, np.eye(n)]))[0] if n else np.zeros((0, 0))
        return full[:, : basis.shape[1]], full[:, basis.shape[1] :]

    @cached_property
    def _unstable(self) -> Array:
        """Orthonormal basis of the unstable modes."""
        if not len(self.A):
            return np.zeros((0, 0))
        edge = (1.0 - BOUNDARY) / self.rate

        def is_unstable(real: float, imaginary: float) -> bool:
            return np.hypot(real, imaginary) >= edge if self.model.dt else real >= -BOUNDARY

        _, Z, count = schur(self.A, sort=is_unstable)
        return Z[:, :count]

    @cached_property
    def rest(self) -> tuple[Array, Array]:
        """A of the states b that faults and noise alone excite, and P."""
        P = self._split[1]
        return P.T @ self.A @ P, P

    @cached_property
    def count(self) -> int:
        """Rows of a basis: outputs less the generic rank of the decoupled inputs."""
        return len(self.C) - generic_rank(self, self.decoupled)

    # --- null spaces --------------------------------------------------------------------------

    def observability(self, order: int) -> Array:
        """O = [C; C A; ...], ((order + 1) p, n)."""
        blocks = [self.C]
        for _ in range(order):
            blocks.append(blocks[-1] @ self.A)
        return np.vstack(blocks)

    def toeplitz(self, order: int, B: Array, D: Array) -> Array:
        """T, ((order + 1) p, (order + 1) k), of inputs with B and D."""
        p, k = D.shape
        markov = [D, *np.split(self.observability(order) @ B, order + 1)[:order]]
        T = np.zeros(((order + 1) * p, (order + 1) * k))
        for i in range(order + 1):
            for j in range(i + 1):
                T[i * p : (i + 1) * p, j * k : (j + 1) * k] = markov[i - j]
        return T

    def rows(self, order: int) -> Array:
        """Orthonormal rows v (count, (order + 1) p), all of that order or less."""
        B, D, _ = self.scaled_entry(self.decoupled)
        O_W = self.observability(order) @ self._split[0]
        stacked = np.hstack([O_W, self.toeplitz(order, B, D)])
        if not stacked.any():
            return np.eye(len(stacked))
        found: Array = null_space(stacked.T, rcond=NULL).T
        return found

    @cached_property
    def complete(self) -> int:
        """The least order that holds a whole basis.

        Raises SolverError where rounding hides it: within n orders each more must add as many rows
        as a basis has.
        """
        before = 0
        for order in range(len(self.A) + 1):
            now = len(self.rows(order))
            if now - before == self.count:
                return order
            before = now
        raise SolverError(
            f"the null space of {len(self.A)} states and {len(self.decoupled)} disturbances is "
            "not resolved: rank decisions at successive orders contradict each other; scale the "
            "model or remove nearly redundant states and disturbances"
        )

    @cached_property
    def basis(self) -> list[Array]:
        """Rows (order_i + 1, p) of a minimal polynomial basis, coefficients of rising powers."""
        p = len(self.C)
        found: list[Array] = []
        for order in range(self.complete + 1):
            delayed = [
                np.vstack([np.zeros((k, p)), v, np.zeros((order - k - len(v) + 1, p))]).reshape(-1)
                for v in found
                for k in range(order - len(v) + 2)
            ]
            space = self.rows(order)
            if delayed:
                Q = np.linalg.qr(np.array(delayed).T)[0]
                space = _span((space - (space @ Q) @ Q.T).T).T
            found += [v.reshape(order + 1, p) for v in space]
        return found

    # --- what a row leaves of an input ----------------------------------------------------------

    def effects(self, order: int, names: Sequence[str], points: Array) -> Array:
        """T_f [1; s; ...] + O P (s - A_b)^-1 P' B_f at scaled points (S,): (S, rows, k).

        A row v times it is what v leaves of the inputs at s.
        """
        B, D, _ = self.scaled_entry(names)
        A_b, P = self.rest
        T = self.toeplitz(order, B, D).reshape(-1, order + 1, len(names))
        powers = points[:, None] ** np.arange(order + 1)
        direct: Array = np.einsum("ris,zi->zrs", T, powers)
        if not len(A_b):
            return direct
        resolvent = np.linalg.solve(points[:, None, None] * np.eye(len(A_b)) - A_b, P.T @ B)
        return direct + (self.observability(order) @ P) @ resolvent

    def left_at(self, names: Sequence[str], point: complex) -> tuple[Array, Array] | None:
        """What a whole basis leaves of inputs at one scaled point, (rows, k), and sizes (k,).

        From the left null space (xi, eta) of [W'(A - s) W, W' B_d; C W, D_d], without powers of A.
        The sizes are what would be left without cancelling. None where the pencil has a zero at
        the point: its null space there is larger than the basis.
        """
        W, P = self._split
        A_b, _ = self.rest
        B_d, D_d, _ = self.scaled_entry(self.decoupled)
        B_f, D_f, _ = self.scaled_entry(names)
        pencil = np.block(
            [[W.T @ self.A @ W - point * np.eye(W.shape[1]), W.T @ B_d], [self.C @ W, D_d]]
        )
        U, sizes, _ = np.linalg.svd(pencil)
        rank = len(pencil) - self.count
        if rank and sizes[rank - 1] <= NEAR_ZERO * sizes[0]:
            return None
        rows = U[:, rank:].conj().T
        b = np.linalg.solve(point * np.eye(len(A_b)) - A_b, P.T @ B_f)
        reached = np.vstack([W.T @ (B_f + self.A @ P @ b), D_f + self.C @ P @ b])
        return rows @ reached, np.linalg.norm(reached, axis=0)

    def points_at(self, omega: Array) -> Array:
        """Scaled points on the stability boundary of `omega` [rad/s]."""
        dt = self.model.dt
        return (np.exp(1j * omega * dt) if dt else 1j * omega) / self.rate


def random_points(parity: Parity) -> Array:
    """Fixed random points (POINTS,), scaled, away from the stable region's boundary and poles."""
    rng = np.random.default_rng(20170)
    angle, size = rng.uniform(-0.4, 0.4, POINTS) * np.pi, rng.uniform(1.2, 3.0, POINTS)
    points: Array = size * np.exp(1j * angle)
    return points


def scaled_response(parity: Parity, names: Sequence[str]) -> Array:
    """Response of inputs at the random points (S, p, k), columns of size 1 where not 0."""
    B, D, _ = parity.scaled_entry(names)
    n = len(parity.A)
    M = np.block([[parity.A, B], [parity.C, D]])
    G: Array = frequency_response(M, n, random_points(parity))
    size = np.linalg.norm(G, axis=1, keepdims=True)
    return np.divide(G, size, out=np.zeros_like(G), where=size > 0.0)


def generic_rank(parity: Parity, names: Sequence[str]) -> int:
    """Rank of the inputs' transfer matrix at almost every s: the largest at the random points."""
    if not names:
        return 0
    sizes = np.linalg.svd(scaled_response(parity, names), compute_uv=False)
    return int((sizes > GENERIC).sum(axis=1).max())


def _span(vectors: Array) -> Array:
    """Orthonormal basis of the columns' span."""
    if not vectors.size:
        return np.zeros((len(vectors), 0))
    U, sizes, _ = np.linalg.svd(vectors, full_matrices=False)
    return U[:, sizes > REACH * max(float(sizes[0]), 1.0)]
