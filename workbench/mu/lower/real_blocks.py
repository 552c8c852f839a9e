"""Lower bounds of mu from vertices and edges of the box of real blocks.

For structures of real blocks only, all blocks are put at ends of their intervals, then all but one
(R. Dailey, "A new algorithm for the real structured singular value", ACC 1990). For a real M and
blocks that are not repeated, det(I - M Delta) is multi-affine and real, and some vertex attains mu
(R. de Gaston and M. Safonov, 1988).
"""

from __future__ import annotations

from itertools import product

import numpy as np

from workbench.mu.lower.ascent import ascend
from workbench.mu.lower.attain import block_table, turned
from workbench.structure import Structure

MOST_VERTICES = 128
"""Largest number of vertices tried; with more than eight real blocks they are drawn at random. Half
or double starts the search from fewer or more vertices, for as much less or more time; with eight
blocks half of them leaves vertices out, and a lower bound may be smaller.
"""
EDGE_POINTS = 9, 129
"""Least and largest number of points on an edge at which eigenvalues are followed. Nine still show
where an eigenvalue crosses the axis once; 129 resolve 1 % of the interval. Half may miss crossings
that lie close together; double costs time.
"""
EDGE_POINT_BUDGET = 1024
"""Number of points aimed at over all edges together. It limits the time. Half or double changes the
number of points on an edge between `EDGE_POINTS`, and which crossings that lie close together are
seen.
"""
REFINED_STARTS = 12
"""Number of the most promising starts that are refined. Estimates from edges order them well. With
half of them a bound may be smaller now and then; double costs time.
"""
REAL_BLOCK_EIGENVALUE_TOLERANCE = 1e-13
"""An eigenvalue counts as real if its imaginary part is below this share of the norm of M. It is
450 roundings, as LAPACK's eigenvalues of a few dozen rows may have. With half of it a real
eigenvalue may be missed at a vertex; with double of it a pair with so small an imaginary part
counts, and its proof fails.
"""


def sign_patterns(count: int, rng: np.random.Generator, limit: int = MOST_VERTICES) -> np.ndarray:
    """Vertices (P, count) of [-1, 1]^count up to a common sign.

    All of them if there are at most `limit`; otherwise a random choice.
    """
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
        Generator that draws vertices where there are too many of them.

    Returns
    -------
    value, Delta
        0 and zeros where no real eigenvalue was found.
    """
    sizes = [block.rows for block in structure]
    vertices = sign_patterns(len(sizes), rng)
    best, delta = best_vertex(M, np.repeat(vertices, sizes, axis=1))
    table = block_table(structure)
    starts = [] if best == 0 else [(best, -1, delta)]
    if len(sizes) > 1:
        starts += edge_candidates(M, sizes, vertices)
    for estimate, block, start in sorted(starts, key=lambda item: -item[0])[:REFINED_STARTS]:
        there = np.diag(start).astype(complex)
        value = estimate if block < 0 else turned(M, table, there, estimate + 0j, block)[0]
        if value > 0:
            value = ascend(M, table, there, value)
        if value > best:
            best, delta = value, np.diag(there).real
    return best, np.diag(delta).astype(complex)


def best_vertex(M: np.ndarray, diagonals: np.ndarray) -> tuple[float, np.ndarray]:
    """Largest real eigenvalue (0: none) of M diag(d) over rows d and -d, and its d."""
    real = M.real if not M.imag.any() else M  # in real arithmetic, real eigenvalues are exact
    values = np.linalg.eigvals(real * diagonals[:, None, :])
    is_real = np.abs(values.imag) <= REAL_BLOCK_EIGENVALUE_TOLERANCE * np.linalg.norm(M)
    sizes = np.where(is_real, np.abs(values.real), 0.0)
    place = np.unravel_index(np.argmax(sizes), sizes.shape)
    if not sizes[place] > 0:
        return 0.0, np.zeros(len(M))
    return float(sizes[place]), diagonals[place[0]] * np.sign(values[place].real)


def edge_candidates(
    M: np.ndarray, sizes: list[int], vertices: np.ndarray
) -> list[tuple[float, int, np.ndarray]]:
    """Points on edges of the box where the imaginary part of an eigenvalue changes its sign.

    Each is an estimate of the real eigenvalue, the index of the block inside its interval, and the
    diagonal of Delta.
    """
    found = []
    count = EDGE_POINT_BUDGET // (len(sizes) * len(vertices))
    grid = np.linspace(-1.0, 1.0, int(np.clip(count, *EDGE_POINTS)))
    for block in range(len(sizes)):
        # On an edge along the block, the block's own sign in a pattern does not matter.
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
        order = np.argsort(-np.abs(estimate[crossing]))[:REFINED_STARTS]
        for edge, step, root in where[order]:
            part = share[edge, step, root]
            start = (1 - part) * diagonals[edge, step] + part * diagonals[edge, step + 1]
            value = float(estimate[edge, step, root])
            found.append((abs(value), block, start * (1.0 if value > 0 else -1.0)))
    return found


def unit_starts(count: int, rows: int, rng: np.random.Generator) -> np.ndarray:
    """Random unit vectors b and w for runs of the power iteration, (count, 2, rows)."""
    real, imag = rng.standard_normal((2, count, 2, rows))
    vectors = real + 1j * imag
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
