"""Reduction of an LFT: the same value with fewer channels, that is, fewer repetitions of scalars.

If all channels but those of one scalar delta count as inputs and outputs, the matrix of an LFT is a
state-space realisation with delta in place of 1/s. Its uncontrollable and unobservable parts can be
removed without changing the value. This is done for one scalar after another until none has fewer
channels (Lambrechts, Terlouw, Bennani and Steinbuch, Parametric uncertainty modeling using LFTs,
ACC 1993).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from workbench._core.arrays import Array
from workbench.errors import InputError
from workbench.systems.balancing import balancing
from workbench.uncertainty.algebra.lft import INTEGRATOR, LFT

Triple = tuple[Array, Array, Array]
"""Matrices A, B and C of a realisation."""

RANK_TOLERANCES = (1e-8, 1e-10, 1e-12)
"""Singular values, relative to the norm of their matrix, that count as zero in the rank decisions.

They are tried in turn until the value stays the same. Rounding errors grow along the staircase, so
no single tolerance suits all models.
"""
VALUE_TOLERANCE = 1e-12
"""Largest change of the value, relative to the contribution of the scalar's channels."""
INTEGRATOR_FREQUENCY = 1e-12
"""A natural frequency below this, relative to the norm of the state matrix, counts as zero."""
SUM_ROUNDING = 1e-14
"""A sum smaller than this, relative to its terms, is a rounding error (a tenth of the limit
applied).
"""


def reduced(lft: LFT, keep: Collection[str] = ()) -> LFT:
    """An LFT with the same value and fewer repetitions of every scalar except those in `keep`.

    The value stays the same up to rounding. The channels of each scalar are adjacent, in the order
    of first appearance. No single scalar could have fewer channels with the others unchanged, but
    another realisation may have fewer in total, for example for p q - q p.
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


def without_channels(lft: LFT, names: Collection[str]) -> LFT:
    """The LFT with some of its scalars set to 0."""
    keep = [name not in names for name in lft.names]
    rows, columns = (np.append(keep, np.ones(size, dtype=bool)) for size in lft.shape)
    left = tuple(name for name, there in zip(lft.names, keep, strict=True) if there)
    return LFT(lft.M[np.ix_(rows.astype(bool), columns.astype(bool))], left)


def grouped(lft: LFT, order: Sequence[str]) -> LFT:
    """The same LFT with the channels of each scalar together, in the given order of scalars."""
    for name in order:
        lft = _last(lft, name)
    return lft


def _last(lft: LFT, name: str) -> LFT:
    """The same LFT with the channels of one scalar moved behind all others."""
    channels = sorted(range(len(lft.names)), key=lambda i: lft.names[i] == name)
    r = len(channels)
    rows, columns = ([*channels, *range(r, size)] for size in lft.M.shape)
    return LFT(lft.M[np.ix_(rows, columns)], tuple(lft.names[i] for i in channels))


def _minimal(lft: LFT, name: str) -> LFT:
    """The LFT with a minimal number of channels for one scalar, whose channels must be the last."""
    end = len(lft.names)
    start = end - lft.names.count(name)
    rows, columns = balancing(lft.M, end)
    M = rows[:, None] * lft.M * columns
    own = np.arange(start, end)
    rest_rows, rest_columns = (np.delete(np.arange(size), own) for size in M.shape)

    A, B = M[np.ix_(own, own)], M[np.ix_(own, rest_columns)]
    C, D = M[np.ix_(rest_rows, own)], M[np.ix_(rest_rows, rest_columns)]
    for tolerance in RANK_TOLERANCES:
        a, b, c = _controllable(A, B, C, tolerance)
        a, c, b = (matrix.T for matrix in _controllable(a.T, c.T, b.T, tolerance))
        if _is_same_value((A, B, C), (a, b, c), _radii(A) if name == INTEGRATOR else np.ones(1)):
            A, B, C = a, b, c
            break

    small = np.block(
        [
            [D[:start, :start], C[:start], D[:start, start:]],
            [B[:, :start], A, B[:, start:]],
            [D[start:, :start], C[start:], D[start:, start:]],
        ]
    )
    # The new channels remain scaled; the scaling of all others is undone.
    r = start + len(A)
    small[:start] /= rows[:start, None]
    small[r:] /= rows[end:, None]
    small[:, :start] /= columns[:start]
    small[:, r:] /= columns[end:]
    return LFT(small, lft.names[:start] + (name,) * len(A))


def _radii(A: Array) -> Array:
    """Radii |1/s| of the circles for `_is_same_value`: those of a state matrix's natural
    frequencies, and 1.

    Frequencies near zero belong to integrators and are left out.
    """
    frequencies = abs(np.linalg.eigvals(A))
    near_zero = INTEGRATOR_FREQUENCY * np.linalg.norm(A)
    return 1.0 / np.append(frequencies[frequencies > near_zero], 1.0)


def _is_same_value(one: Triple, other: Triple, radii: Array) -> bool:
    """Whether two realisations have the same value on the circles |delta| = radius."""
    angles = 2 * np.pi * (np.arange(16) + 0.5) / 16  # no point is real, since a pole may be real
    points = np.outer(radii, np.exp(1j * angles))[..., None, None]

    def value(A: Array, B: Array, C: Array) -> Array:
        return C @ np.linalg.solve(np.eye(len(A)) - points * A, points * B)

    def largest(array: Array) -> Array:
        return abs(array).max(axis=(-2, -1), initial=0.0)

    _, B, C = one
    expected = value(*one)
    terms = largest(abs(C) @ abs(B) * points)  # magnitude without cancellation between channels
    change = largest(value(*other) - expected)
    return bool((change <= VALUE_TOLERANCE * np.maximum(largest(expected), terms)).all())


def _controllable(A: Array, B: Array, C: Array, tolerance: float) -> Triple:
    """Controllable part of a realisation, by the staircase algorithm."""
    Q = _range(B, tolerance * float(np.linalg.norm(B)))
    latest = Q
    while latest.shape[1] and Q.shape[1] < len(A):
        latest = A @ latest
        for _ in range(2):  # the second pass removes rounding errors of the first
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
    """Orthonormal basis of the range of M, without singular values up to `least`."""
    if not np.isfinite(M).all():
        raise InputError("coefficients of the system overflow doubles; use other units")
    basis, values, _ = np.linalg.svd(M, full_matrices=False)
    return basis[:, values > least]


def _clean(M: Array, terms: Array | float) -> Array:
    """M with entries set to zero that are only rounding errors of sums of the size of `terms`.

    Later scaling could make such entries large.
    """
    return np.where(abs(M) > 10.0 * SUM_ROUNDING * terms, M, 0.0)
