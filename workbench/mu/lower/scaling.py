"""Balancing of matrices before a search for lower bounds, and rescaling of the bounds found.

Delta commutes with a scaling of each block (of each channel of a repeated scalar), so such scalings
do not change mu, but they help a search. All are powers of two, so that no entry is rounded.
"""

from __future__ import annotations

import numpy as np

from workbench.mu.lower.program import LowerBound
from workbench.structure import Full, Structure

OSBORNE_SWEEPS = 6
"""Sweeps of Osborne's method over all scalings. Powers of two need no more accuracy, and every
scaling is valid. With half of them matrices of many channels are scaled less well; more change
nothing once sweeps agree.
"""
EIGENVALUE_ROUNDING = 4 * float(np.finfo(float).eps)
"""Eigenvalues of a balanced matrix of size n below n times this count as rounding errors."""
LARGEST_SCALING_EXPONENT = 60.0
"""Largest exponent of two of a scaling; reducible matrices would lead to infinite scalings. Entries
of 2^60 leave nothing of others in a double. Half or double still keeps products of scaled entries
far inside the range of doubles.
"""


def scaled_matrices(M: np.ndarray, structure: Structure) -> tuple[np.ndarray, np.ndarray]:
    """Balanced matrices (B, columns, rows) of norms near 1, and their exponents of two (B,).

    Source: E. Osborne, "On pre-conditioning of matrices", J. ACM 7 (1960).
    """
    largest = np.maximum(abs(M.real), abs(M.imag)).max(axis=(1, 2))
    exponent = np.frexp(largest)[1]
    exponent[largest == 0] = 0
    M = _times_power(M, -exponent[:, None, None])
    row, column = _channels(structure)
    count = row.max() + 1
    into, out_of = np.eye(count)[column], np.eye(count)[row]
    squares = into.T @ (M.real**2 + M.imag**2) @ out_of  # (B, channels, channels)
    squares[:, range(count), range(count)] = 0
    power = np.zeros((len(M), count))
    for _ in range(OSBORNE_SWEEPS):
        for i in range(count):
            weight = squares * 4.0 ** (power[:, :, None] - power[:, None, :])
            left, entered = weight[:, i].sum(axis=1), weight[:, :, i].sum(axis=1)
            usable = (left > 0) & (entered > 0)
            # The quotient of both may overflow, the difference of logarithms does not.
            ratio = np.log2(np.where(usable, entered, 1)) - np.log2(np.where(usable, left, 1))
            step = np.round(0.25 * ratio)
            power[:, i] = np.clip(
                power[:, i] + step, -LARGEST_SCALING_EXPONENT, LARGEST_SCALING_EXPONENT
            )
    shift = power[:, column][:, :, None] - power[:, row][:, None, :]
    M = _times_power(M, shift.astype(int))
    largest = np.maximum(abs(M.real), abs(M.imag)).max(axis=(1, 2))
    again = np.frexp(largest)[1]
    return np.ascontiguousarray(_times_power(M, -again[:, None, None])), exponent + again


def unscaled(value: np.ndarray, Delta: np.ndarray, exponent: np.ndarray) -> LowerBound:
    """Proposed bounds from eigenvalues (B,) of M Delta for normalised Deltas (B, rows, columns).

    An eigenvalue as small as the rounding errors of the balanced M counts as not found.
    """
    found = value > Delta.shape[-1] * EIGENVALUE_ROUNDING
    size = np.linalg.norm(np.where(found[:, None, None], Delta, 0), 2, axis=(1, 2))
    found &= size > 0
    bound = np.where(found, value / np.where(found, size, 1), 0.0)
    Delta = _times_power(Delta / np.where(found, value, 1)[:, None, None], -exponent[:, None, None])
    bound = np.ldexp(bound, exponent)
    # A bound or Delta beyond the range of floating-point numbers cannot be returned.
    found &= (bound > 0) & np.isfinite(bound) & np.isfinite(Delta).all(axis=(1, 2))
    Delta[~found] = np.nan
    return LowerBound(np.where(found, bound, 0.0), Delta)


def _times_power(M: np.ndarray, exponent: np.ndarray) -> np.ndarray:
    """M times 2^exponent, where 2^exponent itself may overflow."""
    return np.ldexp(M.real, exponent) + 1j * np.ldexp(M.imag, exponent)


def _channels(structure: Structure) -> tuple[np.ndarray, np.ndarray]:
    """Index of the scaling that belongs to each row and to each column of Delta."""
    row: list[int] = []
    column: list[int] = []
    count = 0
    for block in structure:
        own = 1 if isinstance(block, Full) else block.rows
        row += [count] * block.rows if own == 1 else list(range(count, count + own))
        column += [count] * block.columns if own == 1 else list(range(count, count + own))
        count += own
    return np.array(row), np.array(column)
