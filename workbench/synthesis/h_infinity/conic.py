"""H-infinity synthesis by linear matrix inequalities, with any conic solver.

P. Gahinet, P. Apkarian, A linear matrix inequality approach to H-infinity control, Int. J. Robust
and Nonlinear Control 4 (1994) 421-448; P. Gahinet, Explicit controller formulas for LMI-based
H-infinity synthesis, Automatica 32 (1996) 1007-1014.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag, null_space

from workbench._core.arrays import RealArray
from workbench.accuracy import AccuracyRange
from workbench.executor import Context
from workbench.program import Claim, conic_method
from workbench.solvers import ConicSolver, Options, Outcome, slicot_routine, solve_conic
from workbench.synthesis.h_infinity.normalised import Scaled
from workbench.synthesis.h_infinity.program import HinfSynthesis
from workbench.synthesis.h_infinity.settling import Made, answered
from workbench.systems.norms import hinf_norm
from workbench.systems.realisation import Matrices
from workbench.systems.standard_plant import StandardPlant

MOST_STATES = 20
"""Largest number of states of a plant. The semidefinite programs of larger plants take too long."""
LEVEL_RISES = (2e-3, 1e-2, 5e-2)
"""Relative distances above the least level, tried until the loop's norm is at most its level."""
FINEST_ACCURACY = 1e-5
"""Finest accuracy asked of solvers. It is much finer than the distance kept from the least
level.
"""
LMI_ACCURACY = AccuracyRange(finest=FINEST_ACCURACY)
"""The range of tolerances that affect the LMIs."""
TRACE_RATIO = 4.0
"""Largest trace of X and Y, relative to the least trace, in the search for well-conditioned X and
Y.
"""


def _unfit(program: HinfSynthesis) -> str | None:
    """Why the method cannot solve the program; None where it can."""
    states = program.absorbed.plant.system.nstates
    if not states:
        return "it has no states"
    if states > MOST_STATES:
        return f"it has {states} states; LMIs are practical for at most {MOST_STATES}"
    return None


@conic_method(HinfSynthesis, optimal=False, unfit=_unfit, accuracy=LMI_ACCURACY)
def _conic(program: HinfSynthesis, context: Context, solver: ConicSolver) -> Claim:
    """The LMIs of Gahinet and Apkarian, at 2e-3 above the least level (up to 5e-2 if needed)."""
    options = replace(context.options, tolerance=max(context.options.accuracy, FINEST_ACCURACY))
    return answered(
        program,
        context,
        lambda normal: _make_controller(normal, program.gamma, solver, options, context),
    )


def _make_controller(
    normal: Scaled, gamma: float | None, solver: ConicSolver, options: Options, context: Context
) -> Made:
    """A controller for a level just above the least one, or for the given level."""
    import cvxpy as cp

    plant = _scaled_states(normal.plant)
    with context.stating():
        statement = _Statement(plant)
    held = [*statement.constraints, statement.margin == 0]
    problem = cp.Problem(cp.Minimize(statement.gamma), held)
    outcome, said = solve_conic(problem, solver, options, context)
    if outcome not in (Outcome.SOLVED, Outcome.INACCURATE):
        return Made(None, outcome=outcome, said=said)
    least = float(statement.gamma.value)
    if gamma is None:
        levels = [least * (1.0 + step) for step in LEVEL_RISES]
    elif gamma > least:
        levels = [gamma]
    else:
        message = f"{said}: no controller with a norm below {least:.6g} found; gamma is {gamma:.6g}"
        return Made(None, outcome=Outcome.INFEASIBLE, said=message)
    for trial in context.track(levels, "levels"):
        outcome, said = _centre(statement, trial, solver, options, context)
        if outcome not in (Outcome.SOLVED, Outcome.INACCURATE):
            continue
        try:
            K = normal.controller(_controller(plant, statement.X.value, statement.Y.value, trial))
            size = hinf_norm(normal.given.close(K))
        except (np.linalg.LinAlgError, ArithmeticError) as error:
            said = f"{said}; {error}"
            continue
        if size <= trial:
            none_below = least if gamma is None else math.nan
            return Made(K, size, trial, none_below, said=said)
        said = f"{said}; the loop of level {trial:.6g} has norm {size:.6g}"
    return Made(None, outcome=Outcome.FAILED, said=said)


def _scaled_states(plant: StandardPlant) -> StandardPlant:
    """The plant with states scaled so that A, B and C are small together; signals are not scaled.

    Unlike the Riccati equations, the inequalities have all these matrices, X and Y in one matrix.
    """
    tb01id = slicot_routine("tb01id")

    parts = plant.A.copy(), plant.B.copy(), plant.C.copy()
    _, A, B, C, _ = tb01id(plant.states, plant.B.shape[1], len(plant.C), 0.0, *parts)
    return replace(plant, A=A, B=B, C=C)


def _centre(
    statement: _Statement,
    gamma: float,
    solver: ConicSolver,
    options: Options,
    context: Context,
) -> tuple[Outcome, str]:
    """Find X and Y of a level well inside their constraints, since K is ill-conditioned at the
    boundary.
    """
    import cvxpy as cp

    size = cp.trace(statement.X) + cp.trace(statement.Y)
    fixed = statement.gamma == gamma
    smallest = cp.Problem(cp.Minimize(size), [*statement.constraints, statement.margin == 0, fixed])
    outcome, said = solve_conic(smallest, solver, options, context)
    if outcome not in (Outcome.SOLVED, Outcome.INACCURATE):
        return outcome, said
    larger = size <= TRACE_RATIO * float(size.value)
    inside = cp.Problem(cp.Maximize(statement.margin), [*statement.constraints, fixed, larger])
    return solve_conic(inside, solver, options, context)


class _Statement:
    """Variables gamma, X and Y, and the margin by which all inequalities hold."""

    def __init__(self, plant: StandardPlant) -> None:
        import cvxpy as cp

        n = plant.states
        self.gamma, self.margin = cp.Variable(nonneg=True), cp.Variable(nonneg=True)
        self.X = cp.Variable((n, n), symmetric=True)
        self.Y = cp.Variable((n, n), symmetric=True)
        one = np.eye(n)
        coupling = cp.bmat([[self.X, one], [one, self.Y]])
        self.constraints = [
            self._bounded_real(plant.A, plant.B1, plant.C1, plant.D11, plant.B2, plant.D12, self.X),
            self._bounded_real(
                *(plant.A.T, plant.C1.T, plant.B1.T, plant.D11.T, plant.C2.T, plant.D21.T), self.Y
            ),
            coupling >> self.margin * np.eye(2 * n),
        ]

    def _bounded_real(
        self,
        A: RealArray,
        B1: RealArray,
        C1: RealArray,
        D11: RealArray,
        B2: RealArray,
        D12: RealArray,
        X: Any,
    ) -> Any:
        """The bounded-real inequality in X on the complement of the range of [B2; D12]."""
        import cvxpy as cp

        z, w = D11.shape
        N = block_diag(null_space(np.vstack([B2, D12]).T), np.eye(w))
        matrix = cp.bmat(
            [
                [A @ X + X @ A.T, X @ C1.T, B1],
                [C1 @ X, -self.gamma * np.eye(z), D11],
                [B1.T, D11.T, -self.gamma * np.eye(w)],
            ]
        )
        inside = N.T @ matrix @ N
        return (inside + inside.T) / 2 << -self.margin * np.eye(N.shape[1])


def _controller(plant: StandardPlant, X: RealArray, Y: RealArray, gamma: float) -> Matrices:
    """A controller of the level from X and Y, [X I; I Y] > 0, where D12 and D21 have full rank.

    A change of variables makes the bounded-real inequality of the closed loop linear. C_hat and
    B_hat are chosen to minimise its diagonal blocks, and A_hat to make the block between them zero.
    """
    A, B1, B2, C1, C2 = plant.A, plant.B1, plant.B2, plant.C1, plant.C2
    D12, D21 = plant.D12, plant.D21
    Dk = _central_direct_term(plant, gamma)
    direct = plant.D11 + D12 @ Dk @ D21
    z, w = direct.shape
    W = np.linalg.inv(np.block([[gamma * np.eye(w), -direct.T], [-direct, gamma * np.eye(z)]]))
    W11, W12, W21, W22 = W[:w, :w], W[:w, w:], W[w:, :w], W[w:, w:]
    B, C = B1 + B2 @ Dk @ D21, C1 + D12 @ Dk @ C2
    C_hat = -np.linalg.solve(D12.T @ W22 @ D12, B2.T + D12.T @ (W21 @ B.T + W22 @ C1 @ X))
    B_hat = -np.linalg.solve(D21 @ W11 @ D21.T, C2 + D21 @ (W11 @ B1.T @ Y + W12 @ C)).T
    upper = np.hstack([B, X @ C1.T + C_hat.T @ D12.T])
    lower = np.hstack([Y @ B1 + B_hat @ D21, C.T])
    A_hat = -(A + B2 @ Dk @ C2).T - lower @ W @ upper.T
    # N M^T = I - Y X
    U, values, Vh = np.linalg.svd(np.eye(plant.states) - Y @ X)
    N, M = U * np.sqrt(values), Vh.T * np.sqrt(values)
    Ck = np.linalg.solve(M, (C_hat - Dk @ C2 @ X).T).T
    Bk = np.linalg.solve(N, B_hat - Y @ B2 @ Dk)
    inner = A_hat - N @ Bk @ C2 @ X - Y @ B2 @ Ck @ M.T - Y @ (A + B2 @ Dk @ C2) @ X
    return np.linalg.solve(N, np.linalg.solve(M, inner.T).T), Bk, Ck, Dk


def _central_direct_term(plant: StandardPlant, gamma: float) -> RealArray:
    """The central Dk with |D11 + D12 Dk D21| < gamma, for D12 = [0; I] and D21 = [0 I]."""
    D11 = plant.D11
    rows, columns = len(D11) - plant.controls, D11.shape[1] - plant.measurements
    D1111, D1112 = D11[:rows, :columns], D11[:rows, columns:]
    inner = gamma**2 * np.eye(rows) - D1111 @ D1111.T
    return -D11[rows:, :columns] @ D1111.T @ np.linalg.solve(inner, D1112) - D11[rows:, columns:]
