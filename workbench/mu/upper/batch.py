"""Upper bounds of mu for a batch of matrices by following the central path of each."""

from __future__ import annotations

import numpy as np

from workbench._core.compiled import compiled, unchecked_kernel
from workbench.mu.upper.balance import rescale
from workbench.mu.upper.linear_algebra import copy, inner
from workbench.mu.upper.path import follow
from workbench.mu.upper.pattern import Pattern, fill

PATH_ITERATIONS = 100
"""Largest number of iterations along the central path of one matrix. With half of them paths of
ill-conditioned matrices may end with a looser bound; with twice as many these take longer.
"""
WARM_START_RISES = (1.0, 1.1, 1.3)
"""Factors on t of the previous matrix's early point, tried in turn until a path starts from there.
They allow a neighbour's mu to be larger by 5 and by 14 %. Half or double of the distances from 1:
more paths start anew, or begin farther away. The bound is the same to its accuracy.
"""


@compiled
def solve_each(
    batch: np.ndarray,
    pattern: Pattern,
    accuracy: float,
    level: float,
    D: np.ndarray,
    G: np.ndarray,
    gaps: np.ndarray,
    iterations: np.ndarray,
) -> None:
    """Compute compact multipliers ``D`` and ``G`` (F, N, N) for a ``batch`` (F, c, r).

    A bound up to the level is low enough; 0 asks for the least one. ``gaps`` (F,) receives the
    path's estimate of the relative duality gap of t = beta^2, 0 for a bound that is low enough, and
    ``iterations`` (F,) the iterations made. The scale of D is arbitrary.
    """
    count, c, r = batch.shape
    M = np.zeros((c, r), np.complex128)
    E, last_E = np.ones(pattern.size), np.ones(pattern.size)
    x, early = np.zeros(pattern.row.size), np.zeros(pattern.row.size)
    early_t, last_scale = 0.0, 0.0
    for f in range(count):
        # copied entry by entry: copying slices would make Numba compile their error messages, which
        # takes seconds
        for i in range(c):
            for j in range(r):
                M[i, j] = batch[f, i, j] * (E[pattern.left[i]] / E[pattern.right[j]])
        scale = rescale(pattern.left, pattern.right, M, E)
        if scale > 0.0:
            solved = False
            enough = (level / scale) ** 2
            if scale == last_scale and _same(last_E, E):
                for rise in WARM_START_RISES:
                    copy(early, x)
                    start = rise * early_t
                    early_t, gaps[f], iterations[f] = follow(
                        M, pattern, start, x, early, accuracy, PATH_ITERATIONS, enough
                    )
                    solved = gaps[f] <= accuracy
                    if early_t > 0.0:
                        break
                    early_t = start / rise
            if not solved:
                _identity(pattern, x)
                early_t, gaps[f], iterations[f] = follow(
                    M, pattern, _squared_gain_bound(M), x, early, accuracy, PATH_ITERATIONS, enough
                )
            last_scale = scale if early_t > 0.0 else 0.0
            copy(E, last_E)
        else:
            _identity(pattern, x)
            last_scale = 0.0
        fill(pattern, x, D[f], G[f])
        for i in range(pattern.size):
            for j in range(pattern.size):
                D[f, i, j] *= E[i] * E[j]
                G[f, i, j] *= E[i] * E[j] * scale
        if scale == 0.0:
            for k in range(E.size):
                E[k] = 1.0


@unchecked_kernel
def _identity(pattern: Pattern, x: np.ndarray) -> None:
    """Set the unknowns x to those of D = I, G = 0."""
    for k in range(x.size):
        x[k] = 1.0 if pattern.kind[k] == 0 and not pattern.skew[k] else 0.0


@unchecked_kernel
def _same(x: np.ndarray, y: np.ndarray) -> bool:
    """Whether two vectors are equal."""
    same = True
    for k in range(x.size):
        same = same and x[k] == y[k]
    return same


@unchecked_kernel
def _squared_gain_bound(M: np.ndarray) -> float:
    """A number above the square of the largest singular value."""
    return 1.05 * inner(M, M)
