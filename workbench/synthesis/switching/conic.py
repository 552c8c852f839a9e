"""Dwell times by linear matrix inequalities, for every conic solver."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import matrix_balance, solve_discrete_lyapunov

from workbench.accuracy import AccuracyRange
from workbench.arrays import RealArray
from workbench.executor import Context
from workbench.program import Claim, conic_method
from workbench.solvers import ConicSolver, Options, Outcome, solve_conic
from workbench.synthesis.switching.program import FALL_MARGIN, Dwell, SwitchedStability

LMI_ACCURACY = 1e-5
"""Finest accuracy asked of solvers; P is sought well inside the inequalities."""
FIRST_STAYS = 5
"""Number of stays of a mode whose inequalities are stated at first."""
MOST_CUTS = 12
"""Most rounds in which stays with violated inequalities are added."""
MOST_TURNS, TURNING_RATIO = 2, 1.01
"""Most changes to the coordinates of the P found, and the largest ratio of V for which such a
change is tried. A margin that is small compared with P is lost in the accuracy of a solver; in
coordinates in which P is near 1 it shows."""
EIGENVALUE_FLOOR = 1e-6
"""Eigenvalues of P are raised to this share of the largest one."""
LEAST_MARGIN = 1e-9
"""The inequalities count as infeasible if their margin is smaller, for P of trace n."""


@conic_method(SwitchedStability, optimal=False, accuracy=AccuracyRange(finest=LMI_ACCURACY))
def _conic(program: SwitchedStability, context: Context, solver: ConicSolver) -> Claim:
    """Bisection over the dwell time with a feasibility problem for each."""
    options = replace(context.options, tolerance=max(context.options.accuracy, LMI_ACCURACY))
    units = coordinates(program)
    # Dwell times that a periodic switching makes unstable need not be tried.
    failed, said = program.destabilising
    sure, step = True, 1

    def proven(samples: int) -> Dwell | None:
        """The dwell with its proof; None where none was found."""
        nonlocal said, sure
        found = None
        for _ in context.track([samples], "dwell time"):
            found, said, told = _feasible(program, samples, units, solver, options, context)
            sure = sure and told
        return found

    best = None
    while best is None and failed < program.limit:
        trial = min(failed + step, program.limit)
        best = proven(trial)
        if best is None:
            failed, step = trial, 2 * step
    if best is None:
        none = Outcome.INFEASIBLE if sure else Outcome.FAILED
        return None, none, f"{said}: no dwell up to {program.limit} samples is proven"
    while best.samples - failed > 1:
        middle = (failed + best.samples) // 2
        found = proven(middle)
        if found is None:
            failed = middle
        else:
            best = found
    return best, Outcome.SOLVED, said


def coordinates(program: SwitchedStability) -> RealArray:
    """L (n, n) of coordinates L' x in which all states have similar sizes.

    L L' is the sum, over modes and plants, of the values of V = x' Q x during a stay,

        sum (A^k)' Q A^k,    k = 0, 1, ..., longest,

    where Q holds the squares of the units that balance sum |A|. A single mode would leave open the
    scale of states that only another mode uses.
    """
    every = np.concatenate([mode.A for mode in program.modes])
    _, (units, _) = matrix_balance(abs(every).sum(axis=0), permute=False, separate=True)
    sums = [
        _summed(A / units[:, None] * units, mode.longest)
        for mode in program.modes
        for A in (mode.A if mode.longest else mode.decaying)
    ]
    root = np.linalg.cholesky(_symmetric(np.sum(sums, axis=0)))
    return np.asarray(root / units[:, None], dtype=float)


def _summed(A: RealArray, longest: int | None) -> RealArray:
    """Sum of (A^k)' A^k for k = 0, ..., longest; for a stable A without a longest stay, all k."""
    if longest is None:
        return np.asarray(solve_discrete_lyapunov(A.T, np.eye(len(A))))
    total = power = np.eye(len(A))
    for _ in range(longest):
        power = A @ power
        total = total + power.T @ power
    return total


def _feasible(
    program: SwitchedStability,
    samples: int,
    L: RealArray,
    solver: ConicSolver,
    options: Options,
    context: Context,
) -> tuple[Dwell | None, str, bool]:
    """A proof P for a dwell time, with all inequalities recomputed; None where none was found.

    Also returns a message, and whether the solver is sure of the result.
    """
    stays = [_some(program.stays(mode, samples)) for mode in program.modes]
    turns = 0
    for _ in range(MOST_CUTS):
        P, margin, outcome, said = _program(program, stays, L, solver, options, context)
        if P is None:
            return None, said, False
        found = Dwell(samples, np.stack([L @ _positive(Q) @ L.T for Q in P]))
        checks = {check.name: check for check in program.checks(found, FALL_MARGIN)}
        if margin >= LEAST_MARGIN and all(check.holds for check in checks.values()):
            return found, said, True
        if not checks["positive"].holds:
            return None, f"{said}; its P is not positive definite", False
        worst = [program.ratios(found, i) for i in range(len(program.modes))]
        if margin >= LEAST_MARGIN and _added(
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


def _program(
    program: SwitchedStability,
    stays: list[list[int]],
    L: RealArray,
    solver: ConicSolver,
    options: Options,
    context: Context,
) -> tuple[list[RealArray] | None, float, Outcome, str]:
    """P, in coordinates L' x, with the largest margin of the inequalities at some stays.

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
            if mode.longest is None:
                held += [_falls(one, P[i], P[i], margin) for one in _turned(mode.decaying, L)]
            held += [
                _falls(one, P[j], P[i], margin)
                for stay in stays[i]
                for one in _turned(mode.over(stay), L)
                for j in range(len(modes))
                if j != i
            ]
    problem = cp.Problem(cp.Maximize(margin), held)
    outcome, said = solve_conic(problem, solver, options, context)
    if outcome not in (Outcome.SOLVED, Outcome.INACCURATE):
        return None, -np.inf, outcome, said
    return [_symmetric(Q.value) for Q in P], float(margin.value), outcome, said


def _added(
    program: SwitchedStability, samples: int, stays: list[list[int]], ratios: list[RealArray]
) -> bool:
    """Add the stay of each mode with the worst violated inequality; whether any was added."""
    added = False
    for mode, own, ratio in zip(program.modes, stays, ratios, strict=True):
        worst = program.stays(mode, samples)[int(np.argmax(ratio))]
        if ratio.max() > 1.0 - FALL_MARGIN and worst not in own:
            own.append(worst)
            added = True
    return added


def _some(stays: range) -> list[int]:
    """A few of the stays to start with, including the first and the last."""
    places = np.unique(np.geomspace(1, len(stays), FIRST_STAYS).round().astype(int)) - 1
    return [stays[int(place)] for place in places]


def _turned(A: RealArray, L: RealArray) -> RealArray:
    """A (V, n, n) transformed to coordinates L' x."""
    return np.asarray(np.linalg.solve(L, (L.T @ A).mT).mT, dtype=float)


def _falls(A: RealArray, P: Any, Q: Any, margin: Any) -> Any:
    """The inequality A' P A <= Q with a margin, symmetric by construction."""
    left = A.T @ P @ A
    return Q - (left + left.T) / 2 >> margin * np.eye(len(A))


def _symmetric(P: RealArray) -> RealArray:
    """The symmetric part."""
    both: RealArray = (P + P.T) / 2
    return both


def _positive(P: RealArray) -> RealArray:
    """P with its eigenvalues raised to at least `EIGENVALUE_FLOOR` times the largest."""
    values, vectors = np.linalg.eigh(P)
    return _symmetric(vectors * np.maximum(values, EIGENVALUE_FLOOR * values[-1]) @ vectors.T)
