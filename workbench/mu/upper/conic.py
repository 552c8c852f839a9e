"""The D, G upper bound of mu by a sequence of semidefinite programs, for every conic solver."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray
from workbench.certify.mu_bound import certified_bound
from workbench.executor import Context
from workbench.mu.upper.balance import balanced_batch
from workbench.mu.upper.pattern import (
    DIAGONAL,
    Pattern,
    basis,
    expanded_multipliers,
    fill,
    pattern_of,
)
from workbench.mu.upper.program import MuUpperBound, proved
from workbench.program import Claim, conic_method
from workbench.solvers import ConicSolver, Outcome, solve_conic

MOST_PROGRAMS = 40
"""Largest number of semidefinite programs solved for one matrix. Each lowers the bound, and they
end once it settles. With half of them the method may end as inaccurate; double costs time for those
that do not converge.
"""
LAST_MULTIPLIER_SHARE = 1e-4
"""Share of the last proper multipliers that is added to a solver's, which may be singular. It is
far above a solver's error, 1e-8. With half of it multipliers are nearer to singular; double loosens
a bound by as much, until the next program.
"""


class _Statement:
    """One semidefinite program for all M and all t: the greatest margin s <= 1 of the LMI.

        maximise s  subject to  t D_r - A(D, G) >= s R,   D > 0,   trace D = N

    Its parameters are the coefficients of D and G, and R. R is D_r of the previous program, which
    makes t converge superlinearly.
    """

    def __init__(self, pattern: Pattern, order: int) -> None:
        import cvxpy as cp

        self.pattern, self.order = pattern, order
        unknowns = pattern.row.size
        self.x, margin = cp.Variable(unknowns), cp.Variable()
        # A Hermitian matrix is positive if and only if its real form of twice the size is.
        self.coefficients = cp.Parameter((4 * order**2, unknowns))
        self.reference = cp.Parameter(4 * order**2)
        flat = self.coefficients @ self.x - self.reference * margin
        slack = cp.reshape(flat, (2 * order, 2 * order), order="C")
        matrices = np.stack([_doubled(D) for D, _ in basis(pattern)], axis=-1)
        D = cp.reshape(
            matrices.reshape(-1, unknowns) @ self.x, (2 * pattern.size, 2 * pattern.size), order="C"
        )
        trace = (pattern.kind == DIAGONAL) & ~pattern.skew
        self.problem = cp.Problem(
            cp.Maximize(margin),
            [
                (slack + slack.T) / 2 >> 0,
                (D + D.T) / 2 >> 0,
                trace.astype(float) @ self.x == pattern.size,
                margin <= 1,
            ],
        )

    def at(self, M: ComplexArray, t: float, reference: ComplexArray) -> Any:
        """The program with its parameters set for M (c, r), t and the D_r ``reference``."""
        columns = []
        for D, G in basis(self.pattern):
            left, right, twist = expanded_multipliers(self.pattern, D, G)
            X = 1j * (twist @ M)
            columns.append(_doubled(t * right - M.conj().T @ left @ M - X - X.conj().T).ravel())
        self.coefficients.value = np.stack(columns, axis=-1)
        self.reference.value = _doubled(reference).ravel()
        return self.problem


@conic_method(MuUpperBound, optimal=False)
def _conic(program: MuUpperBound, context: Context, solver: ConicSolver) -> Claim:
    """A sequence of LMIs, each at the bound that the multipliers of the previous one prove."""
    structure = program.structure
    with context.stating():
        pattern = pattern_of(structure)
        statement = _Statement(pattern, structure.rows)
    batch = program.M.reshape(-1, structure.columns, structure.rows)
    D, G = np.zeros((2, len(batch), pattern.size, pattern.size), complex)
    scaled, E, scale = balanced_batch(batch, pattern)
    worst, message = Outcome.SOLVED, ""
    for i in context.track(range(len(batch)), "matrices"):
        M, norm = scaled[i], np.linalg.norm(scaled[i])
        D[i] = np.eye(pattern.size)
        if scale[i] > 0:
            best = np.inf
            trial_D, trial_G = D[i].copy(), G[i].copy()
            for round_ in range(MOST_PROGRAMS):
                left, right, twist = expanded_multipliers(pattern, trial_D, trial_G)
                bound = float(certified_bound(M / norm, structure, left, right, twist))
                if bound < best:
                    D[i], G[i] = trial_D, trial_G * norm
                if bound == 0.0 or bound**2 > best**2 * (1 - 0.1 * context.options.accuracy):
                    break
                best = bound
                problem = statement.at(M / norm, bound**2, right)
                outcome, message = solve_conic(problem, solver, context.options, context)
                if outcome is Outcome.FAILED and round_ == 0:
                    # The multipliers so far come from balancing; they would not be an answer of
                    # this solver.
                    return None, outcome, message
                if outcome not in (Outcome.SOLVED, Outcome.INACCURATE):
                    worst = outcome
                    break
                fill(pattern, statement.x.value, trial_D, trial_G)
                # A solver's D may be singular; adding a little of the last D makes it regular.
                trial_D += LAST_MULTIPLIER_SHARE * D[i]
                trial_G += LAST_MULTIPLIER_SHARE * G[i] / norm
            else:
                worst = Outcome.INACCURATE
        ends = E[i][:, None] * E[i]
        D[i] *= ends
        G[i] *= ends * scale[i]
    answer = proved(
        program.M, program.structure, *_shaped(program, expanded_multipliers(pattern, D, G))
    )
    return answer, worst, message


def _shaped(program: MuUpperBound, parts: tuple[ComplexArray, ...]) -> list[ComplexArray]:
    """Matrices in the shape of the program's batch."""
    return [part.reshape(*program.batch, *part.shape[-2:]) for part in parts]


def _doubled(A: ComplexArray) -> np.ndarray:
    """The real symmetric matrix of twice the size with the eigenvalues of a Hermitian one."""
    return np.block([[A.real, -A.imag], [A.imag, A.real]])
