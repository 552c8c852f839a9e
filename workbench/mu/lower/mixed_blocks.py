"""Real and complex blocks: from real blocks held where they help most, the complex ones aligned.

With the real blocks at a vertex of their box, the complex ones close a loop whose complex mu is
bounded by the power iteration (P. Seiler, A. Packard and G. Balas, "A gain-based lower bound
algorithm for real and mixed mu problems", Automatica 46, 2010).
"""

from __future__ import annotations

import numpy as np

from workbench.mu.lower.ascent import ascend
from workbench.mu.lower.attain import attained, block_table, turned
from workbench.mu.lower.power import power_batch
from workbench.mu.lower.real_blocks import (
    CANDIDATES,
    PATTERNS,
    best_vertex,
    edge_candidates,
    real_bound,
    sign_patterns,
    unit_starts,
)
from workbench.structure import Real, Structure

LEVELS, LOWEST = 50, 1e-7
"""Levels at which real blocks are held, and the lowest, relative to the norm."""
WIDTHS = np.array([-4.0, -2.0, -1.0, -0.5, -0.2, 0.0, 0.2, 0.5, 1.0, 2.0, 4.0])
"""Where levels are about an eigenvalue of real blocks, in its imaginary part."""
FINER, BETWEEN = 8, 9
"""How often levels about the best are tried, and how many at a time."""
BESIDE = 1e-6
"""How much above an eigenvalue of real blocks alone the complex ones are aligned."""


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
        Starts the power iterations.

    Returns
    -------
    value, Delta
        0 and zeros where no real eigenvalue was found.
    """
    count = sum(isinstance(block, Real) for block in structure)
    half = sign_patterns(count, rng, PATTERNS // 4)
    vertices = np.concatenate([half, -half])
    _, deltas = _closed(M, structure, vertices, np.full(len(vertices), level), rng)
    table = block_table(structure)
    reached = np.array([attained(M, table, delta) for delta in deltas])
    value, found = 0.0, np.zeros((structure.rows, structure.columns), complex)
    for index in np.argsort(-reached)[:CANDIDATES]:
        if reached[index] > 0:
            climbed = ascend(M, table, deltas[index], reached[index])
            if climbed > value:
                value, found = climbed, deltas[index]
    return value, found


def held_bound(
    M: np.ndarray, structure: Structure, rng: np.random.Generator
) -> tuple[float, np.ndarray]:
    """Largest real eigenvalue of M Delta found with real blocks held, at any level.

    With the real blocks at a point r of size |r| and the complex ones in the loop that is left,
    mu is at least the smaller of 1 / |r| and complex mu of that loop; the level 1 / |r| is
    searched for along every direction r. Arguments and answer as `gain_bound`.
    """
    best = 0.0, np.zeros((structure.rows, structure.columns), complex)
    count = sum(isinstance(block, Real) for block in structure)
    half = sign_patterns(count, rng, PATTERNS // 4)
    for direction in np.concatenate([half, -half]):
        levels = _levels(M, structure, direction)
        # Finer levels about the best, each time between its neighbours.
        for _ in range(FINER):
            reals = np.repeat(direction[None], len(levels), axis=0)
            gain, deltas = _closed(M, structure, reals, levels, rng)
            value = levels * np.minimum(gain, 1.0)
            at = int(np.argmax(value))
            if value[at] > best[0]:
                best = float(value[at]), _held(deltas[at], structure, gain[at])
            ends = levels[max(at - 1, 0)], levels[min(at + 1, len(levels) - 1)]
            levels = np.geomspace(*ends, BETWEEN)
    return best


def _levels(M: np.ndarray, structure: Structure, direction: np.ndarray) -> np.ndarray:
    """Levels at which real blocks in a direction are held: all sizes, and about their own loops."""
    norm = float(np.linalg.norm(M, 2))
    values = iter(direction)
    parts = [
        (next(values) if isinstance(block, Real) else 0.0) * np.ones((block.rows, block.columns))
        for block in structure
    ]
    own = np.linalg.eigvals(M @ structure.diagonal(p * np.eye(*p.shape) for p in parts))
    near = (own.real[:, None] + own.imag[:, None] * WIDTHS).ravel()
    levels = np.concatenate([norm * np.geomspace(LOWEST, 1.0, LEVELS), near])
    return np.unique(levels[levels >= LOWEST * norm])


def _held(delta: np.ndarray, structure: Structure, gain: float) -> np.ndarray:
    """Delta of size 1 whose complex blocks are 1 / gain times as large as its real ones."""
    scaled = delta.copy()
    for block, row, column in zip(
        structure, structure.row_slices, structure.column_slices, strict=True
    ):
        scaled[row, column] *= min(gain, 1.0) if isinstance(block, Real) else min(1.0, 1 / gain)
    return scaled


def weak_bound(
    M: np.ndarray, structure: Structure, least: float, rng: np.random.Generator
) -> tuple[float, np.ndarray]:
    """Largest real eigenvalue of M Delta found from where real blocks nearly do alone.

    With weakly coupled complex blocks the real ones must come close to a singular loop of their
    own, on the edges of their box. Arguments and answer as `gain_bound`; complex blocks may be 0.
    Starts whose eigenvalue without complex blocks is below ``least`` are left out.
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
    starts = sorted((s for s in starts if s[0] > least), key=lambda s: -s[0])[:CANDIDATES]
    found = np.zeros((structure.rows, structure.columns), complex)
    if not starts:
        return 0.0, found
    value, alone = real_bound(part, blocks, rng)
    found[np.ix_(rows, columns)] = alone
    firsts = np.cumsum([0, *sizes[:-1]])
    reals = np.array([diagonal[firsts] for _, _, diagonal in starts])
    levels = np.array([(1 + BESIDE) * estimate for estimate, _, _ in starts])
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
    """Deltas (P, rows, columns) with the real blocks given, complex ones aligned to the loop.

    ``reals`` (P, real blocks) close their loop at the eigenvalues ``levels`` (P,). Before the
    Deltas the gains (P,) of the closed loops: complex blocks of the size 1 / (gain * level) and
    real ones ``reals / level`` make I - M Delta singular.
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
    # A level that is rounding beside M says nothing of it.
    levels = np.maximum(levels, BESIDE * float(np.linalg.norm(M, 2)))
    closed = levels[:, None, None] * identity - M @ deltas
    # A loop that is singular here is one of the answers: a slightly larger level shows it.
    singular = np.linalg.cond(closed) > 1e12
    closed[singular] += 1e-6 * levels[singular, None, None] * identity
    loops = np.linalg.solve(closed, M[:, own_rows])[:, own_columns]
    size = np.abs(loops).max(axis=(1, 2))
    size[size == 0] = 1.0
    starts = unit_starts(2, complex_part.rows, rng)
    gains, ends = power_batch(
        np.ascontiguousarray(loops / size[:, None, None]),
        block_table(complex_part),
        starts,
        np.zeros((len(starts), len(complex_part))),
        False,
    )
    best, which = np.argmax(gains, axis=0), np.arange(len(deltas))
    deltas[np.ix_(which, own_rows, own_columns)] = ends[best, which]
    return gains[best, which] * size, deltas
