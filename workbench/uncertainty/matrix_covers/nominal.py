"""A nominal for a set of matrix responses: a system of a given order, fitted to their centres."""

from __future__ import annotations

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError, SolverError
from workbench.fitting.response.matrix_fit import fit_matrix_response
from workbench.solution import solve
from workbench.systems.bilinear import bilinear_sampled
from workbench.uncertainty.matrix_covers.responses import MatrixResponses
from workbench.uncertainty.matrix_covers.sets.program import MatrixSets


def central_nominal(responses: MatrixResponses, order: int) -> StateSpace:
    """A stable system of a given order, fitted to the centres of the smallest additive sets.

    At each frequency the set has diagonal weights and the least trace, which a convex program
    finds. The error of the fit in each entry counts relative to the size of the set there.

    Raises
    ------
    InputError
        All plants are equal at some frequency, or there are too few frequencies for the order.
    SolverError
        The program of the centres has no answer.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.uncertainty import MatrixResponses, central_nominal
    >>> one = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    >>> responses = MatrixResponses.of_systems([0.8 * one, 1.2 * one], np.geomspace(0.1, 10, 12))
    >>> abs(central_nominal(responses, order=2).dcgain()).round(2).tolist()
    [[1.0, 0.0], [0.0, 1.0]]
    """
    if not isinstance(responses, MatrixResponses):
        raise InputError(
            f"responses must be MatrixResponses, not {type(responses).__name__}; "
            "MatrixResponses.from_frd and MatrixResponses.of_systems make them"
        )
    sets = MatrixSets(
        responses.values, left="diagonal", right="diagonal", centre="free", size="trace"
    )
    found = solve(sets)
    if found.answer is None:
        raise SolverError(f"centres: {found.message}")
    left, right = (np.einsum("fii->fi", W).real for W in (found.answer.left, found.answer.right))
    weight = 1 / (left[:, :, None] * right[:, None])
    nominal = fit_matrix_response(responses.axis, found.answer.centre, order, weight=weight)
    return bilinear_sampled(nominal, responses.dt) if responses.dt else nominal
