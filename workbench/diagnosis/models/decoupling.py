"""The left null space of a system's states and disturbances, from which residuals are made.

Stack y and its derivatives (or its next samples) up to order nu. With x = W a + P b,

    Y = O W a + O P b + T_u U + T_d D + T_f F,

where the columns of W and P together are an orthonormal basis of the state space. W spans the
states that controls and disturbances reach, and the unstable modes. P spans the rest, which only
faults and noise excite. A row v with v [O W, T_d] = 0 leaves v (Y - T_u U) = v O P b + v T_f F,
which is a residual of order nu (Chow and Willsky, IEEE TAC 29 (1984)). The rows that are no
combination of delayed earlier ones form a minimal polynomial basis. Their number is that of the
outputs less the generic rank of the disturbances (Forney, SIAM J. Control 13 (1975)).

Computations are scaled: continuous time is in units of the fastest pole, outputs and inputs are in
units of their rows and columns. `Parity` converts from and to them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import matrix_balance, null_space, schur

from workbench._core.arrays import Array
from workbench.diagnosis.models.fault_model import FaultModel
from workbench.errors import SolverError
from workbench.systems.frequency_response import frequency_response

REACHED_SHARE = 1e-9
"""A direction of the state space counts as not reached below this share of the largest."""
NULL_SPACE_SHARE = 1e-10
"""A singular value of [O W, T_d] counts as 0 below this share of the largest."""
GENERIC_RANK_SHARE = 1e-8
"""A singular value of a response with columns of size 1, at a random point, is 0 below this."""
BOUNDARY_DISTANCE = 1e-9
"""A mode counts as unstable if it is nearer to the boundary than this share of the fastest."""
PENCIL_RANK_SHARE = 1e-7
"""A pencil loses rank, at a zero, if a singular value is below this share of the largest."""
RANDOM_POINTS = 5
"""Number of random points at which generic ranks are determined."""


@dataclass(frozen=True, eq=False)
class Parity:
    """The rows that decouple a model's controls, and the inputs `decoupled`, from its outputs."""

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
        """The balanced A in units of `rate`, the units of the states, and C in those units."""
        system = self.model.system
        if not system.nstates:
            return np.asarray(system.A), np.ones(0), np.asarray(system.C)
        A, (units, _) = matrix_balance(system.A, permute=False, separate=True)
        return A / self.rate, units, np.asarray(system.C) * units

    @cached_property
    def y_units(self) -> Array:
        """Units (p,) of the outputs: the norms of their rows of the system."""
        A, _, C = self._balanced
        names = self.model.system.input_labels
        B, D = self._entry(names)
        rows = np.hstack([C, C @ A, C @ B, D])
        size: Array = np.linalg.norm(rows, axis=1)
        return np.where(size > 0.0, size, 1.0)

    def _entry(self, names: Sequence[str]) -> tuple[Array, Array]:
        """B and D of inputs, in units of time and states."""
        B, D = self.model.matrices(names)
        return B / self._balanced[1][:, None] / self.rate, D

    def entry(self, names: Sequence[str]) -> tuple[Array, Array]:
        """B and D of inputs, in units of time, states and outputs."""
        B, D = self._entry(names)
        return B, D / self.y_units[:, None]

    def scaled_entry(self, names: Sequence[str]) -> tuple[Array, Array, Array]:
        """B and D of inputs as from `entry` with columns scaled to size 1, and those sizes."""
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
        """The orthonormal bases W and P of the module's docstring."""
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
        """An orthonormal basis of the unstable modes."""
        if not len(self.A):
            return np.zeros((0, 0))
        edge = (1.0 - BOUNDARY_DISTANCE) / self.rate

        def is_unstable(real: float, imaginary: float) -> bool:
            return (
                np.hypot(real, imaginary) >= edge if self.model.dt else real >= -BOUNDARY_DISTANCE
            )

        _, Z, count = schur(self.A, sort=is_unstable)
        return Z[:, :count]

    @cached_property
    def rest(self) -> tuple[Array, Array]:
        """A_b of the states b that only faults and noise excite, and P."""
        P = self._split[1]
        return P.T @ self.A @ P, P

    @cached_property
    def count(self) -> int:
        """Number of rows of a basis: outputs less the generic rank of the decoupled inputs."""
        return len(self.C) - generic_rank(self, self.decoupled)

    # --- null spaces --------------------------------------------------------------------------

    def observability(self, order: int) -> Array:
        """The observability matrix O = [C; C A; ...], ((order + 1) p, n)."""
        blocks = [self.C]
        for _ in range(order):
            blocks.append(blocks[-1] @ self.A)
        return np.vstack(blocks)

    def toeplitz(self, order: int, B: Array, D: Array) -> Array:
        """The Toeplitz matrix ((order + 1) p, (order + 1) k) of k inputs with B and D."""
        p, k = D.shape
        markov = [D, *np.split(self.observability(order) @ B, order + 1)[:order]]
        T = np.zeros(((order + 1) * p, (order + 1) * k))
        for i in range(order + 1):
            for j in range(i + 1):
                T[i * p : (i + 1) * p, j * k : (j + 1) * k] = markov[i - j]
        return T

    def rows(self, order: int) -> Array:
        """An orthonormal basis (count, (order + 1) p) of all rows v of that order or less."""
        B, D, _ = self.scaled_entry(self.decoupled)
        O_W = self.observability(order) @ self._split[0]
        stacked = np.hstack([O_W, self.toeplitz(order, B, D)])
        if not stacked.any():
            return np.eye(len(stacked))
        found: Array = null_space(stacked.T, rcond=NULL_SPACE_SHARE).T
        return found

    @cached_property
    def complete(self) -> int:
        """The least order at which the rows contain a whole basis.

        From that order on each further order adds as many rows as a basis has; this must happen
        within n orders. Raises SolverError if rounding hides it.
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
        """Rows (order_i + 1, p) of a minimal polynomial basis: coefficients of rising powers."""
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

    # --- the effect of an input on a row --------------------------------------------------------

    def effects(self, order: int, names: Sequence[str], points: Array) -> Array:
        """The effect (S, rows, k) of inputs on the stacked outputs at scaled points s (S,).

        It is E = T_f [1; s; ...] + O P (s - A_b)^-1 P' B_f; the effect on a row v is v E.
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
        """The effect (rows, k) of inputs on a whole basis at one scaled point s, and sizes (k,).

        It comes from the left null space (xi, eta) of [W'(A - s) W, W' B_d; C W, D_d], without
        powers of A. The sizes are those of the effect before anything cancels. None if the pencil
        has a zero at the point: its null space is larger than the basis there.
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
        if rank and sizes[rank - 1] <= PENCIL_RANK_SHARE * sizes[0]:
            return None
        rows = U[:, rank:].conj().T
        b = np.linalg.solve(point * np.eye(len(A_b)) - A_b, P.T @ B_f)
        reached = np.vstack([W.T @ (B_f + self.A @ P @ b), D_f + self.C @ P @ b])
        return rows @ reached, np.linalg.norm(reached, axis=0)

    def points_at(self, omega: Array) -> Array:
        """The scaled points on the stability boundary at the frequencies `omega` [rad/s]."""
        dt = self.model.dt
        return (np.exp(1j * omega * dt) if dt else 1j * omega) / self.rate


def random_points(parity: Parity) -> Array:
    """Fixed random scaled points (S,), in the unstable region and away from its boundary."""
    rng = np.random.default_rng(20170)
    angle, size = (
        rng.uniform(-0.4, 0.4, RANDOM_POINTS) * np.pi,
        rng.uniform(1.2, 3.0, RANDOM_POINTS),
    )
    points: Array = size * np.exp(1j * angle)
    return points


def scaled_response(parity: Parity, names: Sequence[str]) -> Array:
    """The response (S, p, k) of inputs at the random points, nonzero columns scaled to size 1."""
    B, D, _ = parity.scaled_entry(names)
    n = len(parity.A)
    M = np.block([[parity.A, B], [parity.C, D]])
    G: Array = frequency_response(M, n, random_points(parity))
    size = np.linalg.norm(G, axis=1, keepdims=True)
    return np.divide(G, size, out=np.zeros_like(G), where=size > 0.0)


def generic_rank(parity: Parity, names: Sequence[str]) -> int:
    """The rank of the inputs' transfer matrix at almost every s, found at the random points."""
    if not names:
        return 0
    sizes = np.linalg.svd(scaled_response(parity, names), compute_uv=False)
    return int((sizes > GENERIC_RANK_SHARE).sum(axis=1).max())


def _span(vectors: Array) -> Array:
    """An orthonormal basis of the span of the columns."""
    if not vectors.size:
        return np.zeros((len(vectors), 0))
    U, sizes, _ = np.linalg.svd(vectors, full_matrices=False)
    return U[:, sizes > REACHED_SHARE * max(float(sizes[0]), 1.0)]
