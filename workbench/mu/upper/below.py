"""Upper bounds of mu that only have to be below a level, as on a grid of frequencies."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from workbench._core.arrays import Array, BoolArray, ComplexArray, RealArray
from workbench.errors import InputError, SolverError
from workbench.executor import Context
from workbench.mu.upper.fast import batch_bounds, pattern_of_structure
from workbench.mu.upper.level import proven_below
from workbench.mu.upper.multipliers import LEVEL_MARGIN
from workbench.mu.upper.pattern import compact_multipliers
from workbench.mu.upper.program import MuUpperBound, UpperBound
from workbench.solvers import Options
from workbench.structure import Structure

NEIGHBOURS = 16
"""One matrix in this many gets its own path; its multipliers are then tried on the neighbours. A
path takes far longer than a trial. With half of it more paths are followed; with double of it fewer
trials hold. The time changes, and no proof.
"""
NEIGHBOUR_ROUNDS = 3
"""Number of rounds in which this is repeated for the remaining matrices; after that each gets its
own path. Each leaves a small part. Half or double changes the time only.
"""
FALLS = 2
"""Number of times that the bound proven by a neighbour's multipliers is lowered. A neighbour's
multipliers prove a bound a little above the least, and two falls find it. With half of them bounds
stay higher, still below the level; double costs time.
"""


def bounds_below(M: Any, structure: Structure, level: float) -> UpperBound:
    """Upper bounds of mu that stop improving at a level, for the question "is mu below it?".

    They take a fifth of the time of `upper_bound` if the batch has about a thousand similar
    neighbours, as the responses at neighbouring frequencies are: multipliers that prove one bound
    are tried on its neighbours.

    Parameters
    ----------
    M
        Complex, shape (F, c, r), finite; c = structure.columns, r = structure.rows.
    level
        Positive and finite.

    Returns
    -------
    UpperBound
        Every bound is proven. One at most the level need not be the least; one above it is as near
        to the least bound as that of `upper_bound`, which is then above the level too.

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
    count, c, r = batch.shape
    shapes = (count, c, c), (count, r, r), (count, r, c)
    answer = UpperBound(np.empty(count), *(np.empty(shape, complex) for shape in shapes))
    context, low = Context(options=Options()), level * (1 - LEVEL_MARGIN)
    left = np.arange(count)
    for round_ in range(NEIGHBOUR_ROUNDS + 1):
        apart = NEIGHBOURS if round_ < NEIGHBOUR_ROUNDS and len(left) > NEIGHBOURS else 1
        own = left[::apart]
        found = batch_bounds(batch[own], structure, context, level).answer
        answer.value[own] = found.value
        _take_multipliers(answer, own, found, np.arange(len(own)))
        place = np.flatnonzero(np.arange(len(left)) % apart)
        for beside in (0, 1):
            source = np.minimum(place // apart + beside, len(own) - 1)
            rest = left[place]
            value = _proven(batch[rest], structure, low, found.D_right, found.G, source, FALLS)
            held = np.isfinite(value)
            answer.value[rest[held]] = value[held]
            _take_multipliers(answer, rest[held], found, source[held])
            place = place[~held]
        left = left[place]
        if not len(left):
            break
    if not np.isfinite(answer.value).all():
        raise SolverError("fast: no finite bound of some matrices; scale their rows and columns")
    return answer.reshaped(program.batch)


def _take_multipliers(answer: UpperBound, at: Array, found: UpperBound, source: Array) -> None:
    """Put the multipliers with the indices ``source`` (f,) into the answer at the places ``at``
    (f,).
    """
    for name in ("D_left", "D_right", "G"):
        getattr(answer, name)[at] = getattr(found, name)[source]


def hold_below(
    M: ComplexArray,
    structure: Structure,
    level: float,
    D_right: ComplexArray,
    G: ComplexArray,
    source: Array,
) -> BoolArray:
    """Whether multipliers prove bounds of M (F, c, r) up to a level.

    Those of matrix f are the D_right (K, r, r), positive definite, and G (K, r, c) numbered
    source (F,).
    """
    return np.isfinite(_proven(M, structure, level, D_right, G, source, falls=0))


def _proven(
    M: ComplexArray,
    structure: Structure,
    level: float,
    D_right: ComplexArray,
    G: ComplexArray,
    source: Array,
    falls: int,
) -> RealArray:
    """Bounds up to a level that multipliers prove, as `proven_below` has them."""
    pattern = pattern_of_structure(structure)
    D, twist = compact_multipliers(pattern, D_right, G)
    value = np.empty(len(M))
    M = np.ascontiguousarray(M)
    proven_below(M, level, pattern.left, pattern.right, D, twist, source, falls, value)
    return value
