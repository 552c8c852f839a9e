"""Methods of matrix covers: the smallest sets at each frequency, then weights of given orders."""

from __future__ import annotations

import numpy as np

from workbench.certify.norms import certified_norm
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.heavy_types import StateSpace
from workbench.program import Claim, method
from workbench.solution import solve
from workbench.solvers import Outcome
from workbench.systems.bilinear import bilinear_sampled
from workbench.systems.realisation import realisation
from workbench.uncertainty.matrix_covers.cover import FoundCover, MatrixCover
from workbench.uncertainty.matrix_covers.model import MatrixModel
from workbench.uncertainty.matrix_covers.responses import response_of
from workbench.uncertainty.matrix_covers.sets import FoundSets, MatrixSets
from workbench.uncertainty.matrix_covers.weights import left_weight, right_weight

GAIN_MARGIN = 1e-10
"""Relative excess of the final gain over the one needed."""


@method(MatrixCover, "steps", optimal=False)
def _steps(program: MatrixCover, context: Context) -> Claim:
    """The smallest sets, then W_2 above theirs, then W_1 above the smallest sets with that W_2."""
    try:
        least = _sets(program.sets, context)
        W_2 = _right(program, least, context)
        X = program.deviations @ np.linalg.inv(response_of(W_2, program.responses.omega))[:, None]
        rest = _sets(MatrixSets(X, program.left, "scalar", floor=program.floor), context)
        W_1 = left_weight(
            program.axis,
            rest.left @ rest.left.conj().swapaxes(-2, -1),
            program.left,
            program.left_order,
            context,
        )
        model = _model(program, _sampled(program, W_1), W_2)
        return FoundCover(_reaching(program, model), least), Outcome.SOLVED, ""
    except SolverError as error:
        return None, Outcome.FAILED, str(error)


def _sets(program: MatrixSets, context: Context) -> FoundSets:
    """The smallest sets; raises SolverError where there is no answer."""
    found = solve(program, options=context.options)
    if found.answer is None:
        raise SolverError(f"smallest sets: {found.message}")
    answer: FoundSets = found.answer
    return answer


def _right(program: MatrixCover, least: FoundSets, context: Context) -> StateSpace:
    """W_2 above the smallest sets'; the unit matrix where it is scalar."""
    n = least.right.shape[-1]
    if program.right == "scalar":
        return realisation(
            (np.zeros((0, 0)), np.zeros((0, n)), np.zeros((n, 0)), np.eye(n)), program.responses.dt
        )
    squares = least.right.conj().swapaxes(-2, -1) @ least.right
    W = right_weight(program.axis, squares, program.right, program.right_order, context)
    return _sampled(program, W)


def _sampled(program: MatrixCover, W: StateSpace) -> StateSpace:
    """A weight of the bilinear plane as one of the plants' time."""
    return bilinear_sampled(W, program.responses.dt) if program.responses.dt else W


def _model(program: MatrixCover, W_1: StateSpace, W_2: StateSpace) -> MatrixModel:
    return MatrixModel(program.nominal, W_1, W_2, program.form)


def _reaching(program: MatrixCover, model: MatrixModel) -> MatrixModel:
    """The model with W_1 as large as the plants need: at every frequency where that is proven."""
    need = float(np.linalg.norm(program.deltas(model), 2, axis=(2, 3)).max())
    if program.everywhere:
        need = max(need, *(certified_norm(delta) for delta in program.known_deltas(model)))
    W = model.W_1
    factor = need * (1 + GAIN_MARGIN)
    grown = realisation((W.A, W.B, factor * W.C, factor * W.D), float(W.dt or 0.0))
    return _model(program, grown, model.W_2)
