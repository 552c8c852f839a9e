"""Fewer repetitions: an LFT of the same value with fewer channels.

In one scalar delta, all else being inputs and outputs, the matrix of an LFT is a state-space
realisation with delta for 1/s. What is uncontrollable or unobservable there goes without changing
the value at all; and one scalar after another, until none gets fewer (Lambrechts, Terlouw,
Bennani and Steinbuch, Parametric uncertainty modeling using LFTs, ACC 1993).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from workbench.arrays import Array
from workbench.systems.balancing import balancing
from workbench.uncertainty.parametric.lft import INTEGRATOR, LFT

Triple = tuple[Array, Array, Array]

TOLERANCES = (1e-8, 1e-10, 1e-12)
"""Singular values below the first of these that keeps the value are zero, relative to their matrix.

Rounding errors grow along the staircase, so that no one tolerance is right for all.
"""
EXACT = 1e-12
"""Largest change of the value, relative to what the scalar's channels contribute to it."""
ROUNDING = 1e-14
"""Sums this much smaller than their terms are zero."""


def reduced(lft: LFT, keep: Collection[str] = ()) -> LFT:
    """The LFT with the repetitions of every scalar reduced, but those in `keep`.

    The value stays the same to rounding. Channels of one scalar stand together, scalars in order of
    first appearance. Each scalar has the fewest channels that the other ones, as they stand,
    allow; all together may have fewer in another realisation, for instance of p q - q p.
    """
    order = list(dict.fromkeys(lft.names))
    while True:
        before = len(lft.names)
        for name in order:
            lft = _last(lft, name)
            if name not in keep:
                lft = _minimal(lft, name)
        if len(lft.names) == before:
            return lft


def grouped(lft: LFT, order: Sequence[str]) -> LFT:
    """The LFT with the channels of each scalar together, scalars in this order."""
    for name in order:
        lft = _last(lft, name)
    return lft


def _last(lft: LFT, name: str) -> LFT:
    """The channels of one scalar moved behind all others."""
    channels = sorted(range(len(lft.names)), key=lambda i: lft.names[i] == name)
    r = len(channels)
    rows, columns = ([*channels, *range(r, size)] for size in lft.M.shape)
    return LFT(lft.M[np.ix_(rows, columns)], tuple(lft.names[i] for i in channels))


def _minimal(lft: LFT, name: str) -> LFT:
    """The channels of one scalar, the last ones, replaced by a minimal realisation."""
    end = len(lft.names)
    start = end - lft.names.count(name)
    rows, columns = balancing(lft.M, end)
    M = rows[:, None] * lft.M * columns
    own = np.arange(start, end)
    rest_rows, rest_columns = (np.delete(np.arange(size), own) for size in M.shape)

    A, B = M[np.ix_(own, own)], M[np.ix_(own, rest_columns)]
    C, D = M[np.ix_(rest_rows, own)], M[np.ix_(rest_rows, rest_columns)]
    for tolerance in TOLERANCES:
        a, b, c = _controllable(A, B, C, tolerance)
        a, c, b = (matrix.T for matrix in _controllable(a.T, c.T, b.T, tolerance))
        if _same((A, B, C), (a, b, c), _radii(A) if name == INTEGRATOR else np.ones(1)):
            A, B, C = a, b, c
            break

    small = np.block(
        [
            [D[:start, :start], C[:start], D[:start, start:]],
            [B[:, :start], A, B[:, start:]],
            [D[start:, :start], C[start:], D[start:, start:]],
        ]
    )
    # These channels stay scaled; all else gets its units back.
    r = start + len(A)
    small[:start] /= rows[:start, None]
    small[r:] /= rows[end:, None]
    small[:, :start] /= columns[:start]
    small[:, r:] /= columns[end:]
    return LFT(small, lft.names[:start] + (name,) * len(A))


def _radii(A: Array) -> Array:
    """|1/s| at the natural frequencies of a state matrix; the least tell of integrators alone."""
    frequencies = abs(np.linalg.eigvals(A))
    return 1.0 / np.append(frequencies[frequencies > EXACT * np.linalg.norm(A)], 1.0)


def _same(one: Triple, other: Triple, radii: Array) -> bool:
    """Whether realisations agree on circles |delta| = radius."""
    angles = 2 * np.pi * (np.arange(16) + 0.5) / 16  # none is real, where a pole may be
    points = np.outer(radii, np.exp(1j * angles))[..., None, None]

    def value(A: Array, B: Array, C: Array) -> Array:
        return C @ np.linalg.solve(np.eye(len(A)) - points * A, points * B)

    def largest(array: Array) -> Array:
        return abs(array).max(axis=(-2, -1), initial=0.0)

    _, B, C = one
    expected = value(*one)
    terms = largest(abs(C) @ abs(B) * points)  # of channels that cancel, each counts
    change = largest(value(*other) - expected)
    return bool((change <= EXACT * np.maximum(largest(expected), terms)).all())


def _controllable(A: Array, B: Array, C: Array, tolerance: float) -> Triple:
    """The controllable part of a realisation."""
    Q = _range(B, tolerance * float(np.linalg.norm(B)))
    latest = Q
    while latest.shape[1] and Q.shape[1] < len(A):
        latest = A @ latest
        for _ in range(2):  # once leaves rounding errors behind
            latest = latest - Q @ (Q.T @ latest)
        latest = _range(latest, tolerance * float(np.linalg.norm(A)))
        Q = np.hstack([Q, latest])
    if Q.shape[1] == len(A):
        return A, B, C
    return (
        _clean(Q.T @ A @ Q, float(np.linalg.norm(A))),
        _clean(Q.T @ B, np.linalg.norm(B, axis=0)),
        _clean(C @ Q, np.linalg.norm(C, axis=1, keepdims=True)),
    )


def _range(M: Array, least: float) -> Array:
    """An orthonormal basis of the columns of M, but for singular values up to `least`."""
    basis, values, _ = np.linalg.svd(M, full_matrices=False)
    return basis[:, values > least]


def _clean(M: Array, terms: Array | float) -> Array:
    """M without entries that are rounding errors of sums of `terms`.

    Left in, they would pass for signals once scaling makes them large.
    """
    return np.where(abs(M) > 10.0 * ROUNDING * terms, M, 0.0)
