"""Frequency responses of realisations [A B; C D]."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from workbench._core.arrays import Array, RealArray
from workbench.errors import InputError
from workbench.systems.balancing import balancing

CHUNK_ENTRIES = 4_000_000
"""Total number of entries of the matrices solved in one call: 64 MB."""

MANY_STATES, MANY_POINTS = 60, 4
"""Least number of states, and of points, for which responses are computed in Schur coordinates."""
LARGEST_SPREAD = 1e5
"""Schur coordinates are not used if the largest entry of A exceeds its smallest pole by this
factor.
"""


@lru_cache(maxsize=64)
def _scale(size: bytes, shape: tuple[int, int], states: int) -> RealArray:
    """Scaling factors of the states; kept, since searches ask for one frequency of a system at a
    time.
    """
    rows, _ = balancing(np.frombuffer(size).reshape(shape), states)
    return rows[:states]


def frequency_response(M: Array, states: int, s: ArrayLike) -> Array:
    """Response D + C (s I - A)^-1 B at points s (F,), shape (..., F, m, p).

    M is [A B; C D], shape (..., n + m, n + p), with n = `states`. The states are scaled first.
    Raises InputError if s is a pole.
    """
    return response_of_scaled(with_scaled_states(M, states), states, s)


def with_scaled_states(M: Array, states: int) -> Array:
    """[A B; C D] with states scaled by powers of two, the same for several realisations."""
    size = np.ascontiguousarray(abs(M).reshape(-1, *M.shape[-2:]).max(axis=0), dtype=float)
    scale = _scale(size.tobytes(), size.shape, states)
    scaled = np.array(M)
    scaled[..., :states, :] *= scale[:, None]
    scaled[..., :, :states] /= scale
    return scaled


def response_of_scaled(M: Array, states: int, s: ArrayLike) -> Array:
    """`frequency_response` of a realisation whose states are scaled already."""
    points = np.atleast_1d(np.asarray(s, dtype=complex))
    A, B = M[..., :states, :states], M[..., :states, states:]
    C, D = M[..., states:, :states], M[..., states:, states:]
    result = np.empty((*M.shape[:-2], len(points), *D.shape[-2:]), complex)
    many = states >= MANY_STATES and len(points) >= MANY_POINTS
    if many and M.ndim == 2 and np.isrealobj(M) and np.isfinite(M).all():
        form = _kept_form(np.asarray(M, float).tobytes(), M.shape, states)
        if form is not None:
            _need_no_pole(np.diagonal(form[0]), points)
            result[...] = triangular_response(form, points) + D
            return result
    step = max(CHUNK_ENTRIES // max(A.size, 1), 1)
    for start in range(0, len(points), step):
        part = slice(start, start + step)
        try:
            state = driven_states(A, B, points[part])
        except np.linalg.LinAlgError:
            raise _infinite(points[part]) from None
        result[..., part, :, :] = C[..., None, :, :] @ state + D[..., None, :, :]
    return result


def driven_states(A: Array, B: Array, s: Array) -> Array:
    """(s I - A)^-1 B at points s (F,), shape (..., F, n, m), for A (..., n, n) and B (..., n, m).

    Each is computed with time in units of a power of two in which its largest entry is near 1: for
    an imaginary pivot such as j omega, some libraries fail on numbers beyond single precision.
    Raises LinAlgError if s is a pole.
    """
    n = A.shape[-1]
    size = np.maximum(np.abs(s), np.abs(A).max(initial=0.0))
    unit = np.ldexp(1.0, np.frexp(size)[1] - 1)[:, None, None]
    resolvent = s[:, None, None] / unit * np.eye(n) - A[..., None, :, :] / unit
    with np.errstate(over="ignore"):
        right = B[..., None, :, :] / unit
    return np.asarray(np.linalg.solve(resolvent, right))


Triangular = tuple[Array, Array, Array]
"""An upper triangular A (n, n), with B (n, p) and C (m, n) in its coordinates."""


def triangular_form(A: Array, B: Array, C: Array, poles: Array | None = None) -> Triangular | None:
    """A, B and C in Schur coordinates; None for few states, or for states of very different size.

    For states of very different size, an elimination keeps digits of small states that an
    orthogonal basis would lose. The given poles decide this beforehand.
    """
    if len(A) < MANY_STATES or (poles is not None and _differ_widely(poles, A)):
        return None
    T, Q = scipy.linalg.schur(A.astype(complex), output="complex")
    return None if _differ_widely(np.diagonal(T), A) else (T, Q.conj().T @ B, C @ Q)


def _differ_widely(poles: Array, A: Array) -> bool:
    return not np.abs(poles).min() * LARGEST_SPREAD > np.abs(A).max()


@lru_cache(maxsize=8)
def _kept_form(data: bytes, shape: tuple[int, int], states: int) -> Triangular | None:
    """The `triangular_form` of [A B; C D]; kept, like `_scale`."""
    M = np.frombuffer(data).reshape(shape)
    return triangular_form(M[:states, :states], M[:states, states:], M[states:, :states])


def triangular_response(form: Triangular, s: Array) -> Array:
    """C (s I - T)^-1 B (F, m, p) at points s (F,), by substitution at all points at once."""
    T, B, C = form
    (n, p), F = B.shape, len(s)
    X = np.empty((n, F, p), complex)
    for i in reversed(range(n)):
        beside = (T[i, i + 1 :] @ X[i + 1 :].reshape(n - 1 - i, F * p)).reshape(F, p)
        X[i] = (B[i] + beside) / (s - T[i, i])[:, None]
    response: Array = C @ np.moveaxis(X, 0, 1)
    return response


def _need_no_pole(poles: Array, points: Array) -> None:
    """Raise InputError if a point is a pole."""
    for start in range(0, len(points), CHUNK_ENTRIES // len(poles)):
        part = points[start : start + CHUNK_ENTRIES // len(poles)]
        if (part[:, None] == poles).any():
            raise _infinite(part)


def _infinite(points: Array) -> InputError:
    return InputError(
        f"the system has a pole at one of s = {points[0]} ... {points[-1]}; "
        "its response there is infinite: leave that frequency out"
    )
