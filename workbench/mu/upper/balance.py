"""Osborne's balancing by a diagonal D of powers of two, which causes no rounding."""

from __future__ import annotations

import math

import numpy as np

from workbench.compiled import compiled
from workbench.mu.upper.linear_algebra import inner
from workbench.mu.upper.pattern import Pattern

MOST_SWEEPS = 60
"""Most sweeps over the scalings; fewer are made where nothing changes any more."""
COUPLING_FLOOR = 1e-10
"""Norms of rows and columns below this share of the whole norm are set to it, so that entries that
couple in one direction only are not made smaller without end."""
NILPOTENT_NORM = 1e-30
"""A matrix that can be scaled to this norm counts as nilpotent, with bound zero."""


@compiled
def power_of_two(value: float) -> float:
    """The power of two nearest to a positive value on a logarithmic scale."""
    return 2.0 ** np.rint(np.log2(value))


@compiled
def balance(pattern: Pattern, M: np.ndarray, E: np.ndarray) -> float:
    """Replace M by E M E^-1 whose rows and columns have nearly equal norms.

    E (N,) holds powers of two and is changed in place; M must already be scaled by the E given.
    Each channel of a repeated scalar has its own factor, a full block has one for all channels.

    Returns
    -------
    The Frobenius norm of the scaled M.
    """
    left, right = pattern.left, pattern.right
    c, r = M.shape
    for _ in range(MOST_SWEEPS):
        norm, moved = math.sqrt(inner(M, M)), False
        if norm <= NILPOTENT_NORM:
            return norm
        for k in range(E.size):
            row, column = 0.0, 0.0
            for i in range(c):
                if left[i] == k:
                    for j in range(r):
                        if right[j] != k:
                            row += M[i, j].real ** 2 + M[i, j].imag ** 2
            for j in range(r):
                if right[j] == k:
                    for i in range(c):
                        if left[i] != k:
                            column += M[i, j].real ** 2 + M[i, j].imag ** 2
            row = max(math.sqrt(row), COUPLING_FLOOR * norm)
            column = max(math.sqrt(column), COUPLING_FLOOR * norm)
            scale = power_of_two(math.sqrt(column / row))
            if scale != 1.0:
                moved = True
                E[k] *= scale
                for i in range(c):
                    for j in range(r):
                        if left[i] == k:
                            M[i, j] *= scale
                        if right[j] == k:
                            M[i, j] /= scale
        if not moved:
            return norm
    return math.sqrt(inner(M, M))
