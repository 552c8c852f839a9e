"""The step of differential correction as a semidefinite program, for every conic solver."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.executor import Context
from workbench.fitting.magnitude.differential_correction import CorrectionStep, minimax
from workbench.fitting.magnitude.program import MagnitudeFit
from workbench.fitting.magnitude.squared import SquaredBasis
from workbench.program import Claim, conic_method
from workbench.solvers import ConicSolver, Outcome, solve_conic

LARGEST_CONIC_ORDER = 6
"""Largest order of a fit; Gram matrices of higher orders are too near singular for the solvers."""


def _too_large(program: MagnitudeFit) -> str | None:
    """Reason why the order is too large for conic solvers; None if it is not."""
    if program.order <= LARGEST_CONIC_ORDER:
        return None
    return f"its Gram matrices are sound up to order {LARGEST_CONIC_ORDER}; use minimax"


@conic_method(MagnitudeFit, unfit=_too_large)
def _conic(program: MagnitudeFit, context: Context, solver: ConicSolver) -> Claim:
    """Differential correction by semidefinite programs: Gram matrices of N and D."""
    messages = [""]

    def step(statement: CorrectionStep) -> tuple[RealArray, RealArray, float] | None:
        with context.stating():
            problem, numerator, denominator, fall = _statement(statement)
        messages.append(solve_conic(problem, solver, context.options, context)[1])
        if fall.value is None:
            return None
        return numerator.value, denominator.value, float(fall.value)

    # The last step may fail, since it gains nothing; the certificate says whether the fit is
    # optimal.
    return minimax(program, step, context), Outcome.SOLVED, messages[-1]


def _statement(step: CorrectionStep) -> tuple[Any, Any, Any, Any]:
    """Semidefinite program of a step, and its variables: coefficients of N and of D, and t."""
    import cvxpy as cp

    n = step.mean.size
    numerator, denominator, fall = cp.Variable(n), cp.Variable(n), cp.Variable()
    both = cp.hstack([numerator, denominator])
    constraints = [
        step.upper @ both >= step.upper_slope * fall,
        step.lower @ both >= step.lower_slope * fall,
        step.mean @ denominator == 1,
        fall <= 1,
    ]
    for basis, coefficients in ((step.numerator, numerator), (step.denominator, denominator)):
        gram = cp.Variable((n, n), PSD=True)
        constraints += [
            row @ coefficients == cp.sum(cp.multiply(products, gram))
            for row, products in zip(*_spectral(basis), strict=True)
        ]
    return cp.Problem(cp.Maximize(fall), constraints), numerator, denominator, fall


def _spectral(basis: SquaredBasis) -> tuple[RealArray, RealArray]:
    """Rows of the basis, and products b b^H of the spectral basis b, at n + 1 frequencies.

    Every polynomial f that is positive for x >= 0 has the form Q(x) f(x) = |q(j omega)|^2 b^H X b
    with X real, symmetric and positive semidefinite. Here b spans 1 and 1 / (s - node), made
    orthonormal over the frequencies of the fit.
    """
    omega, nodes = basis.omega, basis.nodes
    pairs = np.flatnonzero(nodes.imag > 0)

    def functions(at: RealArray) -> np.ndarray:
        s = 1j * at[:, None]
        b = np.abs(nodes) / (s - nodes)
        both = b[:, pairs] + b[:, pairs + 1], 1j * (b[:, pairs] - b[:, pairs + 1])
        b[:, pairs], b[:, pairs + 1] = both
        return np.column_stack([np.ones(at.size), b])

    parts = functions(omega)
    triangle = np.linalg.qr(np.vstack([parts.real, parts.imag]), mode="r")
    span = np.geomspace(omega[0], omega[-1], 4 * nodes.size + 4)
    at = span[_spread(basis(span) / basis.relative(span)[:, None])]
    b = functions(at) @ np.linalg.inv(triangle) * np.sqrt(omega.size)
    products = np.einsum("ki,kj->kij", b.conj(), b).real
    return basis(at) / basis.relative(at)[:, None], products


def _spread(rows: RealArray) -> np.ndarray:
    """Indices of the most independent rows, as many as there are columns."""
    from scipy.linalg import qr

    _, _, order = qr(rows.T, pivoting=True, mode="economic")
    return np.sort(order[: rows.shape[1]])
