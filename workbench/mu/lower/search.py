"""The search for large lower bounds of mixed mu: local ascents from many starts, for a batch."""

from __future__ import annotations

import numpy as np

from workbench._core.compiled import compiled, inlined, unchecked_kernel
from workbench.mu.lower.ascent import climb, copy_delta, polished_perturbation
from workbench.mu.lower.edges import (
    MOST_POINTS,
    point_count,
    set_crossings,
    set_point,
    set_polynomials,
)
from workbench.mu.lower.rayleigh import BEST, B, U, X, Y, copy_pair
from workbench.mu.lower.realise import (
    SEARCH_TOLERANCE,
    blocks_of,
    realise,
    workspace,
)
from workbench.mu.lower.runs import realised_run

SAME_VALUE = 1e-6
"""Ascents agree if their final values differ by less than this share. Ascents end within 1e-9 of a
maximum, and different maxima differ by more. Half or double decides the same.
"""
REFINED_EDGES = 12
"""Number of the most promising edges from which ascents start. As many as `REFINED_STARTS` of the
other search. With half of them a bound may be smaller now and then; double costs time.
"""
KNOWN_ENDS = 6
"""Number of the best final points of ascents that are kept, so that later ascents to the same
points can stop early. A matrix has a few good maxima. With half of them more ascents go on to their
end; double takes longer to compare. No bound changes.
"""


@compiled
def search_batch(Ms, table, starts, start_reals, moving, levels, agree):  # type: ignore[no-untyped-def]
    """For each matrix the best of local ascents.

    Parameters
    ----------
    Ms
        Complex (B, columns, rows), entries of order one.
    table
        `block_table`.
    starts, start_reals
        Unit vectors of the run that leads to each start, complex (S, 2, rows), and its real blocks,
        (S, blocks).
    moving
        Whether a run moves the real blocks (S,).
    levels
        Level at which a run searches for an eigenvalue, as a multiple of the best known one (S,);
        0: the run is a power iteration.
    agree
        The search ends early once this many ascents have reached the best value.

    Returns
    -------
    values, deltas
        Real eigenvalues of M Delta (B,), 0 where none was found, and Deltas (B, rows, columns).
        Each depends on its own matrix only.
    """
    batch, columns, rows = Ms.shape
    w, v = workspace(table, rows, columns)
    values, deltas = np.zeros(batch), np.zeros((batch, rows, columns), np.complex128)
    reals = np.zeros(len(table))
    delta, order = np.zeros((rows, columns), np.complex128), np.zeros(len(table), np.int64)
    edges = not blocks_of(table)[1] and point_count(table) <= MOST_POINTS
    size = MOST_POINTS if edges else 0
    polynomials = np.zeros((size, columns + 1), np.complex128)
    determinants, found = np.zeros((2, size), np.complex128), np.zeros((REFINED_EDGES, 4))
    known = np.zeros(KNOWN_ENDS), np.zeros((KNOWN_ENDS, rows, columns), np.complex128)
    for m in range(batch):
        met, first = 0, 0
        known[0][:] = 0.0
        if edges:
            _search_edges(Ms[m], table, 0.0, delta, polynomials, determinants, found, w)
            first = -REFINED_EDGES
        for s in range(first, len(starts)):
            if s < 0:
                row = found[s + REFINED_EDGES]
                value = _edge_start(Ms[m], table, row, delta, values[m], w)
            else:
                if met >= agree:
                    break
                for j in range(rows):
                    w[B, j], w[U, j] = starts[s, 0, j], starts[s, 1, j]
                for k in range(len(table)):
                    reals[k] = start_reals[s, k]
                value = realised_run(
                    Ms[m], table, reals, moving[s], levels[s] * values[m], delta, order, w
                )
            if not value > 0:
                continue
            value = climb(Ms[m], table, delta, value, known, w, v)
            _keep(value, delta, known)
            if abs(value - values[m]) <= SAME_VALUE * value:
                met += 1
            elif value > values[m]:
                met = 1
            if value > values[m]:
                values[m] = value
                copy_delta(delta, deltas[m])
                copy_pair(w, X, BEST)
        if values[m] > 0:
            copy_pair(w, BEST, X)
            values[m] = polished_perturbation(Ms[m], table, deltas[m], values[m], w)
    return values, deltas


@unchecked_kernel
def _keep(value, delta, known):  # type: ignore[no-untyped-def]
    """Keep the end of an ascent in place of the lowest one kept, unless it is known already."""
    values, deltas = known
    lowest = 0
    for k in range(len(values)):
        if values[k] == value:
            return
        if values[k] < values[lowest]:
            lowest = k
    if value > values[lowest]:
        values[lowest] = value
        copy_delta(delta, deltas[lowest])


@unchecked_kernel
def _search_edges(M, table, least, delta, polynomials, determinants, found, w):  # type: ignore[no-untyped-def]
    """Set ``found`` to the crossings on edges above the level already known."""
    count = point_count(table)
    set_polynomials(M, table, count, delta, polynomials, w)
    # The norms of M bound its spectral norm, and that bounds mu.
    rows, columns, most = 0.0, 0.0, 0.0
    for i in range(M.shape[0]):
        row, column = 0.0, 0.0
        for j in range(M.shape[1]):
            row += abs(M[i, j])
            column += abs(M[j, i])
        rows, columns = max(rows, row), max(columns, column)
    most = np.sqrt(rows * columns)
    set_crossings(table, polynomials, count, least, most, determinants, delta, found)


@inlined
def _edge_start(M, table, crossing, delta, least, w):  # type: ignore[no-untyped-def]
    """The real eigenvalue (0: none above ``least``) near an estimate on an edge; sets Delta."""
    if not crossing[0] > least * (1 + SAME_VALUE):
        return 0.0
    block = int(crossing[2])
    set_point(table, int(crossing[1]), block, crossing[3], delta)
    for i in range(len(M)):
        w[X, i], w[Y, i] = complex(1.0, 0.5 * i), complex(1.0, -0.5 * i)
    near = complex(crossing[0], 0.0)
    return realise(M, table, delta, near, block, SEARCH_TOLERANCE, w)[0]
