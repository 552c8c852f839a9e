"""The step of differential correction as a linear program, and the method that iterates it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import ComplexArray, RealArray
from workbench.executor import Context
from workbench.fitting.magnitude.differential_correction import CorrectionStep, minimax
from workbench.fitting.magnitude.program import MagnitudeFit
from workbench.program import Claim, method
from workbench.solvers import Outcome

MAX_EXCHANGE_ROUNDS = 12
"""Most solutions of one step's linear program; each adds the rows that the last answer violated."""


@method(MagnitudeFit, "minimax", optimal=True)
def _minimax(program: MagnitudeFit, context: Context) -> Claim:
    """Differential correction by linear programs; globally optimal."""
    return minimax(program, linear_program, context), Outcome.SOLVED, ""


def linear_program(step: CorrectionStep) -> tuple[RealArray, RealArray, float] | None:
    """Answer of a step by the linear solver HiGHS.

    Only some rows are used at first; the violated ones, and positivity between the data where it
    fails, are added in rounds.
    """
    from scipy.optimize import linprog

    n = step.mean.size
    bases = (step.numerator, step.denominator)
    rows = np.vstack(
        [
            np.column_stack([-step.upper, step.upper_slope]),
            np.column_stack([-step.lower, step.lower_slope]),
        ]
    )
    signs = [
        _beside(row, side)
        for side, basis in enumerate(bases)
        for row in (basis.at_zero, basis.at_infinity, *basis(_undamped(basis.roots)))
    ]
    current = np.concatenate([b.columns.mean(axis=0) for b in bases] + [[0.0]])
    held = _peaks(rows @ current, len(step.upper))
    held[:: max(1, len(rows) // (8 * n))] = True
    cost = np.append(np.zeros(2 * n), -1.0)
    bounds = [(None, None)] * (2 * n) + [(None, 1.0)]
    best = None
    for _ in range(MAX_EXCHANGE_ROUNDS):
        used = np.vstack([rows[held], -np.array(signs)])
        answer = linprog(
            cost,
            A_ub=used,
            b_ub=np.zeros(len(used)),
            A_eq=np.concatenate([np.zeros(n), step.mean, [0.0]])[None],
            b_eq=[1.0],
            bounds=bounds,
            method="highs-ds",
            options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
        )
        if answer.x is None:
            return best
        beyond = rows @ answer.x
        missed = _peaks(beyond, len(step.upper)) & (beyond > 1e-9) & ~held
        found = answer.x[:n], answer.x[n:-1]
        added = [
            _beside(row, side)
            for side, basis in enumerate(bases)
            for row in basis(basis.negative(found[side]))
        ]
        best = (*found, float(answer.x[-1]))
        if not (added or missed.any()):
            break
        held |= missed
        signs += added
    return best


def _peaks(values: RealArray, split: int) -> NDArray[np.bool_]:
    """Mask of the local maxima of values, in the parts before and after ``split`` separately."""
    peaks = np.zeros(values.size, dtype=bool)
    for part in (slice(None, split), slice(split, None)):
        v = np.concatenate([[-np.inf], values[part], [-np.inf]])
        peaks[part] = (v[1:-1] >= v[:-2]) & (v[1:-1] >= v[2:])
    return peaks


def _undamped(roots: ComplexArray) -> RealArray:
    """Frequencies [rad/s] of lightly damped roots, near which a sign may change."""
    return roots.imag[(roots.imag > 0) & (np.abs(roots.real) < 0.05 * np.abs(roots))]


def _beside(row: RealArray, side: int) -> RealArray:
    """Row on all variables (N, D and t) from a row on the coefficients of N (side 0) or D (1)."""
    row = row / np.linalg.norm(row)
    blank = np.zeros_like(row)
    return np.concatenate([blank, row, [0.0]] if side else [row, blank, [0.0]])
