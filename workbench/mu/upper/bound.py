"""The upper bound of the structured singular value, mixed real and complex."""

from __future__ import annotations

from concurrent.futures import Executor
from typing import Any

import numpy as np

from workbench.answer import answer_of
from workbench.mu.upper import ab13md as upper_ab13md
from workbench.mu.upper import conic as upper_conic
from workbench.mu.upper import fast as upper_fast
from workbench.mu.upper.program import MuUpperBound, UpperBound
from workbench.solvers import Options
from workbench.structure import Structure

__all__ = [
    "MuUpperBound",
    "UpperBound",
    "upper_ab13md",
    "upper_bound",
    "upper_conic",
    "upper_fast",
]


def upper_bound(
    M: Any,
    structure: Structure,
    *,
    method: str = "fast",
    options: Options | None = None,
    executor: Executor | None = None,
) -> UpperBound:
    """Upper bound of mu for each matrix of a batch, with the multipliers that prove it.

    Parameters
    ----------
    M
        Complex, shape (..., c, r), finite; c = structure.columns, r = structure.rows. Or a
        `FrequencyResponseData` of python-control, (F, c, r).
    method
        ``"fast"``, ``"ab13md"`` (SLICOT, square blocks, no repeated scalars) or the name of a
        conic solver.
    executor
        Executor to which ``"fast"`` sends its matrices, 200 per task; None: threads.

    Returns
    -------
    UpperBound
        The bound that its own multipliers prove, rounded outward. The `certificate` is made when it
        is first asked for.

    Raises
    ------
    InputError
        M does not fit the structure or is not finite; the method does not take the structure.
    SolverError
        The method gave no answer.
    """

    def finite(bound: UpperBound) -> bool:
        return bool(np.isfinite(bound.value).all())

    program = MuUpperBound(M, structure)
    found: UpperBound = answer_of(program, method, options, executor, finite)
    return found
