"""Lower bounds on the size of sets, proven by the matrices that touch them.

Let M_k = P (E_k - Z) S have the singular values s_kj with vectors u_kj, v_kj, and let c_kj >= 0.

*Volume, centre given.* For Hermitian A and B the functions log|M|, log|wedge^2 M|, ... of
exp(A) M exp(B) are convex along geodesics. With c_k1 >= c_k2 >= ... every cover exp(A) P, S exp(B)
has therefore

    0 >= sum c_kj log s_kj + tr(A sum c_kj u_kj u_kj^*) + tr(B sum c_kj v_kj v_kj^*).

If the two sums are m I and p I (John's condition for ellipsoids, here for both sides), this bounds
m tr A + p tr B, by which the logarithm of the volume could decrease. Where the two sums differ from
m I and p I, the difference counts with the largest A and B that a smaller cover can have.

*Trace.* With L = W_1 W_1^* and R = W_2^* W_2 the matrix [[L, E_k - Z], [., R]] of a cover is
positive semidefinite, so its product with c_kj (P^* u, -S v)(P^* u, -S v)^* is not negative. If in
the sum of these products the terms in L and R are tr L / p + tr R / m, and the term in Z vanishes,
the other terms are a lower bound. This is the duality of semidefinite programs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench.uncertainty.matrix_covers.sets.shapes import WeightShape, ctranspose, of_shape

SMALLEST = 1e-300
"""Replacement for zero in a logarithm and in a divisor. Its reciprocal times a number of entries is
a double, unlike that of the least double. Half or double changes nothing.
"""


@dataclass(frozen=True)
class InUnits:
    """The data of a proof, in units of the sets.

    P (F, p, p) and S (F, m, m) are inverse weights, ``away`` (F, N, p, m) are the contained
    matrices less the centre, and M (F, N, p, m) = P away S. ``channels`` are the sizes of rows (F,
    p) and columns (F, m), ``loop`` (F, m + q, p + r) is the loop, and K is the loop between the
    weights.
    """

    P: Array
    S: Array
    away: Array
    M: Array
    channels: tuple[RealArray, RealArray]
    loop: Array | None
    K: Array | None


def volume_excess(
    M: Array,
    weights: RealArray,
    left: WeightShape,
    right: WeightShape,
    reach: tuple[RealArray, RealArray],
) -> RealArray:
    """Bound on how much the logarithm of the radius (F,) could be lowered from that of these sets.

    Parameters
    ----------
    M
        Deviations (F, N, p, m) in the units of the sets.
    weights
        c (F, N, min(p, m)).
    reach
        Bounds (F,) on the norms of A and B for any smaller cover.
    """
    p, m = M.shape[-2:]
    u, s, vh = np.linalg.svd(M, full_matrices=False)
    c = np.minimum.accumulate(np.maximum(weights, 0.0), axis=-1)
    c = c * (p * m / np.maximum(c.sum(axis=(1, 2), keepdims=True), SMALLEST))
    off_left = of_shape(sum_of_dyads(u, c) - m * np.eye(p), left)
    off_right = of_shape(sum_of_dyads(ctranspose(vh), c) - p * np.eye(m), right)
    room = -(c * np.log(np.maximum(s, SMALLEST))).sum(axis=(1, 2))
    room = room + nuclear(off_left) * reach[0] + nuclear(off_right) * reach[1]
    excess: RealArray = np.maximum(room, 0.0) / (p * m)
    return excess


def farthest(
    P: Array,
    S: Array,
    channels: tuple[RealArray, RealArray],
    floor: float,
    least: RealArray | None = None,
) -> tuple[RealArray, RealArray]:
    """Bounds (F,) on the norms of A and B for all exp(A) P, S exp(B) of sets with a smaller volume.

    Parameters
    ----------
    channels, floor
        Every cover contains changes of single entries by floor times the sizes of row (F, p) and
        column (F, m).
    least
        Least m log|det P| + p log|det S| (F,) of those inverse weights; None for that of P and S.

    In units of the channels the floor means |P e_i| |e_j^T S| <= 1 / floor. Scale S so that its
    largest row is 1. Then the norms are bounded. With the volume and Hadamard's inequality, the
    norms of the inverses are bounded too.
    """
    rows, columns = channels
    p, m = rows.shape[1], columns.shape[1]
    P, S = P * rows[:, None], columns[:, :, None] * S
    row = np.linalg.norm(S, axis=2).max(axis=1)[:, None, None]
    P, S = P * row, S / row
    units = m * np.log(rows).sum(axis=1) + p * np.log(columns).sum(axis=1)
    if least is None:
        volume = m * np.linalg.slogdet(P)[1] + p * np.linalg.slogdet(S)[1]
    else:
        volume = least + units
    high = np.log(np.sqrt(p) / floor), np.log(np.sqrt(m))
    low = (
        volume / m - (p - 1) * high[0],
        volume / p + m * np.log(floor) - (m - 1) * high[1],
    )
    found = []
    for W, top, bottom in zip((P, S), high, low, strict=True):
        s = np.log(np.linalg.svd(W, compute_uv=False))
        found.append(np.maximum(np.abs(top - s[:, -1]), np.abs(s[:, 0] - bottom)))
    return found[0], found[1]


def trace_bound(
    away: Array,
    moving: int,
    P: Array,
    S: Array,
    weights: RealArray,
    left: WeightShape,
    right: WeightShape,
    free: bool,
) -> RealArray:
    """Lower bound (F,) on sqrt((tr L / p) (tr R / m)) of every cover.

    Parameters
    ----------
    away
        Matrices that a cover contains (F, N, p, m), less its centre.
    moving
        Number of the N matrices from which the centre is subtracted.
    P, S
        Inverse weights of the cover.
    weights
        c (F, N, min(p, m)).
    free
        Whether the centre is free.
    """
    p, m = away.shape[-2:]
    u, _, vh = np.linalg.svd(P[:, None] @ away @ S[:, None], full_matrices=False)
    c = np.maximum(weights, 0.0)
    x = ctranspose(P)[:, None] @ u
    y = S[:, None] @ ctranspose(vh)
    x = _normalised(x, c, left) / np.sqrt(p)
    y = _normalised(y, c, right) / np.sqrt(m)
    over_left = _largest(of_shape(sum_of_dyads(x, c), left)) * p
    over_right = _largest(of_shape(sum_of_dyads(y, c), right)) * m
    cross = (x * c[:, :, None]) @ ctranspose(y)  # (F, N, p, m)
    value = np.einsum("fkij,fkij->f", cross.conj(), away).real
    if free:  # |Z' - Z| <= 2 * (largest radius of a cover that is not larger)
        rest = np.linalg.svd(cross[:, :moving].sum(axis=1), compute_uv=False).sum(axis=-1)
        known = np.linalg.norm(np.linalg.inv(P), axis=(1, 2))
        known = known * np.linalg.norm(np.linalg.inv(S), axis=(1, 2))
        value = value - 2 * rest * known
    bound: RealArray = value / np.maximum(over_left, over_right)
    return np.maximum(bound, 0.0)


def _normalised(vectors: Array, c: RealArray, shape: WeightShape) -> Array:
    """Vectors (F, N, n, r) multiplied by a matrix of the shape so that the shape's part of sum c x
    x^* is I.
    """
    if shape == "scalar":
        mean = np.einsum("fii->f", sum_of_dyads(vectors, c)).real / vectors.shape[-2]
        return vectors / np.sqrt(np.maximum(mean, SMALLEST))[:, None, None, None]
    diagonal = np.maximum(np.einsum("fii->fi", sum_of_dyads(vectors, c)).real, SMALLEST)
    vectors = vectors / np.sqrt(diagonal)[:, None, :, None]
    if shape == "diagonal":
        return vectors
    values, turn = np.linalg.eigh(sum_of_dyads(vectors, c))
    root = (turn / np.sqrt(np.maximum(values, SMALLEST))[:, None]) @ ctranspose(turn)
    changed: Array = root[:, None] @ vectors
    return changed


def sum_of_dyads(vectors: Array, c: RealArray) -> Array:
    """The sum of c x x^* (F, n, n) over the columns x of vectors (F, N, n, r)."""
    found: Array = ((vectors * c[:, :, None]) @ ctranspose(vectors)).sum(axis=1)
    return found


def nuclear(hermitian: Array) -> RealArray:
    """Sum of the magnitudes of the eigenvalues (F,)."""
    found: RealArray = np.abs(np.linalg.eigvalsh(hermitian)).sum(axis=-1)
    return found


def _largest(hermitian: Array) -> RealArray:
    found: RealArray = np.linalg.eigvalsh(hermitian)[:, -1]
    return found
