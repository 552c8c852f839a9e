"""H2 synthesis by linear matrix inequalities, with any conic solver.

Consider all X for which x' X x is at most the future cost from state x. The largest X solves the
Riccati equation (J. C. Willems, Least squares stationary optimal control and the algebraic Riccati
equation, IEEE Trans. Automatic Control 16 (1971) 621-634): semidefinite programs for X and Y
replace the Riccati equations.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench._core.arrays import RealArray
from workbench.accuracy import AccuracyRange
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.program import Claim, conic_method
from workbench.solvers import ConicSolver, Outcome, solve_conic
from workbench.synthesis.h2.methods import claim_of_step
from workbench.synthesis.h2.program import H2Synthesis
from workbench.synthesis.h2.separation import Separated, separated_controller
from workbench.systems.standard_plant import StandardPlant

MOST_STATES = 30
"""Largest number of states of a plant. The semidefinite programs of larger plants take too long."""
FINEST_ACCURACY = 1e-8
"""Finest accuracy asked of solvers."""


def _unfit(program: H2Synthesis) -> str | None:
    """Why the method cannot solve the program; None where it can."""
    states = program.plant.system.nstates
    if not states:
        return "it has no states"
    if states > MOST_STATES:
        return f"it has {states} states; LMIs are practical for at most {MOST_STATES}"
    return None


@conic_method(
    H2Synthesis, optimal=False, unfit=_unfit, accuracy=AccuracyRange(finest=FINEST_ACCURACY)
)
def _conic(program: H2Synthesis, context: Context, solver: ConicSolver) -> Claim:
    """Linear matrix inequalities give the largest X and Y below the future costs."""

    def step(plant: StandardPlant) -> Separated:
        return separated_controller(
            plant,
            _largest_value_matrix(plant, solver, context),
            _largest_value_matrix(plant.dual, solver, context),
        )

    answer, outcome, said = claim_of_step(program, step)
    # the norm from X and Y is only as accurate as the solver, so it is not claimed as the least
    return answer and replace(answer, least=float("nan")), outcome, said


def _largest_value_matrix(plant: StandardPlant, solver: ConicSolver, context: Context) -> RealArray:
    """The largest X for which x' X x is at most the future cost of the control problem."""
    import cvxpy as cp

    A, B, C, D = plant.A, plant.B2, plant.C1, plant.D12
    X = cp.Variable(A.shape, symmetric=True)
    if plant.dt:
        corner, side, end = A.T @ X @ A - X, A.T @ X @ B, B.T @ X @ B
    else:
        corner, side, end = A.T @ X + X @ A, X @ B, np.zeros((B.shape[1], B.shape[1]))
    matrix = cp.bmat(
        [
            [corner + C.T @ C, side + C.T @ D],
            [(side + C.T @ D).T, end + D.T @ D],
        ]
    )
    problem = cp.Problem(cp.Maximize(cp.trace(X)), [(matrix + matrix.T) / 2 >> 0])
    outcome, said = solve_conic(problem, solver, context.options, context)
    if outcome not in (Outcome.SOLVED, Outcome.INACCURATE):
        raise SolverError(said)
    found: RealArray = X.value
    return found
