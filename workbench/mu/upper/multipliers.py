"""Multipliers of a batch from the central paths of its matrices."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import Array, ComplexArray, RealArray
from workbench._core.machine_code.door import Road
from workbench.certify.mu_bound import said_bound
from workbench.mu.upper.alone import closed_form, is_alone
from workbench.mu.upper.balance import balanced_batch
from workbench.mu.upper.batch import solve_each
from workbench.mu.upper.pattern import Pattern, diagonal_places
from workbench.structure import Structure

LEVEL_MARGIN = 1e-8
"""Bounds stay below a level by this share, so that rounding them outward does not lift them above
it. Rounding outward is below `ACCEPTED_ROUNDING`, 1e-9. With half of it still; double asks a little
more of each path.
"""
Solved = tuple[Array, Array, RealArray, Array]
"""Compact D and G (F, N, N), gaps (F,) of the square of the bound, and iterations (F,)."""


def _eight_at_once() -> Any:
    from workbench.mu.upper.lanes.known_answer import check_lanes
    from workbench.mu.upper.lanes.path import follow_paths
    from workbench.mu.upper.lanes.state import room_for

    check_lanes()
    return follow_paths, room_for


LANES = Road("bounds of mu", _eight_at_once)
"""The functions `follow_paths` and `room_for`, for diagonal multipliers."""


def path_multipliers(
    structure: Structure,
    pattern: Pattern,
    accuracy: float,
    level: float,
    M: ComplexArray,
) -> Solved:
    """Multipliers of matrices M (F, c, r), each from its own path.

    A bound up to the level is low enough and counts as one without a gap; level 0 asks for the
    least bound.
    """
    count = len(M)
    level = level * (1 - LEVEL_MARGIN)
    D, G = np.zeros((2, count, pattern.size, pattern.size), complex)
    if structure.unstructured:  # the least bound is the largest singular value, by D = 1
        D[:] = np.eye(pattern.size)
        return D, G, np.zeros(count), np.zeros(count, int)
    gaps, iterations = np.full(count, np.inf), np.zeros(count, int)
    places = diagonal_places(pattern)
    lanes = None if places is None else LANES.taken()
    if lanes is not None:
        follow_paths, room_for = lanes
        scaled, E, scale = balanced_batch(M, pattern)
        d, g = np.empty((count, pattern.size)), np.empty((count, np.count_nonzero(pattern.skew)))
        nothing = scale == 0  # balancing has left nothing of the matrix: the balancing itself is D
        every, real = np.arange(pattern.size), pattern.row[pattern.skew]
        with np.errstate(all="ignore"):  # multipliers that are not finite prove nothing
            enough = np.where(nothing, 0.0, level / scale) ** 2
            room = room_for(*M.shape[1:], pattern.size, g.shape[1])
            follow_paths(scaled, places, room, accuracy, enough, d, g, gaps, iterations)
            d[nothing], g[nothing] = 1.0, 0.0
            D[:, every, every] = d * E * E
            G[:, real, real] = g * E[:, real] * E[:, real] * scale[:, None]
        gaps[nothing] = 0.0
    alone = lanes is None and is_alone(structure)
    if alone:
        first_D, first_G, mu = closed_form(M, structure)
        first = said_bound(M, structure, first_D, first_D, first_G)
        exact = first <= (1 + accuracy) * mu
        D[exact], G[exact], gaps[exact] = first_D[exact], first_G[exact], 0.0
    rest = np.flatnonzero(~(gaps <= accuracy))
    if rest.size:  # each path is warm-started from the one before
        found = D[rest], G[rest], gaps[rest], iterations[rest]
        solve_each(M[rest], pattern, accuracy, level, *found)
        D[rest], G[rest], gaps[rest], iterations[rest] = found
        # where eigenvectors are nearly dependent, the closed form may still prove more than a path
        if alone:
            path = said_bound(M[rest], structure, D[rest], D[rest], G[rest])
            better = rest[first[rest] < path]
            D[better], G[better] = first_D[better], first_G[better]
    return D, G, gaps, iterations
