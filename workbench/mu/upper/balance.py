"""Osborne's balancing by a diagonal D of powers of two, which causes no rounding."""

from __future__ import annotations

import math

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.compiled import compiled, unchecked_kernel
from workbench.mu.upper.linear_algebra import inner
from workbench.mu.upper.pattern import Pattern

MOST_SWEEPS = 60
"""Largest number of sweeps over the scalings; the balancing ends earlier if nothing changes any
more. Matrices that couple nearly in one direction approach a limit slowly. With half of them such a
start is worse; double costs time there.
"""
COUPLING_FLOOR = 1e-10
"""Norms of rows and columns below this share of the whole norm are raised to it. Otherwise entries
that couple in one direction only would be scaled down without end. It is above the rounding of a
sum over a row. With half of it scalings are a little larger; double balances less. Every scaling is
valid.
"""
NILPOTENT_NORM = 1e-30
"""A matrix that can be scaled to this norm counts as nilpotent, with bound zero. The matrix had
norm 1 before, and balancing takes a nilpotent one on towards 0. Half or double decides the same for
all but norms next to it.
"""


def balanced_batch(
    batch: ComplexArray, pattern: Pattern
) -> tuple[ComplexArray, RealArray, RealArray]:
    """E batch E^-1 / scale for matrices (F, c, r), balanced; E (F, N) and scale (F,).

    Both are powers of two. A scale of 0 stands for a matrix whose bound is 0.
    """
    M, E = np.array(batch, order="C"), np.ones((len(batch), pattern.size))
    scale = np.empty(len(batch))
    _balance_each(pattern.left, pattern.right, M, E, scale)
    return M, E, scale


@compiled
def _balance_each(
    left: np.ndarray, right: np.ndarray, M: np.ndarray, E: np.ndarray, scale: np.ndarray
) -> None:
    """Balance matrices M (F, c, r) in place."""
    for f in range(len(M)):
        scale[f] = rescale(left, right, M[f], E[f])


@unchecked_kernel
def power_of_two(value: float) -> float:
    """The power of two nearest to a positive value on a logarithmic scale."""
    return 2.0 ** np.rint(np.log2(value))


@unchecked_kernel
def rescale(left: np.ndarray, right: np.ndarray, M: np.ndarray, E: np.ndarray) -> float:
    """Balance M, scaled by the given E, in place; return the power of two by which it was divided.

    The result is 0 if M is nilpotent or 0; see `_balance` for the other arguments.
    """
    scale = _unit(M)
    if scale > 0.0:
        norm = _balance(left, right, M, E)
        scale = scale * _unit(M) if norm > NILPOTENT_NORM else 0.0
    return scale


@unchecked_kernel
def _unit(M: np.ndarray) -> float:
    """Divide M by a power of two near its largest entry, and return this power; 0 if M = 0."""
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


@unchecked_kernel
def _balance(left: np.ndarray, right: np.ndarray, M: np.ndarray, E: np.ndarray) -> float:
    """Replace M by E M E^-1 whose rows and columns have nearly equal norms.

    ``left`` (c,) and ``right`` (r,) are the compact indices of its rows and columns. E (N,) holds
    powers of two and is changed in place; M must already be scaled by the E given.
    Each channel of a repeated scalar has its own factor, a full block has one for all channels.

    Returns
    -------
    The Frobenius norm of the scaled M.
    """
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
