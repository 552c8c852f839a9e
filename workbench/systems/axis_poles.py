"""Poles on the stability boundary, split off from the stable ones of a realisation.

Rounding moves a repeated pole at 0 by the root of the rounding error, to either side of the axis.
Poles at 0 are therefore decided by ranks, and poles elsewhere on the axis by the distance of the
matrix from one with a pole there: both answers hold for all entries that differ from the given ones
by rounding.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag, schur
from scipy.linalg.lapack import dtrsen

from workbench._core.arrays import EPS, BoolArray, ComplexArray, RealArray
from workbench.systems.balancing import axis_rounding, integrators_first
from workbench.systems.frequency_response import driven_states

EIGENVECTOR_MARGIN = 10.0
"""Factor that allows for rounding of eigenvalues, eigenvectors and their condition number."""
POLE_ROUNDINGS = 4
"""Multiple of the relative rounding error of every entry of a matrix, within which its poles may
move.
"""


def pole_may_be_at(point: complex, A: RealArray, entries: RealArray | None = None) -> bool:
    """Whether changes of A by rounding, entry by entry, may give it a pole at a point.

    ``entries``: if A is a sum, the sum of the sizes of its terms, which are rounded. The units of
    the states do not matter.
    """
    try:
        near = np.abs(driven_states(A, np.eye(len(A)), np.array([point]))[0])
    except np.linalg.LinAlgError:
        return True
    moved = (near.T * (np.abs(A) if entries is None else entries)).sum()
    return not POLE_ROUNDINGS * EPS * moved < 1.0  # true for NaN


def stable_last(A: RealArray) -> tuple[RealArray, RealArray, int, int]:
    """An orthogonal Q and the block triangular Q^T A Q, in which the k poles that are not stable
    come first.

    A (n, n) has balanced states. Poles at 0 are set to exactly 0, and so are the real parts of
    simple poles elsewhere on the axis. The last result is the number of poles at 0.
    """
    small = axis_rounding(A)
    Q, T, k = integrators_first(A, small)
    T2, Q2 = schur(T[k:, k:])
    poles = _poles(T2)
    clear = _clear_of_axis(T2, np.array(poles), small)
    select = np.array(
        [not far and _not_stable(T2, pole, small) for pole, far in zip(poles, clear, strict=True)],
        dtype=np.int32,
    )
    count = int(select.sum())
    if 0 < count < len(T2):
        T2, Q2 = dtrsen(select, T2, Q2, job="N", lwork=len(T2))[:2]
    Q = Q @ block_diag(np.eye(k), Q2)
    T[:k, k:] = T[:k, k:] @ Q2
    T[k:, k:] = T2
    _put_on_axis(T[k : k + count, k : k + count], small)
    return Q, T, k + count, k


def _poles(T: RealArray) -> list[complex]:
    """Poles of a real Schur form, in their order."""
    n, found, i = len(T), [], 0
    while i < n:
        pair = i + 1 < n and T[i + 1, i] != 0.0
        spread = np.emath.sqrt(T[i, i + 1] * T[i + 1, i]) if pair else 0.0
        found += [complex(T[i, i] + spread), complex(T[i, i] - spread)][: 1 + pair]
        i += 1 + pair
    return found


def _clear_of_axis(T: RealArray, poles: ComplexArray, small: float) -> BoolArray:
    """Marks poles left of the axis that no change of T by rounding moves to the axis.

    By Bauer and Fike: a change moves eigenvalues by at most its size times the condition number of
    the eigenvectors. A pole without the mark may be clear of the axis too; this is decided by a
    singular value.
    """
    if not len(T):
        return np.zeros(0, bool)
    values, vectors = np.linalg.eig(T)
    moved = EIGENVECTOR_MARGIN * np.linalg.cond(vectors) * small
    away = np.abs(1j * poles.imag[:, None] - values).min(axis=1)
    clear: BoolArray = (poles.real < 0.0) & (away > moved)
    return clear


def _not_stable(T: RealArray, pole: complex, small: float) -> bool:
    """Whether a pole lies right of the axis, or a change of T by rounding puts one on it."""
    if pole.real >= 0.0:
        return True
    near = 1j * pole.imag * np.eye(len(T)) - T
    return bool(np.linalg.svd(near, compute_uv=False)[-1] <= small)


def _put_on_axis(T: RealArray, small: float) -> None:
    """Set the real parts of pairs of poles to 0 where they are only rounding."""
    for i in range(len(T) - 1):
        if T[i + 1, i] != 0.0 and abs(T[i, i]) <= small:
            T[i, i] = T[i + 1, i + 1] = 0.0
