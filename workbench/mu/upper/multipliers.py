"""Multipliers of a batch from the central paths of its matrices, or from those of neighbours."""

from __future__ import annotations

import numpy as np

from workbench.arrays import Array, ComplexArray, RealArray
from workbench.certify.mu_bound import certified_bound
from workbench.mu.upper.alone import closed_form, is_alone
from workbench.mu.upper.balance import balanced_batch
from workbench.mu.upper.batch import held_below, solve_each
from workbench.mu.upper.lanes.path import follow_paths
from workbench.mu.upper.lanes.state import room_for
from workbench.mu.upper.pattern import Pattern, diagonal_places
from workbench.structure import Structure

LEVEL_MARGIN = 1e-8
"""Share of a level that bounds stay below, so that rounding them outward does not lift them over
it."""
NEIGHBOURS = 16
"""One matrix in so many gets its own path; then its multipliers are tried on those beside it."""
NEIGHBOUR_ROUNDS = 3
"""How often this is done with those that are left, before each gets its own path."""

Solved = tuple[Array, Array, RealArray, Array]
"""Compact D and G (F, N, N), gaps (F,) of the square of the bound, and iterations (F,)."""


def path_multipliers(
    structure: Structure,
    pattern: Pattern,
    accuracy: float,
    level: float,
    M: ComplexArray,
) -> Solved:
    """Multipliers of matrices M (F, c, r), each from its own path.

    A bound up to the level is low enough, and then has no gap; 0 asks for the least one.
    """
    count = len(M)
    level = level * (1 - LEVEL_MARGIN)
    D, G = np.zeros((2, count, pattern.size, pattern.size), complex)
    gaps, iterations = np.full(count, np.inf), np.zeros(count, int)
    places = diagonal_places(pattern)
    if places is not None:
        scaled, E, scale = balanced_batch(M, pattern)
        d, g = np.empty((count, pattern.size)), np.empty((count, np.count_nonzero(pattern.skew)))
        nothing = scale == 0  # no size that balancing leaves: D is the balancing itself
        every, real = np.arange(pattern.size), pattern.row[pattern.skew]
        with np.errstate(all="ignore"):  # what is not finite proves nothing
            enough = np.where(nothing, 0.0, level / scale) ** 2
            c, r = M.shape[1:]
            room = room_for(c, r, pattern.size, g.shape[1])
            follow_paths(scaled, places, room, accuracy, enough, d, g, gaps, iterations)
            d[nothing], g[nothing] = 1.0, 0.0
            D[:, every, every] = d * E * E
            G[:, real, real] = g * E[:, real] * E[:, real] * scale[:, None]
        gaps[nothing] = 0.0
    alone = places is None and is_alone(structure)
    if alone:
        first_D, first_G, mu = closed_form(M, structure)
        first = certified_bound(M, structure, first_D, first_D, first_G)
        exact = first <= (1 + accuracy) * mu
        D[exact], G[exact], gaps[exact] = first_D[exact], first_G[exact], 0.0
    rest = np.flatnonzero(~(gaps <= accuracy))
    if rest.size:  # each is warm-started from the one before
        found = D[rest], G[rest], gaps[rest], iterations[rest]
        solve_each(M[rest], pattern, accuracy, level, *found)
        D[rest], G[rest], gaps[rest], iterations[rest] = found
        if alone:  # where eigenvectors are nearly dependent, they may still prove more than a path
            better = rest[
                first[rest] < certified_bound(M[rest], structure, D[rest], D[rest], G[rest])
            ]
            D[better], G[better] = first_D[better], first_G[better]
    return D, G, gaps, iterations


def multipliers_below(
    structure: Structure,
    pattern: Pattern,
    accuracy: float,
    level: float,
    M: ComplexArray,
) -> Solved:
    """As `path_multipliers` for a level above 0, where neighbours in M (F, c, r) are alike.

    The multipliers of a matrix often show that bounds of its neighbours are below the level too.
    """
    count = len(M)
    D, G = np.zeros((2, count, pattern.size, pattern.size), complex)
    gaps, iterations = np.zeros(count), np.zeros(count, int)
    found = D, G, gaps, iterations
    low = level * (1 - LEVEL_MARGIN)
    left = np.arange(count)
    for round_ in range(NEIGHBOUR_ROUNDS + 1):
        apart = NEIGHBOURS if round_ < NEIGHBOUR_ROUNDS and len(left) > NEIGHBOURS else 1
        own = left[::apart]
        paths = path_multipliers(structure, pattern, accuracy, level, M[own])
        for part, value in zip(found, paths, strict=True):
            part[own] = value
        place = np.flatnonzero(np.arange(len(left)) % apart)
        for beside in (0, 1):
            source, rest = own[np.minimum(place // apart + beside, len(own) - 1)], left[place]
            held = np.zeros(len(rest), bool)
            held_below(M[rest], low, pattern.left, pattern.right, D, G, source, held)
            D[rest[held]], G[rest[held]] = D[source[held]], G[source[held]]
            place = place[~held]
        left = left[place]
        if not len(left):
            break
    return found
