"""The linear matrix inequality of the mixed-mu upper bound as arrays for compiled code.

    S(t, D, G) = t D_r - M^H D_l M - j (G M - M^H G^H) = P^H K(t, D, G) P,   P = [M; I]

The multipliers are stored in *compact* form: a Hermitian matrix D of size N and a Hermitian matrix
G of the same size, which is nonzero in real blocks only. N is the number of full blocks plus the
number of channels of repeated scalars. Each unknown x_k is an entry of D or of G: on the diagonal,
or the real or imaginary part of a conjugate pair of entries off the diagonal.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workbench._core.arrays import ComplexArray
from workbench._core.compiled import compiled, unchecked_kernel
from workbench.structure import Full, Real, Structure

DIAGONAL, RE, IM = 0, 1, 2
"""Kinds of unknown: a diagonal entry, the real and the imaginary part of a pair of entries."""


class Pattern(NamedTuple):
    """Places of the unknowns in the compact multipliers and in the inequality.

    Unlike a `Structure`, it has the indices of unknowns, computed once for all matrices of a
    structure.

    ``left`` (c,) and ``right`` (r,) are the compact indices of the rows and columns of M. ``row``,
    ``column``, ``kind`` and ``skew`` (m,) describe the unknowns; ``skew`` marks those of G. The
    derivative of K by unknown k has the entries numbered ``first[k]`` to ``first[k + 1]``, at rows
    ``at`` and columns ``to``, with the values ``fixed + t * growing``. An imaginary part comes
    after its real part; its entries are ``1j * turn`` times those of the real part. ``size`` is N.
    """

    left: np.ndarray
    right: np.ndarray
    row: np.ndarray
    column: np.ndarray
    kind: np.ndarray
    skew: np.ndarray
    first: np.ndarray
    at: np.ndarray
    to: np.ndarray
    fixed: np.ndarray
    growing: np.ndarray
    turn: np.ndarray
    size: int


def pattern_of(structure: Structure) -> Pattern:
    """The pattern of a structure."""
    left, right, groups, size = [], [], [], 0
    for block in structure:
        if isinstance(block, Full):
            left += [size] * block.columns
            right += [size] * block.rows
            groups.append((size, 1, False))
            size += 1
        else:
            indices = list(range(size, size + block.rows))
            left += indices
            right += indices
            groups.append((size, block.rows, isinstance(block, Real)))
            size += block.rows

    unknowns = []
    for skew in (False, True):
        for start, n, real in groups:
            if skew and not real:
                continue
            for i in range(start, start + n):
                unknowns.append((i, i, DIAGONAL, skew))
                unknowns += [(i, j, kind, skew) for j in range(start, i) for kind in (RE, IM)]

    first = [0]
    entries: list[tuple[int, int, complex, complex]] = []
    for i, j, kind, skew in unknowns:
        for a, b, value in _entries(i, j, kind):
            rows_left = [k for k, index in enumerate(left) if index == a]
            columns_left = [k for k, index in enumerate(left) if index == b]
            rows_right = [len(left) + k for k, index in enumerate(right) if index == a]
            columns_right = [len(left) + k for k, index in enumerate(right) if index == b]
            if skew:
                entries.append((rows_right[0], columns_left[0], -1j * value, 0))
                entries.append((columns_left[0], rows_right[0], np.conj(-1j * value), 0))
            else:
                pairs = zip(rows_left, columns_left, strict=True)
                entries += [(p, q, -value, 0) for p, q in pairs]
                pairs = zip(rows_right, columns_right, strict=True)
                entries += [(p, q, 0, value) for p, q in pairs]
        first.append(len(entries))
    row, column, kinds, skews = (np.array(part) for part in zip(*unknowns, strict=True))
    at, to, fixed, growing = zip(*entries, strict=True)
    turn = np.ones(len(entries))
    for k, (_, _, kind, _) in enumerate(unknowns):
        for e in range(first[k], first[k + 1]) if kind == RE else ():
            one, other = (
                entries[place][2] + entries[place][3] for place in (e, e + first[k + 1] - first[k])
            )
            turn[e] = (other / (1j * one)).real
    return Pattern(
        np.array(left),
        np.array(right),
        row,
        column,
        kinds,
        skews,
        np.array(first),
        np.array(at),
        np.array(to),
        np.array(fixed, complex),
        np.array(growing, complex),
        turn,
        size,
    )


def diagonal_places(pattern: Pattern) -> np.ndarray | None:
    """Places of multipliers that are all diagonal; None if a scalar is repeated.

    The arrays, one after the other: blocks of the rows and of the columns of M; rows and columns of
    the real scalars.
    """
    if (pattern.kind != DIAGONAL).any():
        return None
    real = pattern.row[pattern.skew]
    row, column = ((side == real[:, None]).argmax(axis=1) for side in (pattern.left, pattern.right))
    return np.concatenate([pattern.left, pattern.right, row, column])


def expanded_multipliers(
    pattern: Pattern, D: ComplexArray, G: ComplexArray
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """D_left (..., c, c), D_right (..., r, r) and G (..., r, c) from compact D, G (..., N, N)."""
    left, right = pattern.left, pattern.right

    def square(places: np.ndarray) -> ComplexArray:
        """D expanded to the channels whose compact indices are given."""
        single = (places[:, None] != places) | np.eye(len(places), dtype=bool)
        return D[..., places[:, None], places] * single

    return square(left), square(right), G[..., right[:, None], left]


def compact_multipliers(
    pattern: Pattern, D_right: ComplexArray, G: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """Compact D and G (..., N, N) from D_right (..., r, r) and G (..., r, c) of the structure."""
    every = np.arange(pattern.size)
    right = (pattern.right == every[:, None]).argmax(axis=1)
    left = (pattern.left == every[:, None]).argmax(axis=1)
    return (
        np.ascontiguousarray(D_right[..., right[:, None], right]),
        np.ascontiguousarray(G[..., right[:, None], left]),
    )


def _entries(i: int, j: int, kind: int) -> list[tuple[int, int, complex]]:
    """Nonzero entries (row, column, value) of an unknown's basis matrix."""
    if kind == DIAGONAL:
        return [(i, i, 1.0)]
    value = 1.0 if kind == RE else 1j
    return [(i, j, value), (j, i, np.conj(value))]


@compiled
def fill(pattern: Pattern, x: np.ndarray, D: np.ndarray, G: np.ndarray) -> None:
    """Set the compact D and G from the unknowns x."""
    D[:] = 0.0
    G[:] = 0.0
    for k in range(x.size):
        target = G if pattern.skew[k] else D
        i, j = pattern.row[k], pattern.column[k]
        if pattern.kind[k] == DIAGONAL:
            target[i, i] = x[k]
        elif pattern.kind[k] == RE:
            target[i, j] += x[k]
            target[j, i] += x[k]
        else:
            target[i, j] += 1j * x[k]
            target[j, i] -= 1j * x[k]


def basis(pattern: Pattern) -> list[tuple[ComplexArray, ComplexArray]]:
    """Compact D and G of each unknown, with this unknown at 1 and the others at 0."""
    pairs = []
    for unknown in np.eye(pattern.row.size):
        D, G = np.zeros((2, pattern.size, pattern.size), complex)
        fill(pattern, unknown, D, G)
        pairs.append((D, G))
    return pairs


@unchecked_kernel
def basis_products(pattern: Pattern, D: np.ndarray, G: np.ndarray, x: np.ndarray) -> None:
    """Set x to the inner products of every unknown's basis matrix with the Hermitian D or G."""
    for k in range(x.size):
        entry = (G if pattern.skew[k] else D)[pattern.row[k], pattern.column[k]]
        if pattern.kind[k] == DIAGONAL:
            x[k] = entry.real
        elif pattern.kind[k] == RE:
            x[k] = 2.0 * entry.real
        else:
            x[k] = 2.0 * entry.imag


@unchecked_kernel
def expand(places: np.ndarray, D: np.ndarray, X: np.ndarray) -> None:
    """Set X to D_l or D_r from the compact D; a full block has one multiplier on its diagonal."""
    for i in range(places.size):
        for j in range(places.size):
            same = places[i] == places[j] and i != j
            X[i, j] = 0.0 if same else D[places[i], places[j]]


@unchecked_kernel
def collect(places: np.ndarray, X: np.ndarray, sign: float, D: np.ndarray) -> None:
    """Add ``sign`` times the adjoint of `expand` at X to the compact D."""
    for i in range(places.size):
        for j in range(places.size):
            if places[i] != places[j] or i == j:
                D[places[i], places[j]] += sign * X[i, j]


@unchecked_kernel
def half_slack(
    left: np.ndarray, right: np.ndarray, M: np.ndarray, D: np.ndarray, G: np.ndarray, Y: np.ndarray
) -> None:
    """Set Y (c, r) to -D_l M / 2 + j G, so that S = t D_r + M^H Y + Y^H M."""
    c, r = M.shape
    for i in range(c):
        for j in range(r):
            Y[i, j] = 0.0
        for k in range(c):
            same = left[i] == left[k] and i != k
            entry = -0.5 * D[left[i], left[k]]
            if not same and entry != 0.0:
                for j in range(r):
                    Y[i, j] += entry * M[k, j]
        for j in range(r):
            entry = G[left[i], right[j]]  # zero except in square blocks
            if entry != 0.0:
                Y[i, j] += 1j * entry


@unchecked_kernel
def slack(
    left: np.ndarray,
    right: np.ndarray,
    M: np.ndarray,
    t: float,
    D: np.ndarray,
    G: np.ndarray,
    Y: np.ndarray,
    B: np.ndarray,
    S: np.ndarray,
) -> None:
    """Set S = t D_r - M^H D_l M - j (G M - M^H G^H) and B = D_r; ``Y`` (c, r) is work space."""
    c, r = M.shape
    half_slack(left, right, M, D, G, Y)
    expand(right, D, B)
    for i in range(r):
        for j in range(i + 1):
            total = t * B[i, j]
            for k in range(c):
                total += np.conj(M[k, i]) * Y[k, j] + np.conj(Y[k, i]) * M[k, j]
            S[i, j] = total
            S[j, i] = np.conj(total)


@unchecked_kernel
def adjoint(
    pattern: Pattern,
    M: np.ndarray,
    t: float,
    X: np.ndarray,
    MX: np.ndarray,
    MXM: np.ndarray,
    D: np.ndarray,
    G: np.ndarray,
) -> None:
    """Set D and G to the compact adjoint of `slack` at a Hermitian X, given M X and M X M^H.

    The real inner product of this adjoint with multipliers equals that of their S with X.
    """
    D[:] = 0.0
    G[:] = 0.0
    collect(pattern.right, X, t, D)
    collect(pattern.left, MXM, -1.0, D)
    c, r = M.shape
    size = pattern.size
    for i in range(size):
        for j in range(i + 1):
            mean = 0.5 * (D[i, j] + np.conj(D[j, i]))
            D[i, j] = mean
            D[j, i] = np.conj(mean)
    # <-j (G M - M^H G^H), X> for Hermitian X = <G, -j M X + (-j M X)^H>; only real blocks are read.
    for i in range(c):
        for j in range(r):
            entry = -1j * MX[i, j]
            a, b = pattern.left[i], pattern.right[j]
            G[a, b] += entry
            G[b, a] += np.conj(entry)
