"""The central path followed for each matrix of a batch."""

from __future__ import annotations

import numpy as np

from workbench.compiled import compiled
from workbench.mu.upper_balance import NOTHING, balance, power_of_two
from workbench.mu.upper_linear import factor, inverse
from workbench.mu.upper_path import follow, square
from workbench.mu.upper_pattern import Pattern, fill

ITERATIONS = 60


@compiled
def solve_each(
    batch: np.ndarray,
    pattern: Pattern,
    accuracy: float,
    D: np.ndarray,
    G: np.ndarray,
    gaps: np.ndarray,
    iterations: np.ndarray,
) -> None:
    """Compact multipliers ``D`` and ``G`` (F, N, N) of every matrix of a ``batch`` (F, c, r).

    ``gaps`` (F,) receives the duality gap of t = beta^2, relative, as the path estimates it, and
    ``iterations`` how many it took. The scale of D is one of many that serve.
    """
    count, c, r = batch.shape
    M = np.zeros((c, r), np.complex128)
    E = np.ones(pattern.size)
    x = np.zeros(pattern.row.size)
    S, L, work, Z = square(r), square(r), square(r), square(r)
    W = square(pattern.size)
    for f in range(count):
        M[:] = batch[f]
        E[:] = 1.0
        scale = _unit(M)
        if scale > 0.0:
            norm = balance(pattern, M, E)
            if norm <= NOTHING:
                scale = 0.0
            else:
                scale *= _unit(M)
        x[:] = 0.0
        for k in range(x.size):
            if pattern.kind[k] == 0 and not pattern.skew[k]:
                x[k] = 1.0
        if scale > 0.0:
            t = _start(M, S, L, work, Z, W)
            _, gap, taken = follow(M, pattern, t, x, Z, W, accuracy, ITERATIONS)
            gaps[f] = gap
            iterations[f] = taken
        fill(pattern, x, D[f], G[f])
        for i in range(pattern.size):
            for j in range(pattern.size):
                D[f, i, j] *= E[i] * E[j]
                G[f, i, j] *= E[i] * E[j] * scale


@compiled
def _unit(M: np.ndarray) -> float:
    """Scale M to entries near 1 by a power of two, and return it; 0 for a zero matrix."""
    largest = 0.0
    for i in range(M.shape[0]):
        for j in range(M.shape[1]):
            largest = max(largest, abs(M[i, j]))
    if largest == 0.0:
        return 0.0
    scale = power_of_two(largest)
    for i in range(M.shape[0]):
        for j in range(M.shape[1]):
            M[i, j] /= scale
    return scale


@compiled
def _start(
    M: np.ndarray, S: np.ndarray, L: np.ndarray, work: np.ndarray, Z: np.ndarray, W: np.ndarray
) -> float:
    """A centred point for D = I, G = 0: t above the largest singular value squared, Z and W."""
    c, r = M.shape
    size = 0.0
    for i in range(r):
        for j in range(i + 1):
            total = 0.0j
            for k in range(c):
                total -= np.conj(M[k, i]) * M[k, j]
            S[i, j] = total
        size -= S[i, i].real
    t = 1.05 * size
    for i in range(r):
        S[i, i] += t
    factor(S, L)
    inverse(L, work, Z)
    trace = 0.0
    for i in range(r):
        trace += Z[i, i].real
    for i in range(r):
        for j in range(r):
            Z[i, j] /= trace
    W[:] = 0.0
    for i in range(W.shape[0]):
        W[i, i] = 1.0 / trace
    return t
