"""Osborne's balancing: a diagonal D with powers of two, so that it costs no rounding."""

from __future__ import annotations

import math

import numpy as np

from workbench.compiled import compiled
from workbench.mu.upper.pattern import Pattern

SWEEPS = 60
FLOOR = 1e-10
"""What couples only one way is made this small against the whole, and then left."""
NOTHING = 1e-30
"""A matrix that can be scaled this small is taken as nilpotent, with bound zero."""


@compiled
def power_of_two(value: float) -> float:
    """The power of two next to a positive value."""
    return 2.0 ** np.rint(np.log2(value))


@compiled
def balance(pattern: Pattern, M: np.ndarray, E: np.ndarray) -> float:
    """Replace M by E M E^-1 with rows and columns of equal norm, as nearly as powers of two can.

    E (N,) starts from what it is given as, and M must have been scaled with that. Repeated scalars
    are scaled one by one, a full block as a whole.

    Returns
    -------
    The Frobenius norm of what is left of M.
    """
    left, right = pattern.left, pattern.right
    c, r = M.shape
    norm = 0.0
    for _ in range(SWEEPS):
        moved = False
        for k in range(E.size):
            norm, row, column = 0.0, 0.0, 0.0
            for i in range(c):
                for j in range(r):
                    square = M[i, j].real ** 2 + M[i, j].imag ** 2
                    norm += square
                    if left[i] == k and right[j] != k:
                        row += square
                    elif left[i] != k and right[j] == k:
                        column += square
            norm = math.sqrt(norm)
            if norm <= NOTHING:
                return norm
            row = max(math.sqrt(row), FLOOR * norm)
            column = max(math.sqrt(column), FLOOR * norm)
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
            break
    return norm
