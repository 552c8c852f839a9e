"""The method of `workbench.mu.upper.path` for eight matrices at once, with diagonal multipliers.

A path that is lost is left to the method for one matrix.
"""

from __future__ import annotations

import numpy as np

from workbench.addresses import address
from workbench.compiled import unchecked, unchecked_kernel
from workbench.mu.upper.lanes.algebra import (
    cholesky,
    fill_upper_half,
    inverse_of_factored,
    product,
    real_cholesky,
    real_cholesky_solve,
    twice_hermitian_part,
)
from workbench.mu.upper.lanes.simd import LANES, Lane, set_real_product, set_sum
from workbench.mu.upper.lanes.state import (
    Fates,
    Lanes,
    Numbers,
    Places,
    Room,
    fates_at,
    lanes_at,
    numbers_at,
)
from workbench.mu.upper.lanes.system import (
    add_diagonal,
    along_t,
    between_M,
    inequality,
    inequality_adjoint,
    newton_matrix,
)

NEGLIGIBLE_T = 1e-16
"""t below this share of its first value counts as zero."""
LARGEST_FALL = 1.5
"""Largest share of t by which one step may lower t."""
LOST_STEP = 0.05
"""A step shorter than this means that the path is lost."""
BOUNDARY_SHARE = 0.95
"""Share of the distance to the boundary that a step covers."""
PREDICTED_STEP = 0.6
"""Largest step of the predictor that the corrector's aim counts on; one that the last step of the
path did not reach is not counted on either. To look for the longest step takes longer and serves no
better."""
STEP_TRIALS = 5
"""Trials that find the longest step."""
FALL = 0.83
"""Factor on the step after the first trial that fails, squared after each: the last trial is just
above `LOST_STEP`. Once one holds, the interval is halved."""
STEP_HALVINGS = 20
"""Most halvings of a step until S and D are positive definite after it."""
ITERATIONS = 40
"""Most iterations of one path."""
START = 1.5
"""First t over the Frobenius norm of M^H M, which is at least the square of its largest singular
value."""


@unchecked
def follow_paths(
    batch: np.ndarray,
    places: np.ndarray,
    room: Room,
    accuracy: float,
    enough: np.ndarray,
    D: np.ndarray,
    G: np.ndarray,
    gaps: np.ndarray,
    iterations: np.ndarray,
) -> None:
    """D (F, N) and G (F, q) at the ends of the paths of matrices (F, c, r), from D = 1 and G = 0.

    A path also ends, without a gap, where its t is ``enough`` (F,). ``places`` are those of
    `Places`, one after the other. ``gaps`` (F,) are as in `workbench.mu.upper.path.follow`;
    infinite where a path was lost.
    """
    count, c, r = batch.shape
    N, q = D.shape[1], G.shape[1]
    left, right = address(places, 0), address(places, c)
    row, column = address(places, c + r), address(places, c + r + q)
    at = Places(left, right, row, column, N, c, r, q)
    lanes, numbers = lanes_at(room.lanes, room.starts), numbers_at(room.numbers, room.rows)
    fates = fates_at(room.fates, room.rows)
    waiting, left_over = 0, 0
    while waiting < count or left_over > 0:
        # Eight paths begin together: near their ends most steps are long, and few trials are made.
        if left_over == 0:
            left_over = min(LANES, count - waiting)
            for w in range(left_over):
                _load(at, lanes, numbers, fates, batch, enough, waiting + w, w)
            waiting += left_over
            _start(at, lanes, numbers, fates)
            cholesky(lanes.S, lanes.L, r, fates.held)
        inverse_of_factored(lanes.L, lanes.work, lanes.S_inverse, r)
        for w in range(LANES):
            if fates.active[w] and fates.used[w] == 0:
                _centre(at, lanes, w)
        set_real_product(lanes.number, 0, 0, lanes.S, 0, 0, 1, lanes.Z, 0, 0, 1, 2 * r * r)
        set_real_product(lanes.number, 1, 0, lanes.x, 0, 0, 1, lanes.W, 0, 0, 1, N)
        _newton_system(at, lanes, numbers)
        for w in range(LANES):
            inside = lanes.number[w] + lanes.number[LANES + w]
            gap = inside / (numbers.t[w] * _trace(at, lanes.Z, lanes.x, w))
            numbers.dt[w] = max(-1.0 / numbers.schur[w], -LARGEST_FALL * numbers.t[w])
            numbers.gap[w] = gap
            near = gap <= accuracy and -numbers.dt[w] <= accuracy * numbers.t[w]
            if fates.active[w] and (near or fates.used[w] >= ITERATIONS):
                _end(at, lanes, fates, gap, w, D, G, gaps, iterations)
            if not fates.active[w]:
                numbers.dt[w] = 0.0
            numbers.rho[w] = -numbers.dt[w] * numbers.along[w]
        _predict(at, lanes, numbers)
        _correct(at, lanes, numbers)
        for w in range(LANES):
            # steps that raise t over a closed gap come from rounding: such a path is lost
            rises = numbers.gap[w] <= accuracy and numbers.dt[w] > accuracy * numbers.t[w]
            if fates.active[w] and rises:
                _end(at, lanes, fates, np.inf, w, D, G, gaps, iterations)
        _advance(at, lanes, numbers, fates)
        for w in range(LANES):
            if fates.active[w]:
                fates.used[w] += 1
                small = numbers.t[w] <= max(numbers.nothing[w], numbers.enough[w])
                if fates.lost[w] or small:
                    gap = np.inf if fates.lost[w] else 0.0
                    _end(at, lanes, fates, gap, w, D, G, gaps, iterations)
        left_over = 0
        for w in range(LANES):
            left_over += fates.active[w]


@unchecked_kernel
def _load(
    places: Places,
    lanes: Lanes,
    numbers: Numbers,
    fates: Fates,
    batch: np.ndarray,
    enough: np.ndarray,
    f: int,
    w: int,
) -> None:
    """Put matrix f (c, r) into a lane, with D = 1 and G = 0."""
    c, r = places.c, places.r
    for i in range(c):
        for j in range(r):
            entry, at = batch[f, i, j], (i * r + j) * 2 * LANES
            lanes.M[at + w], lanes.M[at + LANES + w] = entry.real, entry.imag
    for k in range(places.blocks + places.q):
        lanes.x[k * LANES + w] = 1.0 if k < places.blocks else 0.0
    numbers.primal[w] = numbers.dual[w] = PREDICTED_STEP
    numbers.t[w], numbers.enough[w] = 0.0, enough[f]
    fates.matrix[w], fates.used[w], fates.active[w], fates.lost[w] = f, 0, 1, 0


@unchecked_kernel
def _start(places: Places, lanes: Lanes, numbers: Numbers, fates: Fates) -> None:
    """Start the paths of all lanes: S = t - M^H M > 0."""
    r, S = places.r, lanes.S
    inequality(places, lanes.M, numbers.t, lanes.x, lanes.MX, S)
    set_real_product(lanes.number, 0, 0, S, 0, 0, 1, S, 0, 0, 1, 2 * r * r)
    for w in range(LANES):
        t = START * np.sqrt(lanes.number[w])
        numbers.t[w], numbers.nothing[w] = t, NEGLIGIBLE_T * t
        for j in range(r):
            S[(j * r + j) * 2 * LANES + w] += t


@unchecked_kernel
def _centre(places: Places, lanes: Lanes, w: int) -> None:
    """Multipliers as if the point lay in the centre: Z = mu S^-1, W = mu D^-1, <Z, D_r> = 1."""
    r = places.r
    mu = 1.0 / _trace(places, lanes.S_inverse, lanes.x, w)
    for e in range(2 * r * r):
        lanes.Z[e * LANES + w] = mu * lanes.S_inverse[e * LANES + w]
    for k in range(places.blocks):
        lanes.W[k * LANES + w] = mu / lanes.x[k * LANES + w]


@unchecked_kernel
def _end(
    places: Places,
    lanes: Lanes,
    fates: Fates,
    gap: float,
    w: int,
    D: np.ndarray,
    G: np.ndarray,
    gaps: np.ndarray,
    iterations: np.ndarray,
) -> None:
    """Write down where the path of a lane has ended."""
    N, f = places.blocks, fates.matrix[w]
    for k in range(N):
        D[f, k] = lanes.x[k * LANES + w]
    for k in range(places.q):
        G[f, k] = lanes.x[(N + k) * LANES + w]
    gaps[f], iterations[f] = gap, fates.used[w]
    fates.active[w] = 0


@unchecked_kernel
def _predict(places: Places, lanes: Lanes, numbers: Numbers) -> None:
    """The predictor's step, and how far from the boundary the corrector should aim."""
    r, N = places.r, places.blocks
    every, number = 2 * r * r, lanes.number
    dS, dZ, dx = lanes.dS, lanes.dZ, lanes.dx
    for start in range(0, (N + places.q) * LANES, LANES):
        for w in range(LANES):
            e = start + w
            dx[e] = -numbers.dt[w] * lanes.toward_u[e] - numbers.rho[w] * lanes.toward_b[e]
    _direction(places, lanes, numbers)
    set_real_product(number, 2, 0, dS, 0, 0, 1, lanes.Z, 0, 0, 1, every)
    set_real_product(number, 3, 0, dS, 0, 0, 1, dZ, 0, 0, 1, every)
    set_real_product(number, 4, 0, dx, 0, 0, 1, lanes.W, 0, 0, 1, N)
    set_real_product(number, 5, 0, dx, 0, 0, 1, lanes.dW, 0, 0, 1, N)
    for w in range(LANES):
        p, q = min(numbers.primal[w], PREDICTED_STEP), min(numbers.dual[w], PREDICTED_STEP)
        now = number[w] + number[LANES + w]
        # <S, dZ> is -<S, Z> - <dS, Z>, for W likewise; <Z, D_r(dx)> is 0
        first = number[2 * LANES + w] + number[4 * LANES + w]
        both = number[3 * LANES + w] + number[5 * LANES + w]
        both += p * numbers.dt[w] * _trace(places, dZ, dx, w)
        left = (now + p * first - q * (now + first) + p * q * both) / now
        numbers.center[w] = max(min(left, 1.0), 0.0) ** 3 * now / (r + N)


@unchecked_kernel
def _advance(places: Places, lanes: Lanes, numbers: Numbers, fates: Fates) -> None:
    """Go as far as the corrector's step leads; ``lost`` tells whose step is too short."""
    r, N = places.r, places.blocks
    m = N + places.q
    Z, dZ, x, dx, W, dW = lanes.Z, lanes.dZ, lanes.x, lanes.dx, lanes.W, lanes.dW
    t, dt, primal, dual = numbers.t, numbers.dt, numbers.primal, numbers.dual
    active, lost, held = fates.active, fates.lost, fates.held
    for w in range(LANES):
        if not active[w]:
            dt[w] = 0.0
    paths = (places, lanes, numbers, fates)
    _reach(*paths, lanes.S, lanes.dS, x, dx, dt, primal)
    _reach(*paths, Z, dZ, W, dW, numbers.none, dual)
    for w in range(LANES):
        if active[w] and t[w] + primal[w] * dt[w] < -numbers.nothing[w]:
            primal[w] = (t[w] + numbers.nothing[w]) / -dt[w]  # any t < 0 will do
        lost[w] = not (min(primal[w], dual[w]) >= LOST_STEP)
    for _ in range(STEP_HALVINGS):  # S is not linear in the step, and rounds
        for w in range(LANES):
            goes = active[w] and not lost[w]
            primal[w], dual[w] = (primal[w], dual[w]) if goes else (0.0, 0.0)
            held[w] = 1
            numbers.ahead[w] = t[w] + primal[w] * dt[w]
        for start in range(0, m * LANES, LANES):
            for w in range(LANES):
                e = start + w
                lanes.trial[e] = x[e] + primal[w] * dx[e] if primal[w] > 0.0 else x[e]
                if e < N * LANES and not lanes.trial[e] > 0.0:
                    held[w] = 0
        inequality(places, lanes.M, numbers.ahead, lanes.trial, lanes.MX, lanes.S)
        cholesky(lanes.S, lanes.L, r, held)
        failed = False
        for w in range(LANES):
            if primal[w] > 0.0 and not held[w]:
                primal[w] *= 0.5
                failed = True
        if not failed:
            break
    for w in range(LANES):
        if primal[w] > 0.0 and not held[w]:
            lost[w], dual[w] = 1, 0.0
        t[w] = numbers.ahead[w]
    for e in range(m * LANES):
        x[e] = lanes.trial[e]
    # a lane that is done has steps that may not be numbers
    for start in range(0, 2 * r * r * LANES, LANES):
        for w in range(LANES):
            Z[start + w] += dual[w] * dZ[start + w] if dual[w] > 0.0 else 0.0
    for start in range(0, N * LANES, LANES):
        for w in range(LANES):
            W[start + w] += dual[w] * dW[start + w] if dual[w] > 0.0 else 0.0


@unchecked_kernel
def _trace(places: Places, X: Lane, x: Lane, w: int) -> float:
    """<X, D_r> of a lane, d being the first unknowns."""
    r, total = places.r, 0.0
    for j in range(r):
        total += X[(j * r + j) * 2 * LANES + w] * x[places.right[j] * LANES + w]
    return total


@unchecked_kernel
def _newton_system(places: Places, lanes: Lanes, numbers: Numbers) -> None:
    """H, factored, u and b, H^-1 u and H^-1 b, F*(S^-1) in ``pull``, and three numbers."""
    m = places.blocks + places.q
    M, Si, Z, number = lanes.M, lanes.S_inverse, lanes.Z, lanes.number
    t, along, bb, schur = numbers.t, numbers.along, numbers.bb, numbers.schur
    between_M(places, M, Si, lanes.T_M, lanes.T_C)
    inequality_adjoint(places, M, t, Si, lanes.T_M, lanes.pull)
    between_M(places, M, Z, lanes.U_M, lanes.U_C)
    newton_matrix(places, t, lanes)
    real_cholesky(lanes.H, lanes.pivots, m)
    along_t(places, t, lanes, schur)
    for e in range(m * LANES):
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
        curvature = schur[w]
        left = curvature - number[10 * LANES + w] + along[w] ** 2 * bb[w]
        schur[w] = max(left, 1e-14 * curvature)


@unchecked_kernel
def _direction(places: Places, lanes: Lanes, numbers: Numbers) -> None:
    """Change of S by dt and the unknowns' step and, to first order, of Z and W."""
    r, N = places.r, places.blocks
    dS, dx = lanes.dS, lanes.dx
    inequality(places, lanes.M, numbers.t, dx, lanes.MX, dS)
    for j in range(r):
        at, of = (j * r + j) * 2 * LANES, places.right[j] * LANES
        for w in range(LANES):
            dS[at + w] += numbers.dt[w] * lanes.x[of + w]
    product(lanes.S_inverse, dS, lanes.work, r, r, r)
    twice_hermitian_part(lanes.work, lanes.Z, lanes.dZ, r)
    for e in range(2 * r * r * LANES):
        lanes.dZ[e] = -lanes.Z[e] - 0.5 * lanes.dZ[e]
    for e in range(N * LANES):
        lanes.dW[e] = -lanes.W[e] - dx[e] * lanes.W[e] / lanes.x[e]


@unchecked_kernel
def _correct(places: Places, lanes: Lanes, numbers: Numbers) -> None:
    """The corrector's dt and step, after the predictor's."""
    c, r, N = places.c, places.r, places.blocks
    m = N + places.q
    M, Si, Z, Q, V, work = lanes.M, lanes.S_inverse, lanes.Z, lanes.Q, lanes.V, lanes.work
    dS, dZ, dx, x, number = lanes.dS, lanes.dZ, lanes.dx, lanes.x, lanes.number
    t, dt, rho, center = numbers.t, numbers.dt, numbers.rho, numbers.center
    # Q is the Hermitian part of S^-1 (dS dZ + dt dD_r Z)
    for k in range(N):
        for w in range(LANES):
            lanes.second[k * LANES + w] = dt[w] * dx[k * LANES + w]
    product(dS, dZ, work, r, r, r)
    for i in range(r):
        row = 2 * i * r
        set_sum(work, row, work, row, lanes.second, places.right[i], Z, row, 2 * r)
    product(Si, work, V, r, r, r)
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
        change = (target - number[13 * LANES + w] + numbers.along[w] * level) / numbers.schur[w]
        dt[w] = max(change, -LARGEST_FALL * t[w])
        rho[w] = (level / numbers.bb[w] if numbers.bb[w] > 0.0 else 0.0) - dt[w] * numbers.along[w]
    for k in range(m):
        for w in range(LANES):
            e = k * LANES + w
            step = lanes.other[e] - dt[w] * lanes.toward_u[e]
            dx[e] = step - rho[w] * lanes.toward_b[e]
    _direction(places, lanes, numbers)
    set_sum(dZ, 0, dZ, 0, center, 0, Si, 0, 2 * r * r)
    for e in range(2 * r * r * LANES):
        dZ[e] -= Q[e]
    for k in range(N):
        for w in range(LANES):
            e = k * LANES + w
            lanes.dW[e] += center[w] / x[e] - lanes.second[e]


@unchecked_kernel
def _reach(
    places: Places,
    lanes: Lanes,
    numbers: Numbers,
    fates: Fates,
    A: Lane,
    first: Lane,
    v: Lane,
    dv: Lane,
    dt: Lane,
    low: Lane,
) -> None:
    """Steps ``low`` (LANES,) after which A + a first + a^2 dt dD_r and v + a dv are still positive.

    They are BOUNDARY_SHARE of the longest ones up to 1, and zero where a lane is not active.
    """
    trial, held, step, high = lanes.V, fates.held, numbers.step, numbers.high
    r = places.r
    for w in range(LANES):
        longest = 1.0 / BOUNDARY_SHARE if fates.active[w] else 0.0
        for k in range(places.blocks):
            e = k * LANES + w
            if v[e] + longest * dv[e] <= 0.0:
                longest = -v[e] / dv[e] if dv[e] < 0.0 else 0.0
        low[w], high[w], step[w] = 0.0, longest, longest
    fall = FALL
    for _ in range(STEP_TRIALS):
        set_sum(trial, 0, A, 0, step, 0, first, 0, 2 * r * r)
        for j in range(r):
            at, of = (j * r + j) * 2 * LANES, places.right[j] * LANES
            for w in range(LANES):
                trial[at + w] += step[w] ** 2 * dt[w] * lanes.dx[of + w]
        for w in range(LANES):
            held[w] = 1
        cholesky(trial, lanes.L, r, held)
        found = True
        for w in range(LANES):
            if held[w]:
                low[w] = step[w]
            else:
                high[w] = step[w]
            found = found and low[w] == high[w]
            if low[w] < high[w]:
                step[w] = 0.5 * (low[w] + high[w]) if low[w] > 0.0 else fall * high[w]
        fall *= fall
        if found:
            break
    for w in range(LANES):
        low[w] *= BOUNDARY_SHARE
