"""The structured singular value of a loop with sets, at each frequency.

A loop N = [[N_11, N_12], [N_21, N_22]] leads from (u, w) to (y, z). It is closed with u = X y, and
w and z are its performance channels. With X = W_1 Delta W_2, its mu for Delta and the performance
block is

    min over delta of |K|,    K = diag(W_2, e^-delta) N diag(W_1, e^delta).

This is exact, since for two complex blocks this scaling suffices. By the three lines theorem, log
|K| is convex when the inverse weights move to exp(A) W_1^-1 and W_2^-1 exp(B) and delta moves along
a line. So sets with the least mu are also a global optimum.

*Proof of the optimum.* Every cover, written as exp(A) W_1^-1, W_2^-1 exp(B), delta + e, has

    log |K'| >= sum e_j log s_j(K) + sum e_j (u_j^* L u_j + v_j^* R v_j),
    L = diag(-B, -e),  R = diag(-A, e),

for weights e_1 >= e_2 >= ... of sum 1. Together with the inequalities of
`workbench.uncertainty.matrix_covers.sets.optimality` for the volume and for containment, the parts
in A, B and e nearly cancel. What remains is bounded by the largest A, B and e of any cover that is
not worse.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench.errors import InputError
from workbench.input_checks import as_array
from workbench.uncertainty.matrix_covers.sets.log_det import log_det_derivatives
from workbench.uncertainty.matrix_covers.sets.optimality import (
    SMALLEST,
    InUnits,
    farthest,
    nuclear,
    sum_of_dyads,
)
from workbench.uncertainty.matrix_covers.sets.shapes import WeightShape, ctranspose, of_shape

VOLUME_SHARE = 1e-3
"""Weight of the log radius beside log mu. The least mu alone does not determine the parts of a set
that the loop does not see. With half of it parts that the loop does not see are settled less well;
with double of it mu may be larger, by up to 0.2 % for each unit of the log radius.
"""
GOLDEN_STEPS = 60
"""Number of steps of the golden-section search for delta; each leaves 0.62 of the interval. 60
leave 3e-13 of it, which is what an interval of logarithms holds in doubles. With half of them delta
has six digits; more change nothing.
"""


def need_loop(given: Any, deviations: tuple[int, ...]) -> Array:
    """Responses of a loop (F, m + q, p + r) that fit deviations (F, N, p, m); raises InputError
    otherwise.
    """
    F, _, p, m = deviations
    loop = as_array(given, "loop", dtype=complex)
    enough = loop.ndim == 3 and len(loop) == F and loop.shape[1] >= m and loop.shape[2] >= p
    if not enough or (loop.shape[1] == m) != (loop.shape[2] == p):
        raise InputError(
            f"loop must have shape (F, m + q, p + r) = ({F}, {m} + q, {p} + r), with q and r both "
            f"0 or neither, not {loop.shape}"
        )
    bad = np.argwhere(~np.isfinite(loop))
    if bad.size:
        raise InputError(f"loop is not finite at index {tuple(bad[0].tolist())}")
    if loop.shape[1:] == (m, p):
        blind = (loop == 0).all(axis=(1, 2))
    else:
        blind = (loop[:, :m, p:] == 0).all(axis=(1, 2)) | (loop[:, m:, :p] == 0).all(axis=(1, 2))
    if blind.any():
        raise InputError(
            f"the loop has no path from w through X to z at frequency number "
            f"{int(blind.argmax())}, so its mu is the same for all sets"
        )
    return loop


def loop_in_unit(loop: Array, unit: Array, p: int) -> Array:
    """Loops that are closed by X / unit like the given loops by X; unit (F, 1, 1)."""
    found = np.array(loop)
    found[:, :, :p] *= unit
    return found


class LoopBarrier:
    """The term -log det(I - K K^*) of loops scaled by e^-gamma; gamma and delta are unknowns too.

    The directions are those of the weights, A (a, p, p) and B (b, m, m), then gamma and, if the
    loop has performance, delta.
    """

    def __init__(self, loop: Array, A: Array, B: Array) -> None:
        self.loop = loop
        p, m = A.shape[-1], B.shape[-1]
        self.performing = loop.shape[1:] != (m, p)
        self.count = 1 + self.performing
        self.left, self.right = loop_directions(loop.shape[1:], A, B)

    def at(
        self, at: np.ndarray | slice, P: Array, S: Array, gamma: RealArray, delta: RealArray
    ) -> Array:
        """The scaled loops at the frequencies with the indices ``at``."""
        return np.exp(-gamma)[:, None, None] * scaled_loop(self.loop[at], P, S, delta)

    def derivatives(self, K: Array) -> tuple[RealArray, RealArray]:
        """Slope (f, d) and curvature (f, d, d) along the directions."""
        n, none = len(self.left), np.zeros((0, *K.shape[1:]))
        slope, curvature = log_det_derivatives(K[:, None], self.left, self.right, none, 0)
        both = curvature.reshape(len(K), 2, n, 2, n).sum(axis=(1, 3))
        return slope[:, :n] + slope[:, n:], both


def loop_directions(shape: tuple[int, ...], A: Array, B: Array) -> tuple[Array, Array]:
    """L (d, m + q, m + q) and R (d, p + r, p + r) with which K moves to exp(L) K exp(R)."""
    a, b, p, m = len(A), len(B), A.shape[-1], B.shape[-1]
    performing = shape != (m, p)
    count = a + b + 1 + performing
    left = np.zeros((count, shape[0], shape[0]), complex)
    right = np.zeros((count, shape[1], shape[1]), complex)
    right[:a, :p, :p] = -A
    left[a : a + b, :m, :m] = -B
    left[a + b] = -np.eye(shape[0])
    if performing:
        left[-1, m:, m:] = -np.eye(shape[0] - m)
        right[-1, p:, p:] = np.eye(shape[1] - p)
    return left, right


def scaled_loop(loop: Array, P: Array, S: Array, delta: RealArray) -> Array:
    """K (F, m + q, p + r) from loops N, inverse weights P (F, p, p) and S (F, m, m), and scalings
    delta.
    """
    p, m = P.shape[-1], S.shape[-1]
    K = np.array(loop, complex)
    K[:, :m] = np.linalg.solve(S, K[:, :m])
    K[:, :, :p] = K[:, :, :p] @ np.linalg.inv(P)
    return _delta_scaled(K, p, m, delta)


def loop_level(loop: Array, P: Array, S: Array) -> tuple[RealArray, RealArray]:
    """log mu (F,) of the loops with sets that have these inverse weights, and the scalings delta
    (F,).
    """
    p, m = P.shape[-1], S.shape[-1]
    K = scaled_loop(loop, P, S, np.zeros(len(P)))
    if K.shape[1:] == (m, p):
        return log_norm(K), np.zeros(len(P))
    across = [log_norm(K[:, :m, p:]), log_norm(K[:, m:, :p])]
    inner = np.maximum(log_norm(K[:, :m, :p]), log_norm(K[:, m:, p:]))
    middle = (across[1] - across[0]) / 2
    # no block is larger than the norm, and at the middle the norm is at most twice the largest
    # block
    room = np.log(2.0) + np.maximum(inner - sum(across) / 2, 0.0)
    low, high = middle - room, middle + room
    golden = (np.sqrt(5) - 1) / 2

    def value(delta: RealArray) -> RealArray:
        return log_norm(_delta_scaled(K, p, m, delta))

    inside = [high - golden * (high - low), low + golden * (high - low)]
    values = [value(each) for each in inside]
    for _ in range(GOLDEN_STEPS):
        left = values[0] < values[1]
        low, high = np.where(left, low, inside[0]), np.where(left, inside[1], high)
        new = np.where(left, high - golden * (high - low), low + golden * (high - low))
        found = value(new)
        inside = [np.where(left, new, inside[1]), np.where(left, inside[0], new)]
        values = [np.where(left, found, values[1]), np.where(left, values[0], found)]
    delta = np.where(values[0] < values[1], inside[0], inside[1])
    return value(delta), delta


def _delta_scaled(K: Array, p: int, m: int, delta: RealArray) -> Array:
    """K (F, m + q, p + r) with its off-diagonal blocks scaled by e^delta and e^-delta."""
    K = K.copy()
    K[:, :m, p:] *= np.exp(delta)[:, None, None]
    K[:, m:, :p] *= np.exp(-delta)[:, None, None]
    return K


def log_norm(matrices: Array) -> RealArray:
    """Logarithm (F,) of the largest singular value; the logarithm of SMALLEST for empty
    matrices.
    """
    if not matrices[0].size:
        return np.full(len(matrices), np.log(SMALLEST))
    return np.log(np.maximum(np.linalg.norm(matrices, 2, axis=(1, 2)), SMALLEST))


def mu_excess(
    within: InUnits,
    weights: RealArray,
    proof: RealArray,
    shapes: tuple[WeightShape, WeightShape],
    floor: float,
) -> RealArray:
    """Bound on how much log mu + VOLUME_SHARE log radius (F,) could be lowered from that of these
    sets.

    Parameters
    ----------
    within
        Sets that are smaller than those of the answer by a factor.
    weights
        Weights c (F, N, min(p, m)) of the proof.
    proof
        Logarithm of the factor, delta, and the weights e of the loop (F, 2 + rank).
    floor
        As in `workbench.uncertainty.matrix_covers.sets.optimality.farthest`.
    """
    P, S, M, K, loop = within.P, within.S, within.M, within.K, within.loop
    assert K is not None and loop is not None
    p, m = M.shape[-2:]
    factor, delta, e = proof[:, 0], proof[:, 1], np.maximum(proof[:, 2:], 0.0)
    whole = P * np.exp(-factor)[:, None, None]
    size = loop_level(loop, whole, S)[0] + VOLUME_SHARE * _log_radius(whole, S)
    e = np.minimum.accumulate(e, axis=-1)
    total = np.maximum(e.sum(axis=1), SMALLEST)
    e = e / total[:, None]
    c = np.minimum.accumulate(np.maximum(weights, 0.0), axis=-1) / total[:, None, None]

    U, s, Vh = np.linalg.svd(K, full_matrices=False)
    u, t, vh = np.linalg.svd(M, full_matrices=False)
    left = sum_of_dyads(U[:, None], e[:, None])
    right = sum_of_dyads(ctranspose(Vh)[:, None], e[:, None])
    off_left = sum_of_dyads(u, c) - right[:, :p, :p] - np.eye(p) * (VOLUME_SHARE / p)
    off_right = sum_of_dyads(ctranspose(vh), c) - left[:, :m, :m]
    off_right = off_right - np.eye(m) * (VOLUME_SHARE / m)
    off_delta = np.einsum("fii->f", right[:, p:, p:]) - np.einsum("fii->f", left[:, m:, m:])

    bound = (e * np.log(np.maximum(s, SMALLEST))).sum(axis=1) + VOLUME_SHARE * _log_radius(P, S)
    bound = bound + (c * np.log(np.maximum(t, SMALLEST))).sum(axis=(1, 2))
    reach = _reach(loop, P, S, delta, within.channels, floor, size)
    bound = bound - nuclear(of_shape(off_left, shapes[0])) * reach[0]
    bound = bound - nuclear(of_shape(off_right, shapes[1])) * reach[1]
    bound = bound - np.abs(off_delta) * reach[2]
    return np.maximum(size - bound, 0.0)


def _reach(
    loop: Array,
    P: Array,
    S: Array,
    delta: RealArray,
    channels: tuple[RealArray, RealArray],
    floor: float,
    size: RealArray,
) -> tuple[RealArray, RealArray, RealArray]:
    """Bounds (F,) on the norms of A and B, and on |e|, for covers that are not worse.

    In units of the channels, the product of the norms of P and S is at most sqrt(p m) / floor,
    since every cover contains the floor. S is scaled so that its largest row is 1. This bounds mu
    from below, hence the radius from above, and both bound delta.
    """
    rows, columns = channels
    p, m = rows.shape[1], columns.shape[1]
    unit = np.array(loop, complex)
    unit[:, :m] *= columns[:, :, None]
    unit[:, :, :p] *= rows[:, None]
    inner = log_norm(unit[:, :m, :p]), log_norm(unit[:, m:, p:])
    across = log_norm(unit[:, :m, p:]), log_norm(unit[:, m:, :p])
    thin = np.log(floor) - np.log(p * m) / 2
    least_mu = np.maximum(inner[0] + thin, inner[1])
    least_mu = np.maximum(least_mu, (sum(across) + thin) / 2)
    high = (size - least_mu) / VOLUME_SHARE
    found = farthest(P, S, channels, floor, -p * m * high)
    if loop.shape[1:] == (m, p):
        return *found, np.zeros(len(P))
    low = np.log(floor) + np.log(rows).mean(axis=1) + np.log(columns).mean(axis=1)
    most_mu = size - VOLUME_SHARE * low
    row = np.log(np.linalg.norm(columns[:, :, None] * S, axis=2).max(axis=1))
    delta = delta - row  # delta of the same sets with rows of S of at most 1
    top = most_mu + np.log(m) / 2 - across[0]
    bottom = across[1] - most_mu - np.log(p) / 2 + np.log(floor)
    return *found, np.maximum(np.abs(top - delta), np.abs(delta - bottom))


def _log_radius(P: Array, S: Array) -> RealArray:
    """Logarithm (F,) of the geometric mean radius of sets with these inverse weights."""
    logs = [np.linalg.slogdet(W)[1] / W.shape[-1] for W in (P, S)]
    found: RealArray = -(logs[0] + logs[1])
    return found
