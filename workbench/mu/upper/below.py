"""Upper bounds of mu that only have to be below a level, as on a grid of frequencies."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from workbench.arrays import Array, BoolArray, ComplexArray
from workbench.errors import InputError, SolverError
from workbench.executor import Context
from workbench.mu.upper.batch import held_below
from workbench.mu.upper.fast import batch_bounds, pattern_of_structure
from workbench.mu.upper.pattern import compact_multipliers
from workbench.mu.upper.program import MuUpperBound, UpperBound
from workbench.solvers import Options
from workbench.structure import Structure


def bounds_below(M: Any, structure: Structure, level: float) -> UpperBound:
    """Upper bounds of mu that stop improving at a level, for the question "is mu below it?".

    They take a third of the time of `upper_bound` where neighbours in the batch are alike, as
    responses at neighbouring frequencies are: what proves one bound is tried on those beside it.

    Parameters
    ----------
    M
        Complex, shape (F, c, r), finite; c = structure.columns, r = structure.rows.
    level
        Positive and finite.

    Returns
    -------
    UpperBound
        Every bound holds. One at most the level need not be the least; one above it is as near to
        the least bound as that of `upper_bound`, which is then above the level too.

    Raises
    ------
    InputError
        M does not fit the structure or is not finite, or the level is not positive and finite.
    SolverError
        Rounding hides every bound of a matrix.
    """
    if not 0.0 < level < math.inf:
        raise InputError(f"level is {level!r}; it must be positive and finite")
    program = MuUpperBound(M, structure)
    batch = np.ascontiguousarray(program.M.reshape(-1, structure.columns, structure.rows))
    found = batch_bounds(batch, structure, Context(Options()), level)
    if not np.isfinite(found.answer.value).all():
        raise SolverError("fast: no finite bound of some matrices; scale their rows and columns")
    return found.answer.reshaped(program.batch)


def hold_below(
    M: ComplexArray,
    structure: Structure,
    level: float,
    D_right: ComplexArray,
    G: ComplexArray,
    source: Array,
) -> BoolArray:
    """Whether multipliers show bounds of M (F, c, r) up to a level, except for rounding.

    Those of matrix f are the D_right (K, r, r) and G (K, r, c) numbered source (F,).
    """
    pattern = pattern_of_structure(structure)
    D, twist = compact_multipliers(pattern, D_right, G)
    held = np.zeros(len(M), bool)
    M = np.ascontiguousarray(M)
    held_below(M, level, pattern.left, pattern.right, D, twist, source, held)
    return held
