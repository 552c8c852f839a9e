"""Vertices and edges of the box of real blocks.

Pure real structures: all blocks at their ends, then all but one (R. Dailey, "A new algorithm for
the real structured singular value", ACC 1990). For a real M and blocks not repeated, det is
multi-affine and real, and some vertex attains mu (R. de Gaston and M. Safonov, 1988).

Mixed structures: with the real blocks at a vertex, the complex ones close a loop whose complex mu
is bounded by the power iteration (P. Seiler, A. Packard and G. Balas, "A gain-based lower bound
algorithm for real and mixed mu problems", Automatica 46, 2010).
"""

from __future__ import annotations

from itertools import product

import numpy as np

from workbench.mu.lower_ascent import ascend
from workbench.mu.lower_attain import attained, block_table, turned
from workbench.mu.power import power_batch
from workbench.structure import Real, Structure

PATTERNS = 128
"""Vertices looked at; beyond eight real blocks they are drawn at random."""
EDGE_POINTS = 9, 129
"""Points of an edge, at least and at most, at which eigenvalues are followed ..."""
POINTS = 1024
"""... and how many of all edges are aimed at."""
CANDIDATES = 12
"""Starts that are refined, the most promising ones."""
ROUNDING = 1e-13
"""Imaginary part, relative to the matrix, that is rounding."""


def sign_patterns(count: int, rng: np.random.Generator, limit: int = PATTERNS) -> np.ndarray:
    """Vertices (P, count) of [-1, 1]^count up to a common sign; random where they are too many."""
    if 2 ** (count - 1) <= limit:
        return np.array([(1.0, *rest) for rest in product((1.0, -1.0), repeat=count - 1)])
    patterns = rng.choice([-1.0, 1.0], (limit, count))
    return np.unique(patterns * patterns[:, :1], axis=0)


def real_bound(
    M: np.ndarray, structure: Structure, rng: np.random.Generator
) -> tuple[float, np.ndarray]:
    """Largest real eigenvalue of M Delta found for real blocks only, and its normalised Delta.

    Parameters
    ----------
    M
        Complex (n, n), entries of order one.
    structure
        Real blocks only.
    rng
        Draws vertices where there are too many.

    Returns
    -------
    value, Delta
        0 and zeros where no real eigenvalue was found.
    """
    sizes = [block.rows for block in structure]
    vertices = sign_patterns(len(sizes), rng)
    best, delta = _best_vertex(M, np.repeat(vertices, sizes, axis=1))
    table = block_table(structure)
    starts = [] if best == 0 else [(best, -1, delta)]
    if len(sizes) > 1:
        starts += _edge_candidates(M, sizes, vertices)
    for estimate, block, start in sorted(starts, key=lambda item: -item[0])[:CANDIDATES]:
        there = np.diag(start).astype(complex)
        value = estimate if block < 0 else turned(M, table, there, estimate + 0j, block)[0]
        if value > 0:
            value = ascend(M, table, there, value)
        if value > best:
            best, delta = value, np.diag(there).real
    return best, np.diag(delta).astype(complex)


def _best_vertex(M: np.ndarray, diagonals: np.ndarray) -> tuple[float, np.ndarray]:
    """Largest real eigenvalue of M diag(d) over rows d and -d, 0 for none, and its d."""
    real = M.real if not M.imag.any() else M  # in real arithmetic, real eigenvalues are exact
    values = np.linalg.eigvals(real * diagonals[:, None, :])
    is_real = np.abs(values.imag) <= ROUNDING * np.linalg.norm(M)
    sizes = np.where(is_real, np.abs(values.real), 0.0)
    place = np.unravel_index(np.argmax(sizes), sizes.shape)
    if not sizes[place] > 0:
        return 0.0, np.zeros(len(M))
    return float(sizes[place]), diagonals[place[0]] * np.sign(values[place].real)


def _edge_candidates(
    M: np.ndarray, sizes: list[int], vertices: np.ndarray
) -> list[tuple[float, int, np.ndarray]]:
    """Estimated real eigenvalue, block inside its interval, and diagonal: where Im changes sign."""
    found = []
    count = POINTS // (len(sizes) * len(vertices))
    grid = np.linspace(-1.0, 1.0, int(np.clip(count, *EDGE_POINTS)))
    for block in range(len(sizes)):
        # The block's own sign in a pattern means nothing on the edge along it.
        edges = np.unique(np.delete(vertices, block, axis=1), axis=0)
        points = np.repeat(np.insert(edges, block, 0.0, axis=1)[:, None], len(grid), axis=1)
        points[:, :, block] = grid
        diagonals = np.repeat(points, sizes, axis=2)
        values = np.linalg.eigvals(M * diagonals[:, :, None, :])
        before, after = values[:, :-1], values[:, 1:]
        match = np.argmin(np.abs(before[..., :, None] - after[..., None, :]), axis=-1)
        after = np.take_along_axis(after, match, axis=-1)
        crossing = before.imag * after.imag < 0
        share = np.where(crossing, before.imag / np.where(crossing, before.imag - after.imag, 1), 0)
        estimate = before.real + share * (after.real - before.real)
        where = np.argwhere(crossing)
        order = np.argsort(-np.abs(estimate[crossing]))[:CANDIDATES]
        for edge, step, root in where[order]:
            part = share[edge, step, root]
            start = (1 - part) * diagonals[edge, step] + part * diagonals[edge, step + 1]
            value = float(estimate[edge, step, root])
            found.append((abs(value), block, start * (1.0 if value > 0 else -1.0)))
    return found


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
    is_real = np.array([isinstance(block, Real) for block in structure])
    half = sign_patterns(int(is_real.sum()), rng, PATTERNS // 4)
    complex_part = Structure(block for block in structure if not isinstance(block, Real))
    columns, rows = M.shape
    deltas = np.zeros((2 * len(half), rows, columns), complex)
    own_rows, own_columns = np.zeros(rows, bool), np.zeros(columns, bool)
    signs = iter(np.concatenate([half, -half]).T)
    for real, r, c in zip(is_real, structure.row_slices, structure.column_slices, strict=True):
        if real:
            deltas[:, r, c] = next(signs)[:, None, None] * np.eye(r.stop - r.start)
        else:
            own_rows[r], own_columns[c] = True, True
    closed = level * np.eye(columns) - M @ deltas
    # A loop that is singular here is one of the answers: a slightly larger level shows it.
    singular = np.linalg.cond(closed) > 1e12
    closed[singular] += 1e-6 * level * np.eye(columns)
    loops = np.linalg.solve(closed, M[:, own_rows])
    starts = unit_starts(2, complex_part.rows, rng)
    values, ends = power_batch(
        np.ascontiguousarray(loops[:, own_columns]),
        block_table(complex_part),
        starts,
        np.zeros((len(starts), len(complex_part))),
        False,
    )
    best, which = np.argmax(values, axis=0), np.arange(len(deltas))
    deltas[np.ix_(which, own_rows, own_columns)] = ends[best, which]
    table = block_table(structure)
    reached = np.array([attained(M, table, delta) for delta in deltas])
    value, found = 0.0, np.zeros((rows, columns), complex)
    for index in np.argsort(-reached)[:CANDIDATES]:
        if reached[index] > 0:
            climbed = ascend(M, table, deltas[index], reached[index])
            if climbed > value:
                value, found = climbed, deltas[index]
    return value, found


def unit_starts(count: int, rows: int, rng: np.random.Generator) -> np.ndarray:
    """Random unit vectors b and w for runs of the power iteration, (count, 2, rows)."""
    real, imag = rng.standard_normal((2, count, 2, rows))
    vectors = real + 1j * imag
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
