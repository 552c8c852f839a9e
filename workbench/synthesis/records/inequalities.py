"""The matrix S-lemma as conic programs, in scaled coordinates.

The variables are Y, L = K Y, the multiplier alpha, and for a norm the variables g or V of the
level. In coordinates xi = T^-1 x and v = U^-1 u the plants of the records are [A B] + H Delta E,
|Delta| <= 1, and the matrix of the lemma is

    [corner - alpha H H'  0             A Y + B L    0        ]
    [0                    alpha I       E [Y; L]     0        ]
    [.                    .             Y            Y C_K'   ]
    [0                    0             C_K Y        lower    ]

The corner is rate^2 Y - I for "decay", Y for "h2" and Y - T^-1 F F' T^-T for "hinf". The lower
block is g I for "hinf", and I otherwise. For "h2" there is also [V F' T^-T; T^-1 F Y] >= 0. The
level is the square root of the least g, or of the least trace of V. In the H-infinity case Y is
gamma^2 times the Y of the lemma, so that g = gamma^2 enters linearly.
"""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.linalg import block_diag, solve_discrete_are
from scipy.sparse import csr_array, vstack

from workbench._core.arrays import RealArray
from workbench.answer import ProgramAnswer
from workbench.certify.cones.form import ConeFactor, ConeKind, ConicForm, triangle
from workbench.certify.rounding import nearest_power_of_two
from workbench.synthesis.records.record import StateRecords

SMALL_COST = 1e-3
"""Weight of the uncertainty in the cost for the central plant that scales the states."""
FeedbackCriterion = Literal["decay", "h2", "hinf"]
"""What the feedback minimises for the worst plant: a rate per sample, or a norm from w to z."""


@dataclass(frozen=True, eq=False, repr=False)
class ProvenFeedback(ProgramAnswer):
    """A gain u = K x with the proof of its level for every plant that agrees with the records.

    Unlike a `StateSpace`, it is a gain of all states, with a proof for every plant that agrees
    with the records.

    Y (n, n) is the inverse of the common Lyapunov matrix and ``multiplier`` the alpha of the
    S-lemma. ``level`` is the rate per sample, or the H2 or H-infinity norm. No Y and K satisfy the
    inequality for a level below ``bound``, which the rational ``dual`` proves; 0 without such a
    proof.

    Examples
    --------
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.synthesis import FeedbackFromRecords, NoiseEnergy, StateRecords
    >>> rng = np.random.default_rng(0)
    >>> x, u, w = (
    ...     rng.standard_normal((2, 30)),
    ...     rng.standard_normal((1, 30)),
    ...     rng.random((2, 30)) - 0.5,
    ... )
    >>> next_states = [[1.1, 0.3], [0.0, 0.7]] @ x + [[0.2], [1.0]] @ u + 0.2 * w
    >>> records = StateRecords(x, u, next_states, NoiseEnergy(0.3 * np.eye(2)))
    >>> answer = wb.solve(FeedbackFromRecords(records)).answer
    >>> closed = [[1.1, 0.3], [0.0, 0.7]] + [[0.2], [1.0]] @ answer.K
    >>> bool(
    ...     abs(np.linalg.eigvals(closed)).max() <= answer.level
    ... )  # the true plant is one of the set
    True
    """

    K: RealArray
    Y: RealArray
    multiplier: float
    level: float
    _: KW_ONLY
    bound: float = 0.0
    dual: tuple[str, ...] = field(default=(), repr=False)


@dataclass(frozen=True, eq=False)
class ScaledRecords:
    """The records in scaled coordinates, as the conic programs and Riccati equations need them.

    Parameters
    ----------
    records, criterion
        The records, and the criterion to minimise.
    C, D
        The performance output z = C x + D u, of shapes (p, n) and (p, m); p is 0 for "decay".
    F
        Input matrix (n, q) of the disturbance in the norms.
    """

    records: StateRecords
    criterion: FeedbackCriterion
    C: RealArray
    D: RealArray
    F: RealArray

    @cached_property
    def units(self) -> tuple[RealArray, RealArray]:
        """T (n, n) and U (m, m) with x = T xi, u = U v.

        T makes the Y of the central plant alone, from an ordinary Riccati equation, the identity. U
        gives the columns of B norm 1.
        """
        T = self._central_root()
        B = np.linalg.solve(T, self.records.centre[:, self.records.order :])
        size = np.linalg.norm(B, axis=0)
        U: RealArray = np.diag(1.0 / np.where(size > 0, size, 1.0))
        return np.asarray(T), U

    def _central_root(self) -> RealArray:
        """T (n, n) with T T' = P^-1 for the central plant's P; with T T' = S where there is no P.

        The uncertainty is a small part of the cost, so that every state and input has a cost.
        """
        n, scale = self.records.order, self.records.scale
        centre, E = self.records.centre * scale / scale[:n, None], self.records.ellipsoid[1] * scale
        z = np.hstack([self.C, self.D]) * scale
        share = SMALL_COST * np.linalg.norm(z) / np.linalg.norm(E) if len(z) else 1.0
        z = np.vstack([z, share * E])
        weight = z.T @ z
        try:
            P = solve_discrete_are(
                centre[:, :n], centre[:, n:], weight[:n, :n], weight[n:, n:], s=weight[:n, n:]
            )
            root = np.linalg.inv(np.linalg.cholesky((P + P.T) / 2)).T
        except (np.linalg.LinAlgError, ValueError):
            return np.asarray(np.linalg.cholesky(self.records.ellipsoid[0]))
        return np.asarray(scale[:n, None] * root)

    @cached_property
    def disturbance(self) -> RealArray:
        """Input matrix T^-1 F (n, q) of the disturbance for the scaled states."""
        return np.asarray(np.linalg.solve(self.units[0], self.F))

    @cached_property
    def size(self) -> float:
        """Unit of the performance output."""
        x, u = self.units
        largest = max(np.abs(self.C @ x).max(initial=0.0), np.abs(self.D @ u).max(initial=0.0))
        return float(nearest_power_of_two(largest))

    @cached_property
    def performance(self) -> tuple[RealArray, RealArray]:
        """C and D in scaled units of states, inputs and output."""
        x, u = self.units
        return self.C @ x / self.size, self.D @ u / self.size

    @cached_property
    def plant(self) -> tuple[RealArray, RealArray]:
        """The central plant A (n, n), B (n, m) in scaled coordinates."""
        (x, u), n = self.units, self.records.order
        theta = np.linalg.solve(x, self.records.centre)
        return theta[:, :n] @ x, theta[:, n:] @ u

    @cached_property
    def uncertainty(self) -> RealArray:
        """E (n + m, n + m), where the plants are [A B] + H Delta E with |Delta| <= 1."""
        found: RealArray = self.records.ellipsoid[1] @ block_diag(*self.units)
        return found

    @cached_property
    def spread(self) -> RealArray:
        """H (n, n), a square root of S."""
        root = np.linalg.cholesky(self.records.ellipsoid[0])
        return np.asarray(np.linalg.solve(self.units[0], root))

    @cached_property
    def sizes(self) -> tuple[float, float]:
        """Norms of H and E. The multiplier is near |E| / |H|."""
        return float(np.linalg.norm(self.spread, 2)), float(np.linalg.norm(self.uncertainty, 2))

    def restored(
        self, Y: RealArray, K: RealArray, multiplier: float, level: float
    ) -> ProvenFeedback:
        """The answer in the units of the records, from Y, K and the multiplier of the lemma."""
        x, u = self.units
        Y = x @ Y @ x.T / self.size**2
        K = u @ np.linalg.solve(x.T, K.T).T
        return ProvenFeedback(K, (Y + Y.T) / 2, multiplier / self.size**2, level * self.size)

    # --- conic forms ----------------------------------------------------------------------------

    @property
    def _counts(self) -> tuple[int, int, int]:
        """Numbers of entries of Y and of L, and of all variables before those of the level."""
        n, m = self.records.order, self.records.controls
        free = n * (n + 1) // 2
        return free, m * n, free + m * n + 1

    def taken(self, x: RealArray, level: float | None) -> ProvenFeedback:
        """The answer for the variables x of a form; `level` is as in `form`."""
        n, m = self.records.order, self.records.controls
        free, gains, _ = self._counts
        Y = _symmetric(x[:free], n)
        K = np.asarray(np.linalg.solve(Y, x[free : free + gains].reshape(m, n).T).T)
        multiplier = self.sizes[1] / self.sizes[0] * float(x[free + gains])
        if level is None:
            level = self.level_of(x)
        scaled = level / self.size
        if self.criterion == "hinf":
            Y, multiplier = Y / scaled**2, multiplier / scaled**2
        return self.restored(Y, K, multiplier, scaled)

    def level_of(self, x: RealArray) -> float:
        """The level reached by the variables of a form without a given level."""
        c = self.form(None).c
        return math.sqrt(max(float(c @ x), 0.0)) * self.size

    def form(self, level: float | None, centred: bool = False) -> ConicForm:
        """The conic program for a level, or for the least level.

        Parameters
        ----------
        level
            The given level; None to minimise the level ("decay" needs a given level).
        centred
            Maximise the margin by which Y, L and alpha satisfy the inequalities of the level. The
            margin is at most 1; the last variable is the margin with negative sign.
        """
        n, q = self.disturbance.shape
        free, _, before = self._counts
        squared = None if level is None else (level / self.size) ** 2
        sought = 0 if squared is not None else int(self.criterion == "hinf")
        if self.criterion == "h2":
            sought = q * (q + 1) // 2
        count = before + sought + int(centred)
        blocks = [self._lemma_matrix(squared, count, centred)]
        cost = np.zeros(count)
        if self.criterion == "h2":
            blocks.append(self._h2_matrix(count))
            trace = np.zeros(count)
            trace[[before + k for k, (i, j) in enumerate(triangle(q)) if i == j]] = 1.0
            if squared is None:
                cost = trace
            else:
                blocks.append((np.array([[squared]]), -trace[:, None, None]))
        elif self.criterion == "hinf" and squared is None:
            cost[before] = 1.0
        if self.criterion == "decay" and centred:
            below = np.zeros((count, n, n))
            below[:free] = -_symmetric_basis(n)
            blocks.append((np.eye(n), below))
        if centred:
            cost = np.zeros(count)
            cost[-1] = -1.0
            blocks = [(F, _with_margin(slope)) for F, slope in blocks]
            blocks.append((np.ones((1, 1)), -np.eye(count)[-1][:, None, None]))
        return _conic_form_of(blocks, cost)

    def _lemma_matrix(
        self, squared: float | None, count: int, centred: bool
    ) -> tuple[RealArray, RealArray]:
        """The matrix of the lemma as F_0, and its derivatives by the variables (count, size,
        size).
        """
        n, m = self.records.order, self.records.controls
        (A, B), (C, D) = self.plant, self.performance
        p, total, (h, e) = len(C), n + m, self.sizes
        H, E = self.spread * math.sqrt(e / h), self.uncertainty * math.sqrt(h / e)
        free, gains, before = self._counts
        start = np.cumsum([0, n, total, n, p])
        size = int(start[-1])
        F, slope = np.zeros((size, size)), np.zeros((count, size, size))
        first, second, third, last = (slice(*start[k : k + 2]) for k in range(4))
        basis = _symmetric_basis(n)
        rate = squared if self.criterion == "decay" and squared is not None else 1.0
        slope[:free, first, first] = rate * basis
        slope[:free, third, third] = basis
        slope[:free, first, third] = A @ basis
        slope[:free, second, third] = E[:, :n] @ basis
        slope[:free, last, third] = C @ basis
        each = np.eye(gains).reshape(gains, m, n)
        there = slice(free, free + gains)
        slope[there, first, third] = B @ each
        slope[there, second, third] = E[:, n:] @ each
        slope[there, last, third] = D @ each
        slope[:, third, : start[2]] = slope[:, : start[2], third].swapaxes(1, 2)
        slope[:, third, last] = slope[:, last, third].swapaxes(1, 2)
        slope[before - 1, first, first] = -H @ H.T
        slope[before - 1, second, second] = np.eye(total)
        if self.criterion == "hinf":
            F[first, first] = -self.disturbance @ self.disturbance.T
            if squared is None:
                slope[before, last, last] = np.eye(p)
            else:
                F[last, last] = squared * np.eye(p)
        else:
            F[last, last] = np.eye(p)
        if self.criterion == "decay" and not centred:
            F[first, first] = -np.eye(n)
        return F, slope

    def _h2_matrix(self, count: int) -> tuple[RealArray, RealArray]:
        """[V (T^-1 F)'; T^-1 F Y] as F_0, and its derivatives by the variables."""
        n, q = self.disturbance.shape
        free, _, before = self._counts
        F, slope = np.zeros((q + n, q + n)), np.zeros((count, q + n, q + n))
        F[q:, :q], F[:q, q:] = self.disturbance, self.disturbance.T
        slope[:free, q:, q:] = _symmetric_basis(n)
        slope[before : before + q * (q + 1) // 2, :q, :q] = _symmetric_basis(q)
        return F, slope


def _symmetric_basis(n: int) -> RealArray:
    """The symmetric matrices (n (n + 1) / 2, n, n), one for each entry of the upper triangle."""
    found = np.zeros((n * (n + 1) // 2, n, n))
    for k, (i, j) in enumerate(triangle(n)):
        found[k, i, j] = found[k, j, i] = 1.0
    return found


def _symmetric(entries: RealArray, n: int) -> RealArray:
    """The matrix whose upper triangle has these entries."""
    found: RealArray = np.tensordot(entries, _symmetric_basis(n), 1)
    return found


def _with_margin(slope: RealArray) -> RealArray:
    """Derivatives of F - t I, where t is the last variable."""
    found = slope.copy()
    found[-1] = -np.eye(slope.shape[1])
    return found


def _conic_form_of(blocks: list[tuple[RealArray, RealArray]], cost: RealArray) -> ConicForm:
    """The conic form with F_0 + sum of x_k F_k >= 0 for each block."""
    rows, right, cones = [], [], []
    for F, slope in blocks:
        places = triangle(len(F))
        i, j = (np.array(part) for part in zip(*places, strict=True))
        rows.append(csr_array(-slope[:, i, j].T))
        right.append(F[i, j])
        kind = ConeKind.SEMIDEFINITE if len(F) > 1 else ConeKind.NONNEGATIVE
        cones.append(ConeFactor(kind, len(F)))
    return ConicForm(cost, vstack(rows), np.concatenate(right), tuple(cones))
