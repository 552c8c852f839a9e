"""Poles on the stability boundary, split off from the stable ones of a realisation.

Rounding moves a repeated pole at 0 by the root of the rounding error, to either side of the axis.
Poles at 0 are therefore decided by ranks, and poles elsewhere on the axis by the distance of the
matrix from one with a pole there: both answers hold for all matrices that differ from the given one
by rounding.

Rounding is as large as the whole matrix makes it, since the states may have been mixed. A pole may
be slower than that beside others that are 1e12 times faster. It is still no integrator if the
entries show it: no change of each entry by rounding moves it to 0, in any units of the states.
"""

from __future__ import annotations

from collections.abc import Sequence
from graphlib import TopologicalSorter

import numpy as np
from scipy.linalg import block_diag, schur
from scipy.linalg.lapack import dtrsen
from scipy.sparse.csgraph import connected_components

from workbench._core.arrays import EPS, BoolArray, ComplexArray, IntegerArray, RealArray
from workbench.systems.balancing import (
    AXIS_ROUNDING,
    axis_rounding,
    null_states_first,
    poles_at_zero,
)
from workbench.systems.frequency_response import driven_states

EIGENVECTOR_MARGIN = 10.0
"""Factor that allows for rounding of eigenvalues, eigenvectors and their condition number."""
POLE_ROUNDINGS = 4
"""Multiple of the relative rounding error in every entry of a realisation that may have moved its
poles, or its response to zero. An entry that took a few operations errs by two or three roundings.
With half of it poles at 0 that such entries move count as slow poles; with twice as much, a slow
pole that the entries tell counts as one at 0.
"""


def pole_may_be_at(
    point: complex,
    A: RealArray,
    entries: RealArray | None = None,
    *,
    roundings: float = POLE_ROUNDINGS,
) -> bool:
    """Whether changes of A by rounding, entry by entry, may give it a pole at a point.

    ``entries``: if A is a sum, the sum of the sizes of its terms, which are rounded. The units of
    the states do not matter.
    """
    try:
        near = np.abs(driven_states(A, np.eye(len(A)), np.array([point]))[0])
    except np.linalg.LinAlgError:
        return True
    moved = (near.T * (np.abs(A) if entries is None else entries)).sum()
    return not roundings * EPS * moved < 1.0  # true for NaN


def _shown_beside(point: complex, A: RealArray, rounding: float) -> bool:
    """Whether the entries of A show that its pole nearest to a point on the boundary is not there.

    A distance up to the rounding of the whole matrix shows nothing: a Schur form made of rounded
    numbers has such entries.
    """
    away = np.abs(np.linalg.eigvals(A) - point).min()
    return away > rounding and not pole_may_be_at(point, A, roundings=AXIS_ROUNDING * len(A))


def shown_apart(A: RealArray, poles: ComplexArray, points: ComplexArray) -> BoolArray:
    """Marks those poles of A (n, n), with balanced states, of which its entries show that they are
    not at points on the boundary of stability, one point for each pole.
    """
    if not len(poles):
        return np.zeros(0, bool)
    blocks = [A[np.ix_(part, part)] for part in irreducible_parts(A)]
    modes = [np.linalg.eigvals(block) for block in blocks]
    marks = []
    for pole, point in zip(poles, points, strict=True):
        own = int(np.argmin([np.abs(mode - pole).min() for mode in modes]))
        marks.append(_shown_beside(point, blocks[own], axis_rounding(A) / AXIS_ROUNDING))
    return np.array(marks)


def stable_last(A: RealArray) -> tuple[RealArray, RealArray, int, int]:
    """An orthogonal Q and the block triangular Q^T A Q, in which the k poles that are not stable
    come first.

    A (n, n) has balanced states. Poles at 0 are set to exactly 0, and so are the real parts of
    simple poles elsewhere on the axis. The last result is the number of poles at 0.
    """
    small = axis_rounding(A)
    Q, T, k = integrators_first(A, small)
    T2, Q2 = schur(T[k:, k:])
    poles = np.array(_poles(T2), complex)
    on_axis = _on_axis(A, T2, poles, small)
    select = on_axis | (poles.real >= 0.0)
    count = int(select.sum())
    if 0 < count < len(T2):
        T2, Q2 = dtrsen(select.astype(np.int32), T2, Q2, job="N", lwork=len(T2))[:2]
    Q = Q @ block_diag(np.eye(k), Q2)
    T[:k, k:] = T[:k, k:] @ Q2
    T[k:, k:] = T2
    _put_on_axis(T[k : k + count, k : k + count], on_axis[select], small)
    return Q, T, k + count, k


def integrators_first(
    A: RealArray, small: float, points: Sequence[float] = (0.0,)
) -> tuple[RealArray, RealArray, int]:
    """An orthogonal Q, Q^T A Q and the number k of poles at the points, which come first, exactly.

    A (n, n) has balanced states, and changes of it up to `small` count as rounding. The first k
    columns of Q^T A Q have no entries below the diagonal.
    """
    Q, T, found = _by_ranks(A, small, points)
    parts = _deciding_parts(A, small, points) if found else []
    if all(own == list(points) for _, own in parts):
        return Q, T, len(found)
    turns, found, first = [], list[float](), list[int]()
    for part, own in parts:
        turn, T, places = _by_ranks(A[np.ix_(part, part)], small, own)
        k, n = len(places), len(part)
        turns.append(turn @ block_diag(np.eye(k), schur(T[k:, k:])[1]))
        found += places
        first += k * [1] + (n - k) * [0]
    if not found:
        return np.eye(len(A)), A.copy(), 0
    Q = np.eye(len(A))[:, np.concatenate([part for part, _ in parts])] @ block_diag(*turns)
    T, Q = dtrsen(np.array(first, np.int32), Q.T @ A @ Q, Q, job="N", lwork=len(A))[:2]
    k = len(found)
    T[:, :k] = np.triu(T[:, :k], 1)
    T[range(k), range(k)] = found
    return Q, T, k


def integrators_by_size(A: RealArray) -> int:
    """Number of poles of A (n, n) that are 0 by their sizes, in a unit of time in which the others
    are not small.
    """
    parts = _deciding_parts(A, axis_rounding(A), (0.0,)) if len(A) else []
    return sum(
        poles_at_zero(np.linalg.eigvals(A[np.ix_(part, part)])) for part, own in parts if own
    )


def _deciding_parts(
    A: RealArray, small: float, points: Sequence[float]
) -> list[tuple[IntegerArray, list[float]]]:
    """Sets of states that decide separately which of their poles are at the points, with those
    points where they may have poles.

    There is one set if no entries show that a pole nearer to a point than `small` is not there.
    """
    decided = []
    for part in irreducible_parts(A):
        block = A[np.ix_(part, part)]
        away = np.abs(np.linalg.eigvals(block)[:, None] - np.array(points)).min(axis=0)
        beside = [
            point
            for point, least in zip(points, away, strict=True)
            if least <= small and _shown_beside(point, block, small / AXIS_ROUNDING)
        ]
        decided.append((part, [point for point in points if point not in beside]))
    shown = any(len(own) < len(points) for _, own in decided)
    return decided if shown else [(np.arange(len(A)), list(points))]


def irreducible_parts(A: RealArray) -> list[IntegerArray]:
    """Sets of states that influence each other in a circle; in this order A is block triangular."""
    count, member = connected_components(A != 0.0, connection="strong")
    before: dict[int, set[int]] = {k: set() for k in range(count)}
    for i, j in np.unique(member[np.argwhere(A)], axis=0):
        before[j] |= {i} - {j}
    return [np.flatnonzero(member == k) for k in TopologicalSorter(before).static_order()]


def _by_ranks(
    A: RealArray, small: float, points: Sequence[float]
) -> tuple[RealArray, RealArray, list[float]]:
    """Q, Q^T A Q and its first diagonal entries: poles at the points, found from ranks of A -
    point.
    """
    Q, T, places = np.eye(len(A)), A.copy(), list[float]()
    for point in points:
        k = len(places)
        shift = point * np.eye(len(A) - k)
        turn, moved, count = null_states_first(T[k:, k:] - shift, small)
        T[:k, k:], T[k:, k:] = T[:k, k:] @ turn, moved + shift
        Q[:, k:] = Q[:, k:] @ turn
        places += count * [point]
    return Q, T, places


def _on_axis(A: RealArray, T: RealArray, poles: ComplexArray, small: float) -> BoolArray:
    """Marks the poles of T, the rest of a Schur form of A, that are on the axis up to rounding."""
    clear = _clear_of_axis(T, poles, small)
    near = np.array(
        [not far and _near_axis(T, pole, small) for pole, far in zip(poles, clear, strict=True)],
        dtype=bool,
    )
    near[near] = ~shown_apart(A, poles[near], 1j * poles[near].imag)
    return near


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


def _near_axis(T: RealArray, pole: complex, small: float) -> bool:
    """Whether a change of T by rounding puts a pole on the axis at the height of the given one."""
    near = 1j * pole.imag * np.eye(len(T)) - T
    return bool(np.linalg.svd(near, compute_uv=False)[-1] <= small)


def _put_on_axis(T: RealArray, on_axis: BoolArray, small: float) -> None:
    """Set the real parts of pairs of poles that are on the axis to 0."""
    for i in range(len(T) - 1):
        if on_axis[i] and T[i + 1, i] != 0.0 and abs(T[i, i]) <= small:
            T[i, i] = T[i + 1, i + 1] = 0.0
