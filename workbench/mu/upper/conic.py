"""The D, G upper bound as a sequence of semidefinite programs, for every conic solver."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench.arrays import ComplexArray
from workbench.certify.mu_bound import certified
from workbench.executor import Context
from workbench.mu.upper.balance import NOTHING, balance
from workbench.mu.upper.pattern import DIAGONAL, Pattern, basis, fill, pattern_of, spread
from workbench.mu.upper.program import MuUpperBound, proved
from workbench.program import Claim, conic_method
from workbench.solvers import ConicSolver, Outcome, solve_conic

ROUNDS = 40
MIX = 1e-4


class _Statement:
    """One program for all M and all t: the greatest margin s <= 1 of the LMI.

        maximise s  subject to  t D_r - A(D, G) >= s R,   D > 0,   trace D = N

    with the coefficients of D and G, and R, as parameters. R is the D_r of the round before, which
    makes t fall superlinearly.
    """

    def __init__(self, pattern: Pattern, order: int) -> None:
        import cvxpy as cp

        self.pattern, self.order = pattern, order
        unknowns = pattern.row.size
        self.x, margin = cp.Variable(unknowns), cp.Variable()
        # A Hermitian matrix is positive where the real one of twice its size is.
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
        """The program with its parameters set."""
        columns = []
        for D, G in basis(self.pattern):
            left, right, twist = spread(self.pattern, D, G)
            X = 1j * (twist @ M)
            columns.append(_doubled(t * right - M.conj().T @ left @ M - X - X.conj().T).ravel())
        self.coefficients.value = np.stack(columns, axis=-1)
        self.reference.value = _doubled(reference).ravel()
        return self.problem


@conic_method(MuUpperBound, optimal=False)
def _conic(program: MuUpperBound, context: Context, solver: ConicSolver) -> Claim:
    """A sequence of LMIs, each at the bound that the multipliers of the last one prove."""
    structure = program.structure
    with context.stating():
        pattern = pattern_of(structure)
        statement = _Statement(pattern, structure.rows)
    batch = program.M.reshape(-1, structure.columns, structure.rows)
    D, G = np.zeros((2, len(batch), pattern.size, pattern.size), complex)
    worst, message = Outcome.SOLVED, ""
    for i in context.track(range(len(batch)), "matrices"):
        M, E = batch[i].copy(), np.ones(pattern.size)
        size = float(np.ldexp(1.0, np.frexp(np.abs(M).max())[1])) if M.any() else 1.0
        M /= size
        D[i] = np.eye(pattern.size)
        norm = balance(pattern, M, E) if M.any() else 0.0
        if norm > NOTHING:
            best = np.inf
            trial_D, trial_G = D[i].copy(), G[i].copy()
            for _ in range(ROUNDS):
                left, right, twist = spread(pattern, trial_D, trial_G)
                bound = float(certified(M / norm, structure, left, right, twist))
                if bound < best:
                    D[i], G[i] = trial_D, trial_G * norm
                if bound == 0.0 or bound**2 > best**2 * (1 - 0.1 * context.options.accuracy):
                    break
                best = bound
                problem = statement.at(M / norm, bound**2, right)
                outcome, message = solve_conic(problem, solver, context.options, context)
                if outcome not in (Outcome.SOLVED, Outcome.INACCURATE):
                    worst = outcome
                    break
                fill(pattern, statement.x.value, trial_D, trial_G)
                # A solver's D may be singular; a little of the last one, as valid, makes it proper.
                trial_D += MIX * D[i]
                trial_G += MIX * G[i] / norm
            else:
                worst = Outcome.INACCURATE
        ends = E[:, None] * E
        D[i] *= ends
        G[i] *= ends * size
    answer = proved(program, *_shaped(program, spread(pattern, D, G)))
    return answer, worst, message


def _shaped(program: MuUpperBound, parts: tuple[ComplexArray, ...]) -> list[ComplexArray]:
    return [part.reshape(*program.batch, *part.shape[-2:]) for part in parts]


def _doubled(A: ComplexArray) -> np.ndarray:
    """The real symmetric matrix of twice the size with the eigenvalues of a Hermitian one."""
    return np.block([[A.real, -A.imag], [A.imag, A.real]])
