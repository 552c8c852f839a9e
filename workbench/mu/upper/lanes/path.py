"""The method of `workbench.mu.upper.path` for eight matrices at once, with diagonal multipliers.

A lane whose path is lost, or ends early, is left to the method for one matrix.
"""

from __future__ import annotations

import numpy as np

from workbench.compiled import compiled, kernel
from workbench.mu.upper.lanes.algebra import (
    cholesky,
    fill_upper_half,
    inverse_of_factored,
    product,
    real_cholesky,
    real_cholesky_solve,
    twice_hermitian_part,
)
from workbench.mu.upper.lanes.simd import LANES, set_real_product, set_scaled, set_sum
from workbench.mu.upper.lanes.state import Lanes, Places
from workbench.mu.upper.lanes.system import (
    add_diagonal,
    between_M,
    inequality,
    inequality_adjoint,
    newton_matrix,
)

NEGLIGIBLE_T = 1e-16
"""t below this share of its first value counts as zero."""
LARGEST_FALL = 1.5
"""Largest share of t by which one step may lower t."""
LOST_STEP = 0.1
"""A step shorter than this means that the path is lost."""
BOUNDARY_SHARE = 0.95
"""Share of the distance to the boundary that a step covers."""
PREDICTOR_TRIALS, CORRECTOR_TRIALS = 2, 6
"""Halvings that find the longest step of the predictor and of the corrector."""
STEP_HALVINGS = 20
"""Most halvings of a step until S and D are positive definite after it."""
ITERATIONS = 40
"""Most iterations."""


@compiled
def follow_eight(
    places: Places, lanes: Lanes, t: np.ndarray, accuracy: float, gaps: np.ndarray, used: np.ndarray
) -> None:
    """Follow the paths of ``lanes.M`` from D = 1, G = 0 and t (LANES,), above their squared norms.

    t, ``lanes.x``, the gaps and the numbers of iterations ``used`` (LANES,) are those of the ends;
    a gap above the accuracy means that the path did not reach its end.
    """
    r, N = places.right.size, places.blocks
    m = N + places.row.size
    every, two = 2 * r * r, 2 * LANES
    nothing = NEGLIGIBLE_T * t
    held, active = np.ones(LANES, np.bool_), np.ones(LANES, np.bool_)
    primal, dual, none = np.zeros(LANES), np.zeros(LANES), np.zeros(LANES)
    dt, rho, along, bb = np.zeros(LANES), np.zeros(LANES), np.zeros(LANES), np.zeros(LANES)
    schur, center, ahead = np.zeros(LANES), np.zeros(LANES), np.zeros(LANES)
    S, Z, dS, dZ, Si = lanes.S, lanes.Z, lanes.dS, lanes.dZ, lanes.S_inverse
    x, dx, W, dW, M = lanes.x, lanes.dx, lanes.W, lanes.dW, lanes.M
    number = lanes.number
    x[: N * LANES] = 1.0
    x[N * LANES :] = 0.0
    gaps[:] = np.inf
    used[:] = 0
    inequality(places, M, t, x, lanes.MX, S)
    cholesky(S, lanes.L, r, held)
    for w in range(LANES):
        active[w] = active[w] and held[w]
    for iteration in range(ITERATIONS):
        inverse_of_factored(lanes.L, lanes.work, Si, r)
        if iteration == 0:
            for w in range(LANES):
                along[w] = 1.0 / _trace(places, Si, x, w)
            set_scaled(Z, 0, along, 0, Si, 0, every)
            for k in range(N):
                for w in range(LANES):
                    W[k * LANES + w] = along[w] / x[k * LANES + w]
        set_real_product(number, 0, 0, S, 0, 0, 1, Z, 0, 0, 1, every)
        set_real_product(number, 1, 0, x, 0, 0, 1, W, 0, 0, 1, N)
        _newton_system(places, lanes, t, along, bb, schur)
        moving = False
        for w in range(LANES):
            inside = number[w] + number[LANES + w]
            if active[w]:
                gaps[w] = inside / (t[w] * _trace(places, Z, x, w))
                used[w] = iteration
            dt[w] = max(-1.0 / schur[w], -LARGEST_FALL * t[w])
            if active[w] and gaps[w] <= accuracy and -dt[w] <= accuracy * t[w]:
                active[w] = False
            if not active[w]:
                dt[w] = 0.0
            moving = moving or active[w]
            rho[w] = -dt[w] * along[w]
        if not moving:
            return

        # the predictor
        for k in range(m):
            for w in range(LANES):
                e = k * LANES + w
                dx[e] = -dt[w] * lanes.toward_u[e] - rho[w] * lanes.toward_b[e]
        _direction(places, lanes, t, dt)
        _reach(places, lanes, S, dS, x, dx, dt, PREDICTOR_TRIALS, primal, held)
        _reach(places, lanes, Z, dZ, W, dW, none, PREDICTOR_TRIALS, dual, held)
        set_real_product(number, 2, 0, dS, 0, 0, 1, Z, 0, 0, 1, every)
        set_real_product(number, 3, 0, S, 0, 0, 1, dZ, 0, 0, 1, every)
        set_real_product(number, 4, 0, dS, 0, 0, 1, dZ, 0, 0, 1, every)
        set_real_product(number, 5, 0, dx, 0, 0, 1, W, 0, 0, 1, N)
        set_real_product(number, 6, 0, x, 0, 0, 1, dW, 0, 0, 1, N)
        set_real_product(number, 7, 0, dx, 0, 0, 1, dW, 0, 0, 1, N)
        for w in range(LANES):
            p, q = primal[w], dual[w]
            now = number[w] + number[LANES + w]
            first = number[2 * LANES + w] + number[5 * LANES + w]
            other = number[3 * LANES + w] + number[6 * LANES + w]
            both = number[4 * LANES + w] + number[7 * LANES + w]
            second = dt[w] * (_trace(places, Z, dx, w) + q * _trace(places, dZ, dx, w))
            left = (now + p * first + q * other + p * q * both + p * p * second) / now
            center[w] = max(min(left, 1.0), 0.0) ** 3 * now / (r + N)

        _correct(places, lanes, t, dt, rho, center, along, bb, schur)
        for w in range(LANES):
            if not active[w]:
                dt[w] = 0.0
        _reach(places, lanes, S, dS, x, dx, dt, CORRECTOR_TRIALS, primal, held)
        _reach(places, lanes, Z, dZ, W, dW, none, CORRECTOR_TRIALS, dual, held)
        for w in range(LANES):
            if active[w] and t[w] + primal[w] * dt[w] < -nothing[w]:
                primal[w] = (t[w] + nothing[w]) / -dt[w]
            if active[w] and not (min(primal[w], dual[w]) >= LOST_STEP):
                active[w] = False  # lost: the gap stays what it is
                gaps[w] = np.inf
            if not active[w]:
                primal[w] = dual[w] = 0.0
                center[w] = 0.0
        for _ in range(STEP_HALVINGS):  # S is not linear in the step, and rounds
            for w in range(LANES):
                held[w] = True
                ahead[w] = t[w] + primal[w] * dt[w] if active[w] else t[w]
            for k in range(m):
                for w in range(LANES):
                    e = k * LANES + w
                    lanes.trial[e] = x[e] + (primal[w] * dx[e] if active[w] else 0.0)
                    if k < N and not lanes.trial[e] > 0.0:
                        held[w] = False
            inequality(places, M, ahead, lanes.trial, lanes.MX, S)
            cholesky(S, lanes.L, r, held)
            failed = False
            for w in range(LANES):
                if active[w] and not held[w]:
                    primal[w] *= 0.5
                    failed = True
            if not failed:
                break
        for w in range(LANES):
            if active[w] and not held[w]:
                active[w], gaps[w], primal[w], dual[w] = False, np.inf, 0.0, 0.0
        x[:] = lanes.trial
        t[:] = ahead
        for e in range(Z.size // two):  # a lane that is done has steps that may not be numbers
            for w in range(LANES):
                if active[w]:
                    Z[e * two + w] += dual[w] * dZ[e * two + w]
                    Z[e * two + LANES + w] += dual[w] * dZ[e * two + LANES + w]
        for k in range(N):
            for w in range(LANES):
                if active[w]:
                    W[k * LANES + w] += dual[w] * dW[k * LANES + w]
        for w in range(LANES):
            if active[w] and t[w] <= nothing[w]:
                active[w], gaps[w], used[w] = False, 0.0, iteration + 1


@kernel
def _trace(places: Places, X: np.ndarray, x: np.ndarray, w: int) -> float:
    """<X, D_r> of a lane, d being the first unknowns."""
    r, total = places.right.size, 0.0
    for j in range(r):
        total += X[(j * r + j) * 2 * LANES + w] * x[places.right[j] * LANES + w]
    return total


@kernel
def _newton_system(
    places: Places,
    lanes: Lanes,
    t: np.ndarray,
    along: np.ndarray,
    bb: np.ndarray,
    schur: np.ndarray,
) -> None:
    """H, factored, u = F*(V) and b, H^-1 u and H^-1 b, F*(S^-1) in ``pull``, and three numbers."""
    c, r, N = places.left.size, places.right.size, places.blocks
    m = N + places.row.size
    M, Si, Z, V, number = lanes.M, lanes.S_inverse, lanes.Z, lanes.V, lanes.number
    between_M(places, M, Si, lanes.T_M, lanes.T_C)
    inequality_adjoint(places, M, t, Si, lanes.T_M, lanes.pull)
    between_M(places, M, Z, lanes.U_M, lanes.U_C)
    newton_matrix(places, t, lanes)
    real_cholesky(lanes.H, lanes.pivots, m)
    # 2 V = S^-1 D_r Z and its conjugate transpose
    _columns_scaled(places, Si, lanes.x, lanes.work)
    twice_hermitian_part(lanes.work, Z, V, r)
    product(M, V, lanes.MX, c, r, r)
    inequality_adjoint(places, M, t, V, lanes.MX, lanes.u)
    for e in range(m * LANES):
        lanes.u[e] *= 0.5
        lanes.b[e] = 0.0
    add_diagonal(places, Z, lanes.b)
    real_cholesky_solve(lanes.H, lanes.pivots, lanes.u, lanes.toward_u, m)
    real_cholesky_solve(lanes.H, lanes.pivots, lanes.b, lanes.toward_b, m)
    set_real_product(number, 8, 0, lanes.b, 0, 0, 1, lanes.toward_b, 0, 0, 1, m)
    set_real_product(number, 9, 0, lanes.u, 0, 0, 1, lanes.toward_b, 0, 0, 1, m)
    set_real_product(number, 10, 0, lanes.u, 0, 0, 1, lanes.toward_u, 0, 0, 1, m)
    for w in range(LANES):
        bb[w] = number[8 * LANES + w]
        along[w] = number[9 * LANES + w] / bb[w] if bb[w] > 0.0 else 0.0
        curvature = 0.5 * _trace(places, V, lanes.x, w)
        left = curvature - number[10 * LANES + w] + along[w] ** 2 * bb[w]
        schur[w] = max(left, 1e-14 * curvature)


@kernel
def _columns_scaled(places: Places, A: np.ndarray, x: np.ndarray, X: np.ndarray) -> None:
    """X = A D_r."""
    r = places.right.size
    for i in range(r):
        for j in range(r):
            e = 2 * (i * r + j)
            set_scaled(X, e, x, places.right[j], A, e, 2)


@kernel
def _direction(places: Places, lanes: Lanes, t: np.ndarray, dt: np.ndarray) -> None:
    """Change of S by dt and the unknowns' step and, to first order, of Z and W."""
    r, N = places.right.size, places.blocks
    dS, dx = lanes.dS, lanes.dx
    inequality(places, lanes.M, t, dx, lanes.MX, dS)
    for j in range(r):
        at, of = (j * r + j) * 2 * LANES, places.right[j] * LANES
        for w in range(LANES):
            dS[at + w] += dt[w] * lanes.x[of + w]
    product(lanes.S_inverse, dS, lanes.work, r, r, r)
    twice_hermitian_part(lanes.work, lanes.Z, lanes.dZ, r)
    for e in range(2 * r * r * LANES):
        lanes.dZ[e] = -lanes.Z[e] - 0.5 * lanes.dZ[e]
    for e in range(N * LANES):
        lanes.dW[e] = -lanes.W[e] - dx[e] * lanes.W[e] / lanes.x[e]


@kernel
def _correct(
    places: Places,
    lanes: Lanes,
    t: np.ndarray,
    dt: np.ndarray,
    rho: np.ndarray,
    center: np.ndarray,
    along: np.ndarray,
    bb: np.ndarray,
    schur: np.ndarray,
) -> None:
    """The corrector's dt and step, after the predictor's."""
    c, r, N = places.left.size, places.right.size, places.blocks
    m = N + places.row.size
    M, Si, Z, Q, V = lanes.M, lanes.S_inverse, lanes.Z, lanes.Q, lanes.V
    dS, dZ, dx, x, number = lanes.dS, lanes.dZ, lanes.dx, lanes.x, lanes.number
    # 2 Q = S^-1 (dS dZ + dt dD_r Z) and its conjugate transpose
    for i in range(r):
        for j in range(r):
            e, of = (i * r + j) * 2 * LANES, places.right[i] * LANES
            for w in range(LANES):
                share = dt[w] * dx[of + w]
                V[e + w] = share * Z[e + w]
                V[e + LANES + w] = share * Z[e + LANES + w]
    product(dS, dZ, lanes.work, r, r, r)
    for e in range(2 * r * r * LANES):
        lanes.work[e] += V[e]
    product(Si, lanes.work, V, r, r, r)
    two = 2 * LANES
    for i in range(r):
        for j in range(i + 1):
            e, back = (i * r + j) * two, (j * r + i) * two
            for w in range(LANES):
                Q[e + w] = 0.5 * (V[e + w] + V[back + w])
                Q[e + LANES + w] = 0.5 * (V[e + LANES + w] - V[back + LANES + w])
    fill_upper_half(Q, r)
    product(M, Q, lanes.MX, c, r, r)
    inequality_adjoint(places, M, t, Q, lanes.MX, lanes.other)
    for k in range(N):
        for w in range(LANES):
            e = k * LANES + w
            lanes.second[e] = dx[e] * lanes.dW[e] / x[e]
            lanes.other[e] += lanes.second[e] - center[w] / x[e]
    for j in range(r):
        at, to = (j * r + j) * two, places.right[j] * LANES
        for w in range(LANES):
            lanes.other[to + w] += rho[w] * dZ[at + w]
    for w in range(LANES):
        target = center[w] * _trace(places, Si, x, w) - _trace(places, Q, x, w)
        number[11 * LANES + w] = target + _trace(places, dZ, dx, w) - 1.0
    for k in range(m):
        for w in range(LANES):
            e = k * LANES + w
            lanes.pull[e] = center[w] * lanes.pull[e] - lanes.other[e]
    real_cholesky_solve(lanes.H, lanes.pivots, lanes.pull, lanes.other, m)
    set_real_product(number, 12, 0, lanes.b, 0, 0, 1, lanes.other, 0, 0, 1, m)
    set_real_product(number, 13, 0, lanes.u, 0, 0, 1, lanes.other, 0, 0, 1, m)
    for w in range(LANES):
        level, target = number[12 * LANES + w], number[11 * LANES + w]
        change = (target - number[13 * LANES + w] + along[w] * level) / schur[w]
        dt[w] = max(change, -LARGEST_FALL * t[w])
        rho[w] = (level / bb[w] if bb[w] > 0.0 else 0.0) - dt[w] * along[w]
    for k in range(m):
        for w in range(LANES):
            e = k * LANES + w
            step = lanes.other[e] - dt[w] * lanes.toward_u[e]
            dx[e] = step - rho[w] * lanes.toward_b[e]
    _direction(places, lanes, t, dt)
    for e in range(r * r):
        for w in range(LANES):
            a = e * two + w
            dZ[a] += center[w] * Si[a] - Q[a]
            dZ[a + LANES] += center[w] * Si[a + LANES] - Q[a + LANES]
    for k in range(N):
        for w in range(LANES):
            e = k * LANES + w
            lanes.dW[e] += center[w] / x[e] - lanes.second[e]


@kernel
def _reach(
    places: Places,
    lanes: Lanes,
    A: np.ndarray,
    first: np.ndarray,
    v: np.ndarray,
    dv: np.ndarray,
    dt: np.ndarray,
    trials: int,
    low: np.ndarray,
    held: np.ndarray,
) -> None:
    """Steps ``low`` (LANES,) after which A + a first + a^2 dt dD_r and v + a dv are still positive.

    They are BOUNDARY_SHARE of the longest ones up to 1; ``lanes.number`` and V are work space.
    """
    r, step = places.right.size, lanes.number[14 * LANES : 15 * LANES]
    high = lanes.number[15 * LANES :]
    for w in range(LANES):
        longest = 1.0 / BOUNDARY_SHARE
        for k in range(places.blocks):
            e = k * LANES + w
            if v[e] + longest * dv[e] <= 0.0:
                longest = -v[e] / dv[e] if dv[e] < 0.0 else 0.0
        low[w], high[w], step[w] = 0.0, longest, longest
    for _ in range(trials):
        set_sum(lanes.V, 0, A, 0, step, 0, first, 0, 2 * r * r)
        for j in range(r):
            at, of = (j * r + j) * 2 * LANES, places.right[j] * LANES
            for w in range(LANES):
                lanes.V[at + w] += step[w] ** 2 * dt[w] * lanes.dx[of + w]
        for w in range(LANES):
            held[w] = True
        cholesky(lanes.V, lanes.L, r, held)
        found = True
        for w in range(LANES):
            if held[w]:
                low[w] = step[w]
            else:
                high[w] = step[w]
            found = found and low[w] == high[w]
            if low[w] < high[w]:
                step[w] = 0.5 * (low[w] + high[w])
        if found:
            break
    for w in range(LANES):
        low[w] *= BOUNDARY_SHARE
