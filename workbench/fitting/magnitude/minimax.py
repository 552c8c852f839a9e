"""The step of differential correction as a linear program, and the method that iterates it."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.executor import Context
from workbench.fitting.magnitude.differential_correction import CorrectionStep, minimax
from workbench.fitting.magnitude.dual_simplex import DualSimplex
from workbench.fitting.magnitude.program import MagnitudeFit
from workbench.program import Claim, method
from workbench.solvers import Outcome

MAX_EXCHANGE_ROUNDS = 12
"""Largest number of solutions of a step's linear program; each adds rows where the last answer had
the wrong sign.
"""
LARGEST_CHANGE = 1e6
"""Largest change of a coefficient of N or D in a step; D has the mean 1, and N is of its size."""


@method(MagnitudeFit, "minimax", optimal=True)
def _minimax(program: MagnitudeFit, context: Context) -> Claim:
    """Differential correction by linear programs; globally optimal."""
    return minimax(program, linear_program, context), Outcome.SOLVED, ""


def linear_program(step: CorrectionStep) -> tuple[RealArray, RealArray, float] | None:
    """Answer of a step by the dual simplex method.

    Rows for positivity between the data are added in rounds, where it fails. The variables are the
    changes of N and D, that of D within the plane of constant mean, and t.
    """
    n = step.mean.size
    bases = (step.numerator, step.denominator)
    plane = np.linalg.qr(step.mean[:, None], mode="complete")[0][:, 1:]
    center = step.numerator.columns.mean(axis=0), step.mean / (step.mean @ step.mean)

    def rows_of(rows: RealArray) -> tuple[RealArray, RealArray]:
        """Rows in the variables, and right sides, from rows in N, D and t that must be <= 0."""
        of_N, of_D = rows[:, :n], rows[:, n:-1]
        moved = np.column_stack([of_N, of_D @ plane, rows[:, -1]])
        return moved, -(of_N @ center[0] + of_D @ center[1])

    signs = [
        _row_on_all_variables(row, side)
        for side, basis in enumerate(bases)
        for row in (basis.at_zero, basis.at_infinity, *basis(_undamped_frequencies(basis.roots)))
    ]
    rows = np.vstack(
        [
            np.column_stack([-step.upper, step.upper_slope]),
            np.column_stack([-step.lower, step.lower_slope]),
            -np.array(signs),
        ]
    )
    gain = np.append(np.zeros(2 * n - 1), 1.0)
    simplex = DualSimplex(gain, LARGEST_CHANGE)
    simplex.add(gain[None], np.ones(1))  # t <= 1: no error is negative
    simplex.add(*rows_of(rows))
    best = None
    for _ in range(MAX_EXCHANGE_ROUNDS):
        y = simplex.solve()
        if y is None:
            break
        found = center[0] + y[:n], center[1] + plane @ y[n:-1]
        best = (*found, float(y[-1]))
        added = [
            _row_on_all_variables(row, side)
            for side, basis in enumerate(bases)
            for row in basis(basis.negative(found[side]))
        ]
        if not added:
            break
        simplex.add(*rows_of(-np.array(added)))
    return best


def _undamped_frequencies(roots: ComplexArray) -> RealArray:
    """Frequencies [rad/s] of lightly damped roots, near which a sign may change."""
    return roots.imag[(roots.imag > 0) & (np.abs(roots.real) < 0.05 * np.abs(roots))]


def _row_on_all_variables(row: RealArray, side: int) -> RealArray:
    """Row on all variables (N, D and t) from a row on the coefficients of N (side 0) or D (1)."""
    row = row / np.linalg.norm(row)
    blank = np.zeros_like(row)
    return np.concatenate([blank, row, [0.0]] if side else [row, blank, [0.0]])
