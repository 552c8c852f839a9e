"""Dwell times by linear matrix inequalities, for every conic solver."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import matrix_balance, solve_discrete_lyapunov

from workbench.arrays import RealArray
from workbench.executor import Context
from workbench.program import Claim, conic_method
from workbench.solvers import ConicSolver, Options, Outcome, solve_conic
from workbench.synthesis.switching.program import ROUNDING, Dwell, SwitchedStability

ACCURACY = 1e-5
"""Finest accuracy asked of solvers: P is looked for well inside the inequalities."""
BEGUN = 5
"""Stays whose inequalities are stated from the start."""
CUTS = 12
"""How often stays are added whose inequality did not hold."""
TURNS, NEAR = 2, 1.01
"""How often the coordinates are turned to those of the P found, where V nearly falls. A margin that
is small beside P is lost in the accuracy of a solver; where P is about 1 it shows."""
FLAT = 1e-6
"""Least eigenvalue of P for that, relative."""
LEAST = 1e-9
"""Margin below which the inequalities count as infeasible, the traces of P being n."""


@conic_method(SwitchedStability, optimal=False)
def _conic(program: SwitchedStability, context: Context, solver: ConicSolver) -> Claim:
    """Feasibility of the inequalities by bisection over the dwell time."""
    options = replace(context.options, tolerance=max(context.options.accuracy, ACCURACY))
    units = coordinates(program)
    # What a periodic switching excludes need not be tried.
    failed, said = program.destabilising
    sure, step = True, 1

    def proven(samples: int) -> Dwell | None:
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
    """L (n, n) of coordinates L' x in which the states are as large as any mode makes them.

    L L' is the sum over modes and plants of what V = x' Q x adds up to while a mode is stayed in,

        sum (A^k)' Q A^k,    k = 0, 1, ..., longest,

    with Q the squares of the units that balance sum |A|. A single mode would leave the scale of
    those states open that it does not use and another does.
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
    """Sum of (A^k)' A^k for k = 0, ..., longest; of all k where there is none, A being stable."""
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
    """P for a dwell, all inequalities recomputed; None where none was found, and whether there is
    none as far as the solver can tell."""
    stays = [_some(program.stays(mode, samples)) for mode in program.modes]
    turns = 0
    for _ in range(CUTS):
        P, margin, outcome, said = _program(program, stays, L, solver, options, context)
        if P is None:
            return None, said, False
        found = Dwell(samples, np.stack([L @ _positive(Q) @ L.T for Q in P]))
        checks = {check.name: check for check in program.checks(found, ROUNDING)}
        if margin >= LEAST and all(check.holds for check in checks.values()):
            return found, said, True
        if not checks["positive"].holds:
            return None, f"{said}; its P is not positive definite", False
        worst = [program.ratios(found, i) for i in range(len(program.modes))]
        if margin >= LEAST and _added(program, samples, stays, [ratio for ratio, _ in worst]):
            continue
        turns += 1
        if turns > TURNS or max(max(ratio.max(), decay) for ratio, decay in worst) > NEAR:
            none = margin < LEAST and outcome is Outcome.SOLVED
            return None, f"{said}; its P does not hold when recomputed", none
        L = L @ np.linalg.cholesky(_positive(np.mean(P, axis=0)))
    return None, f"{said}; some stay's inequality failed in each of {CUTS} rounds", False


def _program(
    program: SwitchedStability,
    stays: list[list[int]],
    L: RealArray,
    solver: ConicSolver,
    options: Options,
    context: Context,
) -> tuple[list[RealArray] | None, float, Outcome, str]:
    """P in coordinates L' x of the largest margin of the inequalities at some stays."""
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
    """Whether there are stays to add whose inequality does not hold; they are."""
    added = False
    for mode, own, ratio in zip(program.modes, stays, ratios, strict=True):
        worst = program.stays(mode, samples)[int(np.argmax(ratio))]
        if ratio.max() > 1.0 - ROUNDING and worst not in own:
            own.append(worst)
            added = True
    return added


def _some(stays: range) -> list[int]:
    """A few of the stays to begin with, the first and the last among them."""
    places = np.unique(np.geomspace(1, len(stays), BEGUN).round().astype(int)) - 1
    return [stays[int(place)] for place in places]


def _turned(A: RealArray, L: RealArray) -> RealArray:
    """A (V, n, n) in coordinates L' x."""
    return np.asarray(np.linalg.solve(L, (L.T @ A).mT).mT, dtype=float)


def _falls(A: RealArray, P: Any, Q: Any, margin: Any) -> Any:
    """A' P A <= Q with a margin, symmetric by construction."""
    left = A.T @ P @ A
    return Q - (left + left.T) / 2 >> margin * np.eye(len(A))


def _symmetric(P: RealArray) -> RealArray:
    both: RealArray = (P + P.T) / 2
    return both


def _positive(P: RealArray) -> RealArray:
    """P with no eigenvalue below FLAT of its largest."""
    values, vectors = np.linalg.eigh(P)
    return _symmetric(vectors * np.maximum(values, FLAT * values[-1]) @ vectors.T)
