"""Methods of matrix covers: the smallest sets at each frequency, then weights of given orders."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.certify.norms import certified_norm
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.fitting.magnitude.gain import COVER_GAIN_MARGIN
from workbench.fitting.rational import Rational
from workbench.program import Claim, method
from workbench.solution import solve
from workbench.solvers import Outcome
from workbench.systems.bilinear import bilinear_sampled
from workbench.systems.realisation import realisation
from workbench.uncertainty.matrix_covers.cover import MatrixCover
from workbench.uncertainty.matrix_covers.descent import weights_by_descent, weights_by_evolution
from workbench.uncertainty.matrix_covers.found import FoundCover
from workbench.uncertainty.matrix_covers.joint import smaller_weights
from workbench.uncertainty.matrix_covers.model import MatrixModel
from workbench.uncertainty.matrix_covers.responses import system_response
from workbench.uncertainty.matrix_covers.sets.program import FoundSets, MatrixSets
from workbench.uncertainty.matrix_covers.sets.shapes import between_weights, ctranspose
from workbench.uncertainty.matrix_covers.weights import (
    FittedWeight,
    diagonal_weight,
    left_weight,
    right_weight,
)

MOST_RAISES = 8
"""Largest number of times that W_1 is raised. One raise may not be enough, because the proven norm
of a scaled system is not exactly the scaled norm. Raises end once the norm is below 1. With half of
them a hard cover may end in the error; double takes longer to get there.
"""


@method(MatrixCover, "steps", optimal=False)
def _steps(program: MatrixCover, context: Context) -> Claim:
    """Fit W_2 to the smallest sets, then W_1 to the smallest sets that have this W_2."""
    return _best_cover(program, context, None)


def _for_loop(program: MatrixCover) -> str | None:
    """The reason why the objective is not a function of the weights' sizes only; None if it is."""
    if program.loop is None:
        return None
    return "joint minimises the size of sets, not the mu of a loop; take the method descent"


@method(MatrixCover, "joint", optimal=False, unfit=_for_loop)
def _joint(program: MatrixCover, context: Context) -> Claim:
    """Improve both weights of "steps" together; their poles stay. It finds a local optimum."""
    return _best_cover(program, context, partial(smaller_weights, program, context=context))


def _no_full_weight(program: MatrixCover) -> str | None:
    """The reason why the weights are no products of sections; None if they are."""
    full = "full" in (program.left, program.right)
    said = "a full weight has no poles and zeros of each channel; take the method steps or joint"
    return said if full else None


@method(MatrixCover, "descent", optimal=False, unfit=_no_full_weight)
def _descent(program: MatrixCover, context: Context) -> Claim:
    """Quasi-Newton descent over poles and zeros of both weights, starting from those of "steps"."""
    return _best_cover(
        program, context, partial(_found_by_search, program, weights_by_descent, context)
    )


@method(MatrixCover, "evolution", optimal=False, unfit=_no_full_weight)
def _evolution(program: MatrixCover, context: Context) -> Claim:
    """Differential evolution over poles and zeros of both weights, around those of "steps"."""
    return _best_cover(
        program, context, partial(_found_by_search, program, weights_by_evolution, context)
    )


def _found_by_search(
    program: MatrixCover,
    search: Callable[..., tuple[list[Rational], list[Rational]]],
    context: Context,
    W_1: FittedWeight,
    W_2: FittedWeight,
) -> tuple[StateSpace, StateSpace]:
    """The weights found by a search over their poles and zeros."""
    left, right = search(program, W_1.fits, W_2.fits, context)
    rows, columns = program.deviations.shape[2:]
    return diagonal_weight(left, rows).system, diagonal_weight(right, columns).system


Improvement = Callable[[FittedWeight, FittedWeight], tuple[StateSpace, StateSpace]]
"""Function: both weights in the bilinear plane -> other weights there."""


def _best_cover(program: MatrixCover, context: Context, improvement: Improvement | None) -> Claim:
    """The cover by "steps", or the cover with improved weights if it is smaller."""
    try:
        first, W_1, W_2 = _cover_by_steps(program, context)
    except SolverError as error:
        return None, Outcome.FAILED, str(error)
    if improvement is None:
        return first, Outcome.SOLVED, ""
    try:
        second = FoundCover(_model_with_all_plants(program, *improvement(W_1, W_2)), first.least)
    except SolverError as error:
        return first, Outcome.SOLVED, f"the weights of steps are kept: {error}"
    return min(first, second, key=program.objective), Outcome.SOLVED, ""


def _cover_by_steps(
    program: MatrixCover, context: Context
) -> tuple[FoundCover, FittedWeight, FittedWeight]:
    """The cover by "steps", and its weights in the bilinear plane.

    Sets of least mu may change fast along frequency where this has no effect on the loop. So for a
    loop, weights are also fitted to the smallest sets, and the better ones are used.
    """
    least, W_1, W_2 = _fitted_weights(program, context)
    found = [(FoundCover(_model_with_all_plants(program, W_1.system, W_2.system), least), W_1, W_2)]
    if program.loop is not None:
        _, W_1, W_2 = _fitted_weights(program.without_loop(), context)
        found.append(
            (FoundCover(_model_with_all_plants(program, W_1.system, W_2.system), least), W_1, W_2)
        )
    return min(found, key=lambda one: program.objective(one[0]))


def _fitted_weights(
    program: MatrixCover, context: Context
) -> tuple[FoundSets, FittedWeight, FittedWeight]:
    """The smallest sets, and both weights, fitted one after the other, in the bilinear plane."""
    least = _smallest_sets(program.sets, context)
    if program.right == "scalar":
        n = least.right.shape[-1]
        W_2 = diagonal_weight([Rational(np.array([]), np.array([]), 1.0)], n)
    else:
        squares = ctranspose(least.right) @ least.right
        W_2 = right_weight(program.axis, squares, program.right, program.right_order, context)
    rest = _smallest_sets(
        program.sets_with_right_weight(system_response(W_2.system, program.axis)), context
    )
    squares = rest.left @ ctranspose(rest.left)
    W_1 = left_weight(program.axis, squares, program.left, program.left_order, context)
    return least, W_1, W_2


def _smallest_sets(program: MatrixSets, context: Context) -> FoundSets:
    """The smallest sets; raises SolverError if there is no answer."""
    found = solve(program, options=context.options)
    if found.answer is None:
        raise SolverError(f"smallest sets: {found.message}")
    answer: FoundSets = found.answer
    return answer


def _model_with_all_plants(program: MatrixCover, W_1: StateSpace, W_2: StateSpace) -> MatrixModel:
    """The model with W_1 multiplied by the smallest factor with which it contains all plants.

    It contains them at every frequency if that can be proven. The given weights are functions of
    the bilinear plane.
    """
    dt = program.responses.dt
    if dt:
        W_1, W_2 = bilinear_sampled(W_1, dt), bilinear_sampled(W_2, dt)
    model = MatrixModel(program.nominal, W_1, W_2, form=program.form)
    need = _largest_norm(program, model)
    for _ in range(MOST_RAISES):
        factor = need * (1 + COVER_GAIN_MARGIN)
        W_1 = realisation((W_1.A, W_1.B, factor * W_1.C, factor * W_1.D), dt)
        model = MatrixModel(program.nominal, W_1, W_2, form=program.form)
        need = _largest_norm(program, model)
        if need <= 1:
            return model
    raise SolverError(f"the cover still misses a plant by {need - 1:.3g}, relative")


def _largest_norm(program: MatrixCover, model: MatrixModel) -> float:
    """The largest norm of a plant's Delta, proven for every frequency if possible."""
    W_1, W_2 = (system_response(W, program.responses.omega) for W in (model.W_1, model.W_2))
    deltas = between_weights(W_1, program.matrices_to_cover, W_2)
    need = float(np.linalg.norm(deltas, 2, axis=(2, 3)).max())
    if program.covers_every_frequency:
        need = max(need, *(certified_norm(delta) for delta in program.known_deltas(model)))
    return need
