"""Matrices in units fit for search, and the answers found there in the units given.

Delta commutes with scalings by block (by channel, where a scalar is repeated), so mu does not see
them; a search does. Powers of two throughout: no entry is rounded.
"""

from __future__ import annotations

import numpy as np

from workbench.mu.lower.program import LowerBound
from workbench.structure import Full, Structure

SWEEPS = 6
"""Osborne's sweeps."""
ROUNDING = 4 * float(np.finfo(float).eps)
LARGEST = 60.0
"""Bound of the scalings, as a power of two; reducible matrices would ask for infinite ones."""


def scaled(M: np.ndarray, structure: Structure) -> tuple[np.ndarray, np.ndarray]:
    """Balanced matrices (B, columns, rows), norms of order one, and their exponents of two (B,).

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
    for _ in range(SWEEPS):
        for i in range(count):
            weight = squares * 4.0 ** (power[:, :, None] - power[:, None, :])
            left, entered = weight[:, i].sum(axis=1), weight[:, :, i].sum(axis=1)
            usable = (left > 0) & (entered > 0)
            ratio = np.where(usable, entered, 1) / np.where(usable, left, 1)
            step = np.round(0.25 * np.log2(ratio))
            power[:, i] = np.clip(power[:, i] + step, -LARGEST, LARGEST)
    shift = power[:, column][:, :, None] - power[:, row][:, None, :]
    M = _times_power(M, shift.astype(int))
    largest = np.maximum(abs(M.real), abs(M.imag)).max(axis=(1, 2))
    again = np.frexp(largest)[1]
    return np.ascontiguousarray(_times_power(M, -again[:, None, None])), exponent + again


def unscaled(
    value: np.ndarray, Delta: np.ndarray, exponent: np.ndarray, batch: tuple[int, ...]
) -> LowerBound:
    """The bound of real eigenvalues (B,) of M Delta for normalised Deltas (B, rows, columns).

    An eigenvalue that is rounding beside the balanced M is none.
    """
    found = value > Delta.shape[-1] * ROUNDING
    size = np.linalg.norm(np.where(found[:, None, None], Delta, 0), 2, axis=(1, 2))
    found &= size > 0
    bound = np.where(found, value / np.where(found, size, 1), 0.0)
    Delta = _times_power(Delta / np.where(found, value, 1)[:, None, None], -exponent[:, None, None])
    bound = np.ldexp(bound, exponent)
    # Beyond the range of numbers there is nothing to hand back.
    found &= (bound > 0) & np.isfinite(bound) & np.isfinite(Delta).all(axis=(1, 2))
    Delta[~found] = np.nan
    return LowerBound(
        np.where(found, bound, 0.0).reshape(batch), Delta.reshape(*batch, *Delta.shape[1:])
    )


def _times_power(M: np.ndarray, exponent: np.ndarray) -> np.ndarray:
    """M times a power of two, whose own value may be beyond the range of numbers."""
    return np.ldexp(M.real, exponent) + 1j * np.ldexp(M.imag, exponent)


def _channels(structure: Structure) -> tuple[np.ndarray, np.ndarray]:
    """Number of the scaling that each row and each column of Delta takes."""
    row: list[int] = []
    column: list[int] = []
    count = 0
    for block in structure:
        own = 1 if isinstance(block, Full) else block.rows
        row += [count] * block.rows if own == 1 else list(range(count, count + own))
        column += [count] * block.columns if own == 1 else list(range(count, count + own))
        count += own
    return np.array(row), np.array(column)
