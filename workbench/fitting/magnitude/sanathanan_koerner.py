"""Magnitude fits by iteratively reweighted linear least squares."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.executor import Context
from workbench.fitting.magnitude.gain import Target, target_of, with_best_gain
from workbench.fitting.magnitude.program import MagnitudeFit
from workbench.fitting.magnitude.squared import SquaredBasis, stable_roots
from workbench.fitting.rational import Rational
from workbench.program import Claim, method
from workbench.solvers import Outcome

ITERATIONS = 12
"""Number of reweighted least-squares fits; the best one is kept."""


@method(MagnitudeFit, "sk", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _sk(program: MagnitudeFit, context: Context) -> Claim:
    """Sanathanan-Koerner iteration: reweighted linear least squares on |W|^2."""
    target = target_of(program)
    fit = sanathanan_koerner(target, program.order)
    return with_best_gain(target, fit.zeros, fit.poles), Outcome.SOLVED, ""


def sanathanan_koerner(target: Target, order: int) -> Rational:
    """The best of the fits found by Sanathanan-Koerner iteration on |W|^2 = N / D.

    Each iteration minimises sum (weight (N - m^2 D) / (m^2 D_k + N_k))^2 over N and D, in bases
    relative to the roots of the last iteration (IEEE Trans. Automatic Control 8, 1963). Zeros of N
    or D on x > 0 are repaired (see `stable_roots`).
    """
    roots = -np.geomspace(target.omega[0], target.omega[-1], order + 2)[1:-1].astype(complex)
    _, fit = target.best(Rational(roots, roots, 1.0))
    best = target.best(fit)
    weight = np.where(target.weight > 0, target.weight, 0.0)
    for _ in range(ITERATIONS):
        numerator = SquaredBasis(fit.zeros, target.omega)
        denominator = SquaredBasis(fit.poles, target.omega)
        square = target.ratio(fit) ** 2
        share = (weight / (1 + square))[:, None]
        rows = np.hstack([square[:, None] * numerator.columns, -denominator.columns]) * share
        found = _least(rows)
        zeros = stable_roots(numerator.zeros(found[: order + 1]), target.omega)
        poles = stable_roots(denominator.zeros(found[order + 1 :]), target.omega)
        error, fit = target.best(Rational(zeros, poles, 1.0))
        if not np.isfinite(error):
            break
        if error < best[0]:
            best = error, fit
    return best[1]


def _least(rows: RealArray) -> RealArray:
    """Unit vector x with the smallest |rows x|."""
    return np.linalg.svd(rows, full_matrices=False)[2][-1]
