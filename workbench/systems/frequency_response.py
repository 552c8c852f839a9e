"""Frequency responses of realisations [A B; C D]."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, RealArray
from workbench.errors import InputError
from workbench.systems.balancing import balancing

CHUNK_ENTRIES = 4_000_000
"""Total entries of the matrices that are solved in one call: 64 MB."""


@lru_cache(maxsize=64)
def _scale(size: bytes, shape: tuple[int, int], states: int) -> RealArray:
    """Factors of the states; kept, for searches ask one system for one frequency at a time."""
    rows, _ = balancing(np.frombuffer(size).reshape(shape), states)
    return rows[:states]


def frequency_response(M: Array, states: int, s: ArrayLike) -> Array:
    """Response D + C (s I - A)^-1 B at points s (F,), shape (..., F, m, p).

    M is [A B; C D], shape (..., n + m, n + p), with n = `states`. The states are scaled first.
    Raises InputError where s is a pole.
    """
    points = np.atleast_1d(np.asarray(s, dtype=complex))
    size = np.ascontiguousarray(abs(M).reshape(-1, *M.shape[-2:]).max(axis=0), dtype=float)
    scale = _scale(size.tobytes(), size.shape, states)
    A = M[..., :states, :states] * scale[:, None] / scale
    B, C = M[..., :states, states:] * scale[:, None], M[..., states:, :states] / scale
    D = M[..., states:, states:]
    result = np.empty((*M.shape[:-2], len(points), *D.shape[-2:]), complex)
    step = max(CHUNK_ENTRIES // max(A.size, 1), 1)
    for start in range(0, len(points), step):
        part = slice(start, start + step)
        resolvent = points[part, None, None] * np.eye(states) - A[..., None, :, :]
        try:
            state = np.linalg.solve(resolvent, B[..., None, :, :])
        except np.linalg.LinAlgError:
            raise InputError(
                f"the system has a pole at one of s = {points[part][0]} ... {points[part][-1]}; "
                "its response there is infinite: leave that frequency out"
            ) from None
        result[..., part, :, :] = C[..., None, :, :] @ state + D[..., None, :, :]
    return result
