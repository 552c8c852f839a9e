"""Dwell times by linear matrix inequalities, with any conic solver."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.accuracy import AccuracyRange
from workbench.executor import Context
from workbench.program import Claim, conic_method
from workbench.solvers import ConicSolver, Options, Outcome, solve_conic
from workbench.synthesis.switching.dwell_search import (
    MOST_CUTS,
    added_stays,
    congruent,
    coordinates,
    first_stays,
    shortest_proven,
    symmetric,
)
from workbench.synthesis.switching.program import FALL_MARGIN, Dwell, SwitchedStability

LMI_ACCURACY = 1e-5
"""Finest accuracy asked of solvers. It suffices, because P satisfies the inequalities with a
margin.
"""
MOST_TURNS, TURNING_RATIO = 2, 1.01
"""Largest number of changes of coordinates, and the largest ratio of V for which one is tried. The
new coordinates make the P found last close to 1. In other coordinates the margin may be small
compared with P, and then the solver's inaccuracy hides it.
"""
EIGENVALUE_FLOOR = 1e-6
"""Eigenvalues of P are raised to this share of the largest one."""
LEAST_MARGIN = 1e-9
"""The inequalities count as infeasible if their margin is below this, for P with mean trace n."""


@conic_method(SwitchedStability, optimal=False, accuracy=AccuracyRange(finest=LMI_ACCURACY))
def _conic(program: SwitchedStability, context: Context, solver: ConicSolver) -> Claim:
    """Bisection over the dwell time, with a feasibility problem for each dwell time."""
    options = replace(context.options, tolerance=max(context.options.accuracy, LMI_ACCURACY))
    units = coordinates(program)
    sure, said = True, program.destabilising[1]

    def proven(samples: int) -> Dwell | None:
        nonlocal said, sure
        found, said, told = _feasible(program, samples, units, solver, options, context)
        sure = sure and told
        return found

    best = shortest_proven(program, proven, context)
    if best is None:
        none = Outcome.INFEASIBLE if sure else Outcome.FAILED
        return None, none, f"{said}: no dwell up to {program.limit_samples} samples is proven"
    return best, Outcome.SOLVED, said


def _feasible(
    program: SwitchedStability,
    samples: int,
    L: RealArray,
    solver: ConicSolver,
    options: Options,
    context: Context,
) -> tuple[Dwell | None, str, bool]:
    """Matrices P that prove a dwell time, with all inequalities recomputed; None where none was
    found.

    Also returns a message, and whether the solver is sure of the result.
    """
    stays = [first_stays(program.stays(mode, samples)) for mode in program.modes]
    turns = 0
    for _ in range(MOST_CUTS):
        P, margin, outcome, said = _largest_margin(program, stays, L, solver, options, context)
        if P is None:
            return None, said, False
        found = Dwell(samples, np.stack([L @ _positive(Q) @ L.T for Q in P]))
        checks = {check.name: check for check in program.checks(found, FALL_MARGIN)}
        if margin >= LEAST_MARGIN and all(check.holds for check in checks.values()):
            return found, said, True
        if not checks["positive"].holds:
            return None, f"{said}; its P is not positive definite", False
        worst = [program.ratios(found, i) for i in range(len(program.modes))]
        if margin >= LEAST_MARGIN and added_stays(
            program, samples, stays, [ratio for ratio, _ in worst]
        ):
            continue
        turns += 1
        if (
            turns > MOST_TURNS
            or max(max(ratio.max(), decay) for ratio, decay in worst) > TURNING_RATIO
        ):
            none = margin < LEAST_MARGIN and outcome is Outcome.SOLVED
            return None, f"{said}; its P does not hold when recomputed", none
        L = L @ np.linalg.cholesky(_positive(np.mean(P, axis=0)))
    return None, f"{said}; some stay's inequality failed in each of {MOST_CUTS} rounds", False


def _largest_margin(
    program: SwitchedStability,
    stays: list[list[int]],
    L: RealArray,
    solver: ConicSolver,
    options: Options,
    context: Context,
) -> tuple[list[RealArray] | None, float, Outcome, str]:
    """Matrices P, in coordinates L' x, that maximise the margin of the inequalities for some stays.

    Returns P (None without a solution), the margin, the outcome and a message.
    """
    import cvxpy as cp

    modes, n = program.modes, program.states
    with context.stating():
        P = [cp.Variable((n, n), symmetric=True) for _ in modes]
        margin = cp.Variable()
        held = [Q >> margin * np.eye(n) for Q in P]
        held.append(sum(cp.trace(Q) for Q in P) == n * len(modes))
        for i, mode in enumerate(modes):
            if mode.longest_samples is None:
                held += [_decrease(one, P[i], P[i], margin) for one in congruent(mode.decaying, L)]
            held += [
                _decrease(one, P[j], P[i], margin)
                for stay in stays[i]
                for one in congruent(mode.over(stay), L)
                for j in range(len(modes))
                if j != i
            ]
    problem = cp.Problem(cp.Maximize(margin), held)
    outcome, said = solve_conic(problem, solver, options, context)
    if outcome not in (Outcome.SOLVED, Outcome.INACCURATE):
        return None, -np.inf, outcome, said
    return [symmetric(Q.value) for Q in P], float(margin.value), outcome, said


def _decrease(A: RealArray, P: Any, Q: Any, margin: Any) -> Any:
    """The inequality A' P A <= Q with a margin, symmetric by construction."""
    left = A.T @ P @ A
    return Q - (left + left.T) / 2 >> margin * np.eye(len(A))


def _positive(P: RealArray) -> RealArray:
    """P with its eigenvalues raised to at least `EIGENVALUE_FLOOR` times the largest."""
    values, vectors = np.linalg.eigh(P)
    return symmetric(vectors * np.maximum(values, EIGENVALUE_FLOOR * values[-1]) @ vectors.T)
