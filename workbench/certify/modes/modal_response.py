"""Responses of many states at many points, from eigenvectors, refined where digits are lost.

With A V = V L, the states (s I - A)^-1 B are near V (s I - L)^-1 V^-1 B, which takes n operations
for each point and entry instead of n^3. A step of iterative refinement, with the residual B - (s I
- A) X of the given A, shows how many digits are lost, and restores them (Skeel, Iterative
refinement implies numerical stability for Gaussian elimination, Math. Comp. 35 (1980) 817-832).
Errors are measured by the largest entry of a response: this is enough for its norm, but not for mu,
for which small entries may matter as much as large ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from workbench._core.arrays import EPS, Array, ComplexArray, RealArray
from workbench.errors import InputError

FEWEST_DECOMPOSED = 12
"""Least number of states for which a decomposition is faster than elimination at every point. Half
or double changes which way responses of 6 to 23 states are computed, and their last digits.
"""
LARGEST_CONDITION = 1e10
"""Largest condition number of eigenvectors that are used: with rounding of 2e-16 a step of
refinement then gains five digits. Half or double gains a third of a digit more or less at the
limit.
"""
TRIED_POINTS = 4
"""Number of points, spread over the given ones, at which a step of refinement is tried in addition
to the doubtful points. They show whether the estimate of the rounding can be believed, and all
points are refined if not. With half of them a wrong estimate is found less surely; double costs
time.
"""
ROUNDING_FACTOR = 10.0
"""Error of a response by rounding, in units of its estimate. With half of it an estimate that is
too low by more than 5 would be believed; with double of it more points are refined.
"""
UNSETTLED_CHANGE = 1e-3
"""If the last step changes a response by more than this share, the refinement does not converge,
and the response is computed by elimination. A refinement that converges ends near 1e-10. Half or
double decides the same.
"""
STEPS = 4
"""Largest number of steps of refinement. Each gains five digits at least, by `LARGEST_CONDITION`,
so three reach the precision. With half of them ill-conditioned responses have ten digits; more are
not made once the change no longer falls.
"""
ENTRIES_AT_ONCE = 500_000
"""Number of entries of the states that are refined together. They take 8 MB. Half or double changes
memory and time only.
"""


@dataclass(frozen=True, eq=False)
class ModalResponse:
    """A realisation A (n, n), B (n, r), C (c, n) with the eigenvalues and eigenvectors of A.

    Unlike a `StateSpace`, it keeps its eigenvectors, for accurate responses at many points.
    """

    A: RealArray
    B: RealArray
    C: RealArray
    values: ComplexArray
    vectors: ComplexArray
    inverse: ComplexArray

    def at(self, s: ComplexArray, error: float, *, of_largest: bool = False) -> ComplexArray | None:
        """C (s I - A)^-1 B at points s (F,), shape (F, c, r).

        Errors are at most about `error` as a share of the response at the same point, or of the
        largest one, or else the error that elimination in doubles has too. None if refinement does
        not converge.
        """
        found = self._plain(s)
        size = _size(found)
        scale = np.full(len(s), size.max(initial=0.0)) if of_largest else size
        with np.errstate(all="ignore"):
            lost = EPS * self._terms(s) / scale
        suspect = ~(lost <= error / ROUNDING_FACTOR)  # also if that is not a number
        tried = suspect.copy()
        tried[np.linspace(0, len(s) - 1, TRIED_POINTS).astype(int)] = True
        tried[np.argsort(lost)[-TRIED_POINTS:]] = True
        refined, change = self._refined(s[tried], error, scale[tried])
        wrong = _size(refined - found[tried]) > np.maximum(
            error * scale[tried], ROUNDING_FACTOR * change
        )
        found[tried] = refined
        if (wrong & ~suspect[tried]).any():
            found, change = self._refined(s, error, scale)
            tried = np.ones(len(s), bool)
        settled = change <= max(error, UNSETTLED_CHANGE) * scale[tried]
        return found if settled.all() else None

    def _plain(self, s: ComplexArray) -> ComplexArray:
        """The response as a sum over the eigenvalues."""
        (c, n), r = self.C.shape, self.B.shape[1]
        into, out = self.inverse @ self.B, self.C @ self.vectors
        residues = (out.T[:, :, None] * into[:, None, :]).reshape(n, c * r)
        return ((1.0 / (s[:, None] - self.values)) @ residues).reshape(len(s), c, r)

    def _terms(self, s: ComplexArray) -> RealArray:
        """Sum of the sizes of the terms of `_plain` (F,)."""
        size = np.linalg.norm(self.C @ self.vectors, axis=0)
        size = size * np.linalg.norm(self.inverse @ self.B, axis=1)
        terms: RealArray = (1.0 / np.abs(s[:, None] - self.values)) @ size
        return terms

    def _refined(
        self, s: ComplexArray, error: float, scale: RealArray
    ) -> tuple[ComplexArray, RealArray]:
        """The response with refined states, and its last change at each point (F,)."""
        r = self.B.shape[1]
        step = max(ENTRIES_AT_ONCE // max(self.B.size, 1), 1)
        parts, changes = [np.empty((0, len(self.C), r), complex)], [np.empty(0)]
        for start in range(0, len(s), step):
            some, wanted = s[start : start + step], error * scale[start : start + step]
            over = 1.0 / (some - self.values[:, None])
            states = self._solved(np.repeat(self.B[:, None], len(some), axis=1), over)
            found, before = self._output(states), np.full(len(some), np.inf)
            for _ in range(STEPS):
                rest = self.B[:, None] - (some[:, None] * states - _times(self.A, states))
                by = self._solved(rest, over)
                moved = self._output(by)
                change = _size(moved)
                if not (change < before).any():
                    break
                states, found, before = states + by, found + moved, change
                if (change <= wanted).all():
                    break
            parts.append(found)
            changes.append(before)
        return np.concatenate(parts), np.concatenate(changes)

    def _solved(self, right: Array, over: ComplexArray) -> ComplexArray:
        """(s I - A)^-1 times right sides (n, F, r), by the eigenvectors."""
        n, F, r = right.shape
        turned = (self.inverse @ right.reshape(n, F * r)).reshape(n, F, r) * over[:, :, None]
        return (self.vectors @ turned.reshape(n, F * r)).reshape(n, F, r)

    def _output(self, states: ComplexArray) -> ComplexArray:
        """C X (F, c, r) of states X (n, F, r)."""
        return np.moveaxis(_times(self.C, states), 0, 1)


def _size(M: Array) -> RealArray:
    """Largest entry of each matrix (F,)."""
    return np.abs(M).max(axis=(1, 2), initial=0.0)


def _times(M: RealArray, X: ComplexArray) -> ComplexArray:
    """M X (m, F, r) of a real M (m, n), in real arithmetic."""
    n, F, r = X.shape
    parts = np.ascontiguousarray(X).view(float).reshape(n, 2 * F * r)
    return np.ascontiguousarray(M @ parts).view(complex).reshape(len(M), F, r)


@lru_cache(maxsize=4)
def _eigenvectors(entries: bytes, n: int) -> tuple[Array, Array]:
    A = np.frombuffer(entries).reshape(n, n)
    if not np.isfinite(A).all():
        raise InputError("the rates of the system overflow doubles; measure time in another unit")
    values, vectors = np.linalg.eig(A)
    values.flags.writeable = vectors.flags.writeable = False
    return values, vectors


def real_eigenvectors(A: RealArray) -> tuple[Array, Array]:
    """As `numpy.linalg.eig` for a real A (n, n); the results for the last few matrices are kept.

    Raises LinAlgError as `numpy.linalg.eig` does. The result must not be changed.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.certify.modes.modal_response import real_eigenvectors
    >>> real_eigenvectors(np.diag([1.0, 2.0]))[0].tolist()
    [1.0, 2.0]
    """
    return _eigenvectors(np.ascontiguousarray(A, dtype=float).tobytes(), len(A))


@lru_cache(maxsize=4)
def _real_modes(entries: bytes, n: int) -> tuple[Array, Array, RealArray, RealArray]:
    values, vectors = _eigenvectors(entries, n)
    first = np.flatnonzero(values.imag > 0)
    V = vectors.real.copy()
    V[:, first + 1] = vectors.imag[:, first]
    W: RealArray = np.linalg.inv(V)
    first.flags.writeable = V.flags.writeable = W.flags.writeable = False
    return values, first, V, W


def real_modes(A: RealArray) -> tuple[Array, Array, RealArray, RealArray]:
    """Eigenvalues of a real A (n, n), eigenvectors V in real numbers, and an inverse of V.

    The real and the imaginary part of a pair's eigenvector stand side by side. The second result
    holds the indices of their first columns; eigenvalues are in the order of the columns, those
    with positive imaginary parts first. Results are kept and errors raised as by
    `real_eigenvectors`.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.certify.modes.modal_response import real_modes
    >>> values, first, V, W = real_modes(np.array([[-1.0, 2.0], [-2.0, -1.0]]))
    >>> values.round(9).tolist(), first.tolist()
    ([(-1+2j), (-1-2j)], [0])
    >>> (W @ [[-1.0, 2.0], [-2.0, -1.0]] @ V).round(9).tolist()
    [[-1.0, 2.0], [-2.0, -1.0]]
    """
    return _real_modes(np.ascontiguousarray(A, dtype=float).tobytes(), len(A))


def modal_response(A: RealArray, B: RealArray, C: RealArray) -> ModalResponse | None:
    """The realisation with its eigenvectors; None for few states, or if they are nearly
    dependent.
    """
    if len(A) < FEWEST_DECOMPOSED:
        return None
    try:
        values, vectors = real_eigenvectors(A)
        inverse = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        return None
    # Refinement converges only if the computed inverse of the eigenvectors is accurate.
    if not np.linalg.norm(vectors, 1) * np.linalg.norm(inverse, 1) <= LARGEST_CONDITION:
        return None
    return ModalResponse(
        A, B, C, values.astype(complex), vectors.astype(complex), inverse.astype(complex)
    )
