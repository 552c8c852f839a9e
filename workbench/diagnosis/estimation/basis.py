"""Filters over a fixed stable basis, by a convex problem for given multipliers.

A filter u_f = (C (sI - A)^-1 B + D) y enters every channel affinely, and for given multipliers D, G
the upper bound of mixed mu is convex in the channel. Two steps alternate. A semidefinite program
finds the C and D with the least largest bound over a grid of frequencies; the mu upper bound then
finds new multipliers for that filter. Neither step can raise the bound. Every channel has its own
bound on its own grid. After each round the peak is certified between grid points as well; the
frequency of that peak joins the next grid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import Array
from workbench._core.heavy_types import StateSpace
from workbench.diagnosis.estimation.methods import nominal_filter
from workbench.diagnosis.estimation.program import Channel, FaultEstimation
from workbench.executor import Context
from workbench.mu import UpperBound, upper_bound
from workbench.program import Claim, method
from workbench.solvers import Outcome, conic_solvers, solve_conic
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import realisation

MOST_ALTERNATIONS = 15
"""Largest number of rounds of the two steps."""
SETTLED_FALL, PATIENCE = 1e-3, 3
"""The iteration ends when the peak falls by less than this fraction in this many rounds."""


@dataclass(frozen=True, eq=False)
class Basis:
    """All filters C (sI - A)^-1 B + D with the given A (n, n) and B (n, p).

    Unlike a `StateSpace`, it leaves C and D open, as the unknowns of a convex program.
    """

    A: Array
    B: Array
    outputs: int

    def response(self, omega: Array) -> Array:
        """Response [(j omega - A)^-1 B; I] of the basis at `omega` [rad/s] (F,): (F, n + p, p)."""
        n, p = self.B.shape
        system = realisation((self.A, self.B, np.eye(n), np.zeros((n, p))), 0.0)
        states = response(system, omega) if n else np.zeros((len(omega), 0, p))
        return np.concatenate([states, np.broadcast_to(np.eye(p), (len(omega), p, p))], axis=1)

    def filter(self, parameters: Array) -> StateSpace:
        """The filter with the parameters [C D], an array (outputs, n + p)."""
        n = len(self.A)
        return realisation((self.A, self.B, parameters[:, :n], parameters[:, n:]), 0.0)


@dataclass(frozen=True, eq=False)
class Constraint:
    """The bound of one channel at its frequencies (F,), as an inequality in [C D] and t.

    t D_r >= M^H D_l M + j (G M - M^H G^H),    M = M0 + U [C D] V

    `bound` has the multipliers D_l, D_r and G at each frequency.
    """

    M0: Array
    U: Array
    V: Array
    bound: UpperBound

    @classmethod
    def of(
        cls, program: FaultEstimation, K: StateSpace, basis: Basis, channel: Channel, more: Array
    ) -> Constraint:
        """The constraint of a channel, with the multipliers of the loop closed by the filter K.

        Its frequencies are a grid that resolves that loop, the ends of the band, and `more`
        [rad/s].
        """
        loop = program.loop(K, channel=channel)
        low, high = channel.band
        own = frequencies_of(loop.system)
        ends = [end for end in channel.band if 0.0 < end < np.inf]
        inside = own[(own >= low) & (own <= high)]
        omega = np.unique(np.concatenate([inside, ends, more[np.isfinite(more)]]))
        M = response(loop.system, omega)
        structure = loop.performance_structure
        parts = program.plant.channel(performance=None, exogenous=list(channel.inputs))
        P = response(parts.system, omega)
        p, m = parts.measurements, parts.controls
        V = basis.response(omega) @ P[:, -p:, :-m]
        return cls(P[:, :-p, :-m], P[:, :-p, -m:], V, upper_bound(M, structure))


@method(FaultEstimation, "basis", optimal=False)
def _basis(program: FaultEstimation, context: Context) -> Claim:
    """Least worst bound on the set by convex steps, with the poles of the start or of "riccati"."""
    start = program.start
    if start is None:
        found, outcome, said = nominal_filter(program, context, "riccati")
        if found is None:
            return None, outcome, said
        start = found.K
    basis = Basis(start.A, start.B, start.noutputs)
    best = program.answer(start)
    assert best is not None  # the given start is known to be stable
    history = [best.upper]
    beside: list[list[float]] = [[] for _ in program.channels]
    said = ""
    for _ in context.rounds(MOST_ALTERNATIONS, "basis"):
        constraints = [
            Constraint.of(program, best.K, basis, channel, np.array(more))
            for channel, more in zip(program.channels, beside, strict=True)
        ]
        parameters, outcome, said = _step(constraints, basis, context)
        if parameters is None:
            break
        trial = program.answer(basis.filter(parameters))
        assert trial is not None
        for more, channel in zip(beside, program.channels, strict=True):
            more.append(program.certified_peak(trial.K, channel=channel).omega)
        if trial.upper < best.upper:
            best = trial
        history.append(best.upper)
        context.record({"peak": best.upper})
        if len(history) > PATIENCE and history[-1] > (1 - SETTLED_FALL) * history[-1 - PATIENCE]:
            break
    return program.answer(best.K, history=tuple(history)), Outcome.SOLVED, said


def _step(
    constraints: list[Constraint], basis: Basis, context: Context
) -> tuple[Array | None, Outcome, str]:
    """The parameters [C D] with the least t that all constraints allow, and the solver's claim."""
    import cvxpy as cp

    with context.stating():
        # The unknowns x are scaled so that the basis is orthonormal over the grid.
        stacked = np.concatenate([each.V.transpose(0, 2, 1).reshape(-1, each.V.shape[1])
                                  for each in constraints])  # fmt: skip
        parts = np.vstack([stacked.real, stacked.imag])
        R = np.linalg.qr(parts / np.sqrt(len(parts)), mode="r")
        R += 1e-12 * np.linalg.norm(R) * np.eye(len(R))
        back = np.linalg.inv(R)
        x = cp.Variable(basis.outputs * len(back))
        t = cp.Variable()
        limits = []
        for each in constraints:
            for k in range(len(each.M0)):
                fixed, slopes, level = _matrices(each, k, back, basis.outputs)
                size = len(fixed)
                moved = cp.reshape(slopes @ x, (size, size), order="C")
                limits.append(fixed + moved + t * level >> 0)
        problem = cp.Problem(cp.Minimize(t), limits)
    solver = conic_solvers()[0]
    outcome, said = solve_conic(problem, solver, context.options, context)
    if x.value is None or outcome not in (Outcome.SOLVED, Outcome.INACCURATE):
        return None, outcome, said
    return x.value.reshape(basis.outputs, -1) @ back.T, outcome, said


def _matrices(each: Constraint, k: int, back: Array, outputs: int) -> tuple[Array, Array, Array]:
    """F0, the rows F_i of x, and F_t of the real inequality F0 + sum x_i F_i + t F_t >= 0.

    Schur: [t - Q(M), (L^H M E)^H; L^H M E, I] >= 0 with D_l = L L^H, E^H D_r E = I and
    Q = j E^H (G M - M^H G^H) E.
    """
    bound = each.bound
    L = np.linalg.cholesky(bound.D_left[k])
    E = np.linalg.inv(np.linalg.cholesky(bound.D_right[k])).conj().T
    G = E.conj().T @ bound.G[k]
    c, r = each.M0[k].shape

    def linear(M: Array) -> Array:
        Q = 1j * G @ M @ E
        Q = Q + Q.conj().T
        low = L.conj().T @ M @ E
        return _real(np.block([[-Q, low.conj().T], [low, np.zeros((c, c))]]))

    V = back.T @ each.V[k]
    slopes = [
        linear(np.outer(each.U[k][:, i], V[j])) for i in range(outputs) for j in range(len(V))
    ]
    one = _real(np.diag(np.concatenate([np.zeros(r), np.ones(c)])).astype(complex))
    level = _real(np.diag(np.concatenate([np.ones(r), np.zeros(c)])).astype(complex))
    rows = np.array(slopes).reshape(len(slopes), -1).T
    return linear(each.M0[k]) + one, rows, level


def _real(matrix: Array) -> Array:
    """A Hermitian matrix as a symmetric one of twice the size."""
    return np.block([[matrix.real, -matrix.imag], [matrix.imag, matrix.real]])
