"""A response as a sum of partial fractions, with a bound of its error on the imaginary axis.

Let V be approximate eigenvectors of A, L the diagonal of its approximate eigenvalues l, W an
approximate inverse of V and R = A V - V L the residual. Then

    W (s I - A) V = (1 + F) (s I - L),   F = (W V - 1) - W R (s I - L)^-1,

and with c = C V and b = W B the response is D + c (s I - L)^-1 (1 + F)^-1 b: the sum of the
fractions c_i b_i / (s - l_i), up to a small term. If |F| is proven to be small for every s right of
the axis, A is stable. Only R is computed to high precision; the other products are enclosed in
doubles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import EPS, Array, ComplexArray, RealArray
from workbench.certify.modes.modal_response import real_modes
from workbench.certify.rounding import (
    TINY,
    UPWARD,
    Enclosure,
    amplified,
    exact,
    residual_product,
)

LEAST_NORM = 1e-150
"""Amount added to a norm. Squares lose digits below 1e-308, that is of entries below 1e-154; the
norm of 1e7 of them is below this. Half or double changes nothing else.
"""


@dataclass(frozen=True, eq=False)
class PartialFractions:
    """D + sum_i c_i b_i / (j omega - l_i), an approximation of the response of a stable system.

    ``poles`` l (n,), all left of the axis, ``into`` b (n, r), ``out`` c (m, n), ``D`` (m, r).
    """

    poles: ComplexArray
    into: ComplexArray
    out: ComplexArray
    D: RealArray
    distance: RealArray
    """Lower bounds (n,) of the distances of the poles from the axis."""
    sizes: RealArray
    """Upper bounds (n,) of the spectral norms of c_i b_i."""
    _fixed: RealArray
    """Factors (n,) of 1 / |j omega - l_i| in the error bound."""
    _mixing: RealArray
    """Bounds of the entries of W R (n, n)."""
    _out: RealArray
    """Norms of the columns of c (n,)."""
    _reached: RealArray
    """Bounds of the norms of the rows of (1 + F)^-1 b (n,)."""
    _direct: float
    """Error bound of D."""

    def error(self, resolvent: RealArray) -> RealArray:
        """Upper bounds (F,) of the spectral norm of the error of the fractions.

        ``resolvent`` (F, n): upper bounds of 1 / |j omega - l_i|, each for an interval of omega.
        """
        mixed = (resolvent * self._reached) @ self._mixing.T
        found = resolvent @ self._fixed + (resolvent * self._out * mixed).sum(axis=1)
        largest = (1.0 + self._out.max()) * (1.0 + self._mixing.max())
        underflow = len(self.poles) ** 2 * TINY * largest * (1.0 + resolvent.max(axis=1))
        error: RealArray = (found + self._direct + underflow) * UPWARD
        return error


def enclosed_fractions(
    A: Enclosure, B: Enclosure, C: Enclosure, D: Enclosure
) -> PartialFractions | None:
    """The fractions of real matrices A (n, n), B (n, r), C (m, n) and D (m, r).

    None if A is not proven to be stable, or if there are no states.
    """
    n = len(A.mid)
    if not n or not all(part.finite for part in (A, B, C, D)):
        return None
    try:
        poles, first, T, W = real_modes(A.mid)
    except np.linalg.LinAlgError:
        return None
    if not (poles.real < 0.0).all():
        return None
    poles = poles.astype(complex)
    L = np.diag(poles.real)
    L[first, first + 1], L[first + 1, first] = poles.imag[first], -poles.imag[first]
    residual = residual_product(np.hstack([A.mid, T]), np.vstack([T, -L]))
    if A.rad.any():
        moved = A.rad @ np.abs(T)
        residual = Enclosure(residual.mid, (residual.rad + moved) * UPWARD)
    mixing = _between_modes(exact(W) @ residual, first)
    basis = _between_modes(exact(W) @ exact(T) - exact(np.eye(n)), first)
    into, out = _entering(exact(W) @ B, first), _leaving(C @ exact(T), first)
    distance = -poles.real * (1.0 - 4 * EPS)
    with np.errstate(all="ignore"):
        F = (basis + mixing / distance) * UPWARD
        driven = (np.abs(into.mid) + into.rad) * UPWARD
        more = amplified(F, F @ driven * UPWARD) if np.isfinite(F).all() else None
    if more is None:
        return None
    reached = _norms(driven + more, 1)
    outer, entering = _norms(np.abs(out.mid) + out.rad, 0), _norms(np.abs(into.mid), 1)
    fixed = outer * (basis @ reached + _norms(into.rad, 1)) + _norms(out.rad, 0) * entering
    return PartialFractions(
        poles,
        into.mid.astype(complex),
        out.mid.astype(complex),
        np.asarray(D.mid, dtype=float),
        distance,
        outer * entering * UPWARD,
        fixed * UPWARD,
        mixing,
        outer,
        reached,
        float(_norms(D.rad.ravel(), 0)) if D.rad.any() else 0.0,
    )


def _norms(M: RealArray, axis: int) -> RealArray:
    """Upper bounds of the Euclidean norms of rows or columns."""
    norms: RealArray = np.linalg.norm(M, axis=axis) * UPWARD + LEAST_NORM
    return norms


def _between_modes(matrix: Enclosure, first: Array) -> RealArray:
    """Bounds of the entries of K^-1 M K, with K made of blocks [1 1; j -j] for the pairs at
    `first`.
    """
    size, second = np.abs(matrix.mid) + matrix.rad, first + 1
    size[:, first] = size[:, second] = size[:, first] + size[:, second]
    size[first] = size[second] = (size[first] + size[second]) / 2
    return size * UPWARD


def _entering(matrix: Enclosure, first: Array) -> Enclosure:
    """K^-1 M."""
    second, mid, rad = first + 1, matrix.mid.astype(complex), matrix.rad.copy()
    mid[first] = (mid[first] - 1j * mid[second]) / 2  # halves of doubles are exact
    mid[second] = mid[first].conj()
    rad[first] = rad[second] = (rad[first] + rad[second]) / 2 * UPWARD
    return Enclosure(mid, rad)


def _leaving(matrix: Enclosure, first: Array) -> Enclosure:
    """M K."""
    second, mid, rad = first + 1, matrix.mid.astype(complex), matrix.rad.copy()
    mid[:, first] = mid[:, first] + 1j * mid[:, second]
    mid[:, second] = mid[:, first].conj()
    rad[:, first] = rad[:, second] = (rad[:, first] + rad[:, second]) * UPWARD
    return Enclosure(mid, rad)
