"""Frequency responses of realisations [A B; C D]."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, RealArray
from workbench.errors import InputError
from workbench.systems.balancing import balancing
from workbench.systems.modal_response import ModalResponse, modal_response

CHUNK_ENTRIES = 4_000_000
"""Total entries of the matrices that are solved in one call: 64 MB."""

FEWEST_STATES, FEWEST_POINTS = 60, 4
"""Fewest states, and points, for which eigenvectors take less time than elimination."""
RESPONSE_ERROR = 1e-8
"""Relative error of a response by eigenvectors above which it is refined."""


@lru_cache(maxsize=64)
def _scale(size: bytes, shape: tuple[int, int], states: int) -> RealArray:
    """Factors of the states; kept, for searches ask one system for one frequency at a time."""
    rows, _ = balancing(np.frombuffer(size).reshape(shape), states)
    return rows[:states]


@lru_cache(maxsize=8)
def _modal(entries: bytes, rows: int, states: int) -> ModalResponse | None:
    """The eigenvectors of a realisation; kept as `_scale`."""
    M = np.frombuffer(entries).reshape(rows, -1)
    return modal_response(M[:states, :states], M[:states, states:], M[states:, :states])


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
    if (
        M.ndim == 2
        and M.dtype == float
        and states >= FEWEST_STATES
        and len(points) >= FEWEST_POINTS
    ):
        modal = _modal(np.block([[A, B], [C, D]]).tobytes(), len(M), states)
        found = modal and modal.at(points, RESPONSE_ERROR)
        if found is not None:
            return found + D
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
