"""The sets of least trace by semidefinite programs, one for each frequency.

Minimise tr L / p + tr R / m subject to [[L, E_k - Z], [., R]] >= 0, whose optimum is twice that of
sqrt((tr L / p) (tr R / m)). The deviations are parameters, so the program is compiled only once.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import Array
from workbench.executor import Context
from workbench.program import Claim, conic_method
from workbench.solvers import ConicSolver, Outcome, solve_conic
from workbench.uncertainty.matrix_covers.sets.finish import containing_sets
from workbench.uncertainty.matrix_covers.sets.multipliers import with_touching_multipliers
from workbench.uncertainty.matrix_covers.sets.program import MatrixSets
from workbench.uncertainty.matrix_covers.sets.shapes import WeightShape


def _no_volume(program: MatrixSets) -> str | None:
    """The reason why the problem is no cone program; None if it is one."""
    fits = program.size == "trace"
    said = f'the size "{program.size}" is not convex in W_1 W_1^* and W_2^* W_2'
    return None if fits else f"{said}; take the method barrier"


@conic_method(MatrixSets, optimal=False, unfit=_no_volume)
def _conic(program: MatrixSets, context: Context, solver: ConicSolver) -> Claim:
    """Semidefinite programs, one for each frequency."""
    F, _, p, m = program.deviations.shape
    N = program.deviations.shape[1] + p * m
    with context.stating():
        statement = _Statement(program, N)
    P, S = np.zeros((F, p, p), complex), np.zeros((F, m, m), complex)
    Z = np.zeros((F, p, m), complex)
    outcome, said = Outcome.SOLVED, ""
    for f in context.track(range(F), "frequencies"):
        one, said = statement.solved(f, solver, context)
        if statement.left.value is None:
            return None, Outcome.FAILED, f"frequency number {f}: {said}"
        outcome = outcome if one is Outcome.SOLVED else one
        P[f], S[f], Z[f] = statement.answer()
    none = np.zeros((F, N, min(p, m)))
    return (
        with_touching_multipliers(program, containing_sets(program, P, S, Z, none)),
        outcome,
        said,
    )


class _Statement:
    """The program of one frequency, with the deviations as parameters."""

    def __init__(self, program: MatrixSets, N: int) -> None:
        import cvxpy as cp

        self.program = program
        p, m = program.deviations.shape[2:]
        self.left, self.right = _hermitian(p, program.left), _hermitian(m, program.right)
        self.E = [cp.Parameter((p, m), complex=True) for _ in range(N)]
        free = program.centre == "free"
        self.centre = cp.Variable((p, m), complex=True) if free else cp.Constant(np.zeros((p, m)))
        moving = program.deviations.shape[1]
        self.blocks = []
        for k, E in enumerate(self.E):
            away = E - self.centre if k < moving else E
            self.blocks.append(cp.bmat([[self.left, away], [away.H, self.right]]) >> 0)
        size = cp.real(cp.trace(self.left)) / p + cp.real(cp.trace(self.right)) / m
        self.problem = cp.Problem(cp.Minimize(size), self.blocks)

    def solved(self, f: int, solver: ConicSolver, context: Context) -> tuple[Outcome, str]:
        """Solve for the frequency with index f, in units of its channels."""
        rows, columns = self.program.channel_sizes
        self.unit = float(np.sqrt(rows[f].max() * columns[f].max()))
        mean = self.program.deviations[f].mean(axis=0)
        self.start = mean if self.program.centre == "free" else np.zeros_like(mean)
        away = self.program.away(self.start[None], at=np.array([f]))[0]
        for parameter, E in zip(self.E, away, strict=True):
            parameter.value = E / self.unit
        return solve_conic(self.problem, solver, context.options, context)

    def answer(self) -> tuple[Array, Array, Array]:
        """Inverse weights and centre of the last solution."""
        P = np.linalg.inv(np.linalg.cholesky(self.left.value) * self.unit)
        S = np.linalg.inv(np.linalg.cholesky(self.right.value)).conj().T
        Z = self.start + self.unit * np.asarray(self.centre.value)
        return P, S, Z


def _hermitian(n: int, shape: WeightShape) -> Any:
    """Hermitian matrix variable of a shape, in CVXPY."""
    import cvxpy as cp

    if shape == "full":
        return cp.Variable((n, n), hermitian=True)
    if shape == "diagonal":
        return cp.diag(cp.Variable(n))
    return cp.Variable() * np.eye(n)
