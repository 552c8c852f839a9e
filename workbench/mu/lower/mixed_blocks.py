"""Lower bounds for real and complex blocks: hold the real blocks and align the complex ones.

With the real blocks held at a vertex of their box, the complex ones close a loop whose complex mu
is bounded by ascents from power iterations (P. Seiler, A. Packard and G. Balas, "A gain-based lower
bound algorithm for real and mixed mu problems", Automatica 46, 2010).
"""

from __future__ import annotations

import numpy as np

from workbench.mu.lower.ascent import ascend
from workbench.mu.lower.attain import attained, block_table, turned
from workbench.mu.lower.real_blocks import (
    MOST_VERTICES,
    REFINED_STARTS,
    best_vertex,
    edge_candidates,
    real_bound,
    sign_patterns,
    unit_starts,
)
from workbench.mu.lower.search import search_batch
from workbench.structure import Real, Structure

LEVEL_COUNT, LOWEST_LEVEL = 50, 1e-7
"""Number of levels at which real blocks are held, and the lowest level as a share of |M|. They are
six in a decade, and the best is refined. With half of them a maximum may be missed; double costs
time.
"""
LEVEL_OFFSETS = np.array([-4.0, -2.0, -1.0, -0.5, -0.2, 0.0, 0.2, 0.5, 1.0, 2.0, 4.0])
"""Distances of further levels from the real part of an eigenvalue of the real blocks' own loop, as
multiples of its imaginary part."""
LEVEL_REFINEMENTS, REFINED_LEVELS = 8, 9
"""Number of refinements of the levels around the best one, and number of levels each time. Each
leaves a quarter of the interval: 1e-5 of it at last. Half or double changes the fifth digit of a
start, and an ascent follows.
"""
EIGENVALUE_EXCESS = 1e-6
"""Relative distance above an eigenvalue of the real blocks' own loop at which the complex blocks
are aligned; also the lowest level as a share of |M|. At the eigenvalue itself the loop is singular;
this is near to it and keeps ten digits. Half or double changes the start of an ascent by as little.
"""


def gain_bound(
    M: np.ndarray, structure: Structure, level: float, rng: np.random.Generator
) -> tuple[float, np.ndarray]:
    """Largest real eigenvalue of M Delta found from the vertices of the real blocks.

    Parameters
    ----------
    M
        Complex (columns, rows), entries of order one.
    structure
        Real and complex blocks.
    level
        The eigenvalue at which real blocks close their loop; of the order of mu.
    rng
        Generator of the starts of the power iterations.

    Returns
    -------
    value, Delta
        0 and zeros if no real eigenvalue was found.
    """
    count = sum(isinstance(block, Real) for block in structure)
    half = sign_patterns(count, rng, MOST_VERTICES // 4)
    vertices = np.concatenate([half, -half])
    _, deltas = _closed(M, structure, vertices, np.full(len(vertices), level), rng)
    table = block_table(structure)
    reached = np.array([attained(M, table, delta) for delta in deltas])
    value, found = 0.0, np.zeros((structure.rows, structure.columns), complex)
    for index in np.argsort(-reached)[:REFINED_STARTS]:
        if reached[index] > 0:
            climbed = ascend(M, table, deltas[index], reached[index])
            if climbed > value:
                value, found = climbed, deltas[index]
    return value, found


def held_bound(
    M: np.ndarray, structure: Structure, rng: np.random.Generator
) -> tuple[float, np.ndarray]:
    """Largest real eigenvalue of M Delta found with real blocks held at any level.

    Hold the real blocks at a point r of size |r| and close their loop. Then mu is at least the
    smaller of 1 / |r| and complex mu of the closed loop. The best level 1 / |r| is searched for
    along every direction r. Arguments and result as `gain_bound`.
    """
    best = 0.0, np.zeros((structure.rows, structure.columns), complex)
    count = sum(isinstance(block, Real) for block in structure)
    half = sign_patterns(count, rng, MOST_VERTICES // 4)
    for direction in np.concatenate([half, -half]):
        levels = _levels(M, structure, direction)
        # Refine the levels around the best one, each time between its neighbours.
        for _ in range(LEVEL_REFINEMENTS):
            reals = np.repeat(direction[None], len(levels), axis=0)
            gain, deltas = _closed(M, structure, reals, levels, rng)
            value = levels * np.minimum(gain, 1.0)
            at = int(np.argmax(value))
            if value[at] > best[0]:
                best = float(value[at]), _held(deltas[at], structure, gain[at])
            ends = levels[max(at - 1, 0)], levels[min(at + 1, len(levels) - 1)]
            levels = np.geomspace(*ends, REFINED_LEVELS)
    return best


def _levels(M: np.ndarray, structure: Structure, direction: np.ndarray) -> np.ndarray:
    """Levels at which to hold the real blocks in a direction.

    They cover all sizes, and are dense near the eigenvalues of the loop of the real blocks alone.
    """
    norm = float(np.linalg.norm(M, 2))
    values = iter(direction)
    parts = [
        (next(values) if isinstance(block, Real) else 0.0) * np.ones((block.rows, block.columns))
        for block in structure
    ]
    own = np.linalg.eigvals(M @ structure.diagonal(p * np.eye(*p.shape) for p in parts))
    near = (own.real[:, None] + own.imag[:, None] * LEVEL_OFFSETS).ravel()
    levels = np.concatenate([norm * np.geomspace(LOWEST_LEVEL, 1.0, LEVEL_COUNT), near])
    return np.unique(levels[levels >= LOWEST_LEVEL * norm])


def _held(delta: np.ndarray, structure: Structure, gain: float) -> np.ndarray:
    """Delta of size 1 with the complex blocks 1 / gain times as large as the real ones."""
    scaled = delta.copy()
    for block, row, column in zip(
        structure, structure.row_slices, structure.column_slices, strict=True
    ):
        scaled[row, column] *= min(gain, 1.0) if isinstance(block, Real) else min(1.0, 1 / gain)
    return scaled


def weak_bound(
    M: np.ndarray, structure: Structure, least: float, rng: np.random.Generator
) -> tuple[float, np.ndarray]:
    """Largest real eigenvalue of M Delta found where the real blocks nearly suffice alone.

    Where complex blocks are weakly coupled, the loop of the real blocks alone must be nearly
    singular, which happens on the edges of their box. Arguments and result as `gain_bound`; the
    complex blocks may be 0. Starts whose eigenvalue without complex blocks is below ``least`` are
    left out.
    """
    real = np.array([isinstance(block, Real) for block in structure])
    rows, columns = np.zeros(structure.rows, bool), np.zeros(structure.columns, bool)
    for own, row, column in zip(real, structure.row_slices, structure.column_slices, strict=True):
        rows[row], columns[column] = own, own
    part = np.ascontiguousarray(M[np.ix_(columns, rows)])
    blocks = Structure(block for block in structure if isinstance(block, Real))
    sizes = [block.rows for block in blocks]
    vertices = sign_patterns(len(sizes), rng)
    vertex, diagonal = best_vertex(part, np.repeat(vertices, sizes, axis=1))
    starts = [(vertex, -1, diagonal)]
    if len(sizes) > 1:
        starts += edge_candidates(part, sizes, vertices)
    starts = sorted((s for s in starts if s[0] > least), key=lambda s: -s[0])[:REFINED_STARTS]
    found = np.zeros((structure.rows, structure.columns), complex)
    if not starts:
        return 0.0, found
    value, alone = real_bound(part, blocks, rng)
    found[np.ix_(rows, columns)] = alone
    firsts = np.cumsum([0, *sizes[:-1]])
    reals = np.array([diagonal[firsts] for _, _, diagonal in starts])
    levels = np.array([(1 + EIGENVALUE_EXCESS) * estimate for estimate, _, _ in starts])
    table = block_table(structure)
    _, deltas = _closed(M, structure, reals, levels, rng)
    for delta, (estimate, block, _) in zip(deltas, starts, strict=True):
        free = int(np.flatnonzero(real)[block]) if block >= 0 else -1
        trial = delta.copy()
        reached = turned(M, table, trial, estimate + 0j, free)[0]
        if not reached > 0:
            trial = delta
            reached = attained(M, table, trial)
        if reached > 0:
            reached = ascend(M, table, trial, reached)
        if reached > value:
            value, found = reached, trial
    return value, found


def _closed(
    M: np.ndarray,
    structure: Structure,
    reals: np.ndarray,
    levels: np.ndarray,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Gains (P,) and Deltas (P, rows, columns) with given real and aligned complex blocks.

    ``reals`` (P, real blocks) close their loop at the eigenvalues ``levels`` (P,), and the search
    aligns the complex blocks with the closed loop. Complex blocks of size
    1 / (gain * level) and real blocks ``reals / level`` then make I - M Delta singular.
    """
    complex_part = Structure(block for block in structure if not isinstance(block, Real))
    columns, rows = M.shape
    deltas = np.zeros((len(reals), rows, columns), complex)
    own_rows, own_columns = np.zeros(rows, bool), np.zeros(columns, bool)
    values = iter(reals.T)
    for block, r, c in zip(structure, structure.row_slices, structure.column_slices, strict=True):
        if isinstance(block, Real):
            deltas[:, r, c] = next(values)[:, None, None] * np.eye(r.stop - r.start)
        else:
            own_rows[r], own_columns[c] = True, True
    identity = np.eye(columns)
    # A level as small as the rounding errors of M says nothing about M.
    levels = np.maximum(levels, EIGENVALUE_EXCESS * float(np.linalg.norm(M, 2)))
    closed = levels[:, None, None] * identity - M @ deltas
    # A singular loop is a solution itself; a slightly larger level shows it as a large gain.
    singular = np.linalg.cond(closed) > 1e12
    closed[singular] += 1e-6 * levels[singular, None, None] * identity
    loops = np.linalg.solve(closed, M[:, own_rows])[:, own_columns]
    size = np.abs(loops).max(axis=(1, 2))
    size[size == 0] = 1.0
    gains, ends = search_batch(
        np.ascontiguousarray(loops / size[:, None, None]),
        block_table(complex_part),
        unit_starts(2, complex_part.rows, rng),
        np.zeros((2, len(complex_part))),
        np.ones(2, bool),
        np.zeros(2),
        2,
    )
    deltas[np.ix_(np.arange(len(deltas)), own_rows, own_columns)] = ends
    return gains * size, deltas
