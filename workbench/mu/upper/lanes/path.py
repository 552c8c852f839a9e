"""The method of `workbench.mu.upper.path` for eight matrices at once, with diagonal multipliers.

A path that is lost is continued by the method for one matrix.
"""

from __future__ import annotations

import numpy as np

from workbench._core.compiled import unchecked, unchecked_kernel
from workbench._core.machine_code.addresses import address
from workbench._core.machine_code.sums import LANES, Lane, set_real_product, set_sum
from workbench._core.machine_code.values import of_lanes, put, where_less
from workbench.mu.upper.lanes.algebra import (
    cholesky,
    inverse_of_factored,
    product,
    product_of_half,
    real_cholesky,
    real_cholesky_solve,
    twice_hermitian_part,
)
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
    between_M,
    half_adjoint,
    inequality,
    inequality_adjoint,
    newton_column,
    newton_matrix,
)
from workbench.mu.upper.newton import BOUNDARY_SHARE
from workbench.mu.upper.path import LARGEST_FALL, NEGLIGIBLE_T, STEP_HALVINGS

LOST_STEP = 0.05
"""A step shorter than this means that the path is lost. Such a path needs more iterations than
`ITERATIONS`; the other path takes it over. With half of it paths are given up later; with double of
it sooner. No bound changes but in its last digits.
"""
PREDICTED_STEP = 0.6
"""Largest step of the predictor for which the corrector aims; it is also capped by the last
accepted step. A search for the longest step takes longer and gives no better bounds. Half aims
nearer to the centre, and takes more iterations; double, above 1, aims at the border, and more paths
are lost.
"""
STEP_TRIALS = 5
"""Number of trials for the longest step. With `FALL` they reach from 1.05 down to `LOST_STEP`. Half
ends before, and loses more paths; double finds the longest step more exactly, which takes longer.
"""
FALL = 0.83
"""Factor on the step after the first failed trial; it is squared after each further one, so that
the last trial is just above `LOST_STEP`. Once a trial succeeds, the interval is halved. Half or
double of the distance from 1: the last trial is far above or below `LOST_STEP`.
"""
ITERATIONS = 40
"""Largest number of iterations of one path. Paths that take more are given to the slower way. Half
or double changes the time only.
"""
START = 1.5
"""First t, as a multiple of the Frobenius norm of M^H M, which is at least the square of the
largest singular value. It must be above 1 so that S > 0. Half of the distance from 1 starts nearer
to the border; double takes an iteration more.
"""


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

    A path also ends, without a gap, once its t is below ``enough`` (F,). ``places`` are the fields
    of `Places`, one after the other. ``gaps`` (F,) are as in `workbench.mu.upper.path.follow`;
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
        # Eight paths begin together: most steps near their ends are long, so few trials are needed.
        if left_over == 0:
            left_over = min(LANES, count - waiting)
            for w in range(left_over):
                _load(at, lanes, numbers, fates, batch, enough, waiting + w, w)
            waiting += left_over
            _start(at, lanes, numbers, fates)
            cholesky(lanes.S, lanes.L, r, numbers.held)
        inverse_of_factored(lanes.L, lanes.work, lanes.S_inverse, r)
        for w in range(LANES):
            if fates.active[w] and fates.used[w] == 0:
                _centre(at, lanes, w)
        set_real_product(lanes.number, 0, 0, lanes.S, 0, 0, 1, lanes.Z, 0, 0, 1, 2 * r * r)
        set_real_product(lanes.number, 1, 0, lanes.x, 0, 0, 1, lanes.W, 0, 0, 1, N)
        _newton_system(at, lanes, numbers)
        _trace(at, lanes.Z, lanes.x, numbers.step)
        for w in range(LANES):
            inside = lanes.number[w] + lanes.number[LANES + w]
            gap = inside / (numbers.t[w] * numbers.step[w])
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
    """Set the multipliers as if the point lay on the central path: Z = mu S^-1, W = mu D^-1, <Z,
    D_r> = 1.
    """
    r, total = places.r, 0.0
    for j in range(r):
        total += lanes.S_inverse[(j * r + j) * 2 * LANES + w] * lanes.x[places.right[j] * LANES + w]
    mu = 1.0 / total
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
    """Write the end point of a lane's path to the results."""
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
    for k in range(N + places.q):
        step = of_lanes(numbers.dt, 0) * of_lanes(lanes.toward_u, k)
        put(dx, k, -1.0 * step - of_lanes(numbers.rho, 0) * of_lanes(lanes.toward_b, k))
    _direction(places, lanes, numbers)
    _multiplier_step(places, lanes)
    set_real_product(number, 2, 0, dS, 0, 0, 1, lanes.Z, 0, 0, 1, every)
    set_real_product(number, 3, 0, dS, 0, 0, 1, dZ, 0, 0, 1, every)
    set_real_product(number, 4, 0, dx, 0, 0, 1, lanes.W, 0, 0, 1, N)
    set_real_product(number, 5, 0, dx, 0, 0, 1, lanes.dW, 0, 0, 1, N)
    _trace(places, dZ, dx, numbers.step)
    for w in range(LANES):
        p, q = min(numbers.primal[w], PREDICTED_STEP), min(numbers.dual[w], PREDICTED_STEP)
        now = number[w] + number[LANES + w]
        # <S, dZ> is -<S, Z> - <dS, Z>, for W likewise; <Z, D_r(dx)> is 0
        first = number[2 * LANES + w] + number[4 * LANES + w]
        both = number[3 * LANES + w] + number[5 * LANES + w]
        both += p * numbers.dt[w] * numbers.step[w]
        left = (now + p * first - q * (now + first) + p * q * both) / now
        numbers.center[w] = max(min(left, 1.0), 0.0) ** 3 * now / (r + N)


@unchecked_kernel
def _advance(places: Places, lanes: Lanes, numbers: Numbers, fates: Fates) -> None:
    """Go as far as the corrector's step leads; ``lost`` marks lanes whose step is too short."""
    r, N = places.r, places.blocks
    m = N + places.q
    Z, dZ, x, dx, W, dW = lanes.Z, lanes.dZ, lanes.x, lanes.dx, lanes.W, lanes.dW
    t, dt, primal, dual = numbers.t, numbers.dt, numbers.primal, numbers.dual
    active, lost, held = fates.active, fates.lost, numbers.held
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
    for _ in range(STEP_HALVINGS):  # S is not linear in the step, and is rounded
        for w in range(LANES):
            goes = active[w] and not lost[w]
            primal[w], dual[w] = (primal[w], dual[w]) if goes else (0.0, 0.0)
            held[w] = 1.0
            numbers.ahead[w] = t[w] + primal[w] * dt[w]
        for k in range(m):
            step = of_lanes(primal, 0)
            ahead = of_lanes(x, k) + step * of_lanes(dx, k)
            put(lanes.trial, k, where_less(0.0, step, ahead, of_lanes(x, k)))
            if k < N:
                put(held, 0, where_less(0.0, of_lanes(lanes.trial, k), of_lanes(held, 0), 0.0))
        inequality(places, lanes.M, numbers.ahead, lanes.trial, lanes.MX, lanes.S)
        cholesky(lanes.S, lanes.L, r, held)
        failed = False
        for w in range(LANES):
            if primal[w] > 0.0 and held[w] == 0.0:
                primal[w] *= 0.5
                failed = True
        if not failed:
            break
    for w in range(LANES):
        if primal[w] > 0.0 and held[w] == 0.0:
            lost[w], dual[w] = 1, 0.0
        t[w] = numbers.ahead[w]
    for k in range(m):
        put(x, k, of_lanes(lanes.trial, k))
    # a lane that has ended may have steps that are not numbers
    step = of_lanes(dual, 0)
    for e in range(2 * r * r):
        now, ahead = of_lanes(Z, e), of_lanes(Z, e) + step * of_lanes(dZ, e)
        put(Z, e, where_less(0.0, step, ahead, now))
    for k in range(N):
        now, ahead = of_lanes(W, k), of_lanes(W, k) + step * of_lanes(dW, k)
        put(W, k, where_less(0.0, step, ahead, now))


@unchecked_kernel
def _trace(places: Places, X: Lane, x: Lane, found: Lane) -> None:
    """<X, D_r> (LANES,), where d are the first unknowns."""
    total = 0.0 * of_lanes(x, 0)
    for j in range(places.r):
        total += of_lanes(X, 2 * (j * places.r + j)) * of_lanes(x, places.right[j])
    put(found, 0, total)


@unchecked_kernel
def _newton_system(places: Places, lanes: Lanes, numbers: Numbers) -> None:
    """H, factored, u and b, H^-1 u and H^-1 b, F*(S^-1) in ``pull``, and three numbers."""
    m = places.blocks + places.q
    M, Si, Z, number = lanes.M, lanes.S_inverse, lanes.Z, lanes.number
    t, along_b, bb, schur = numbers.t, numbers.along, numbers.bb, numbers.schur
    between_M(places, M, Si, lanes.T_M, lanes.T_C)
    inequality_adjoint(places, M, t, Si, lanes.T_M, lanes.pull)
    between_M(places, M, Z, lanes.U_M, lanes.U_C)
    newton_matrix(places, t, lanes)
    real_cholesky(lanes.H, lanes.pivots, m)
    newton_column(places, t, lanes, lanes.x, lanes.u, schur)
    for k in range(m):
        put(lanes.b, k, 0.0)
    add_diagonal(places, Z, lanes.b)
    real_cholesky_solve(lanes.H, lanes.pivots, lanes.u, lanes.toward_u, m)
    real_cholesky_solve(lanes.H, lanes.pivots, lanes.b, lanes.toward_b, m)
    set_real_product(number, 8, 0, lanes.b, 0, 0, 1, lanes.toward_b, 0, 0, 1, m)
    set_real_product(number, 9, 0, lanes.u, 0, 0, 1, lanes.toward_b, 0, 0, 1, m)
    set_real_product(number, 10, 0, lanes.u, 0, 0, 1, lanes.toward_u, 0, 0, 1, m)
    whole, half, curvature = of_lanes(number, 8), of_lanes(number, 9), of_lanes(schur, 0)
    share = where_less(0.0, whole, half / whole, 0.0)
    left = curvature - of_lanes(number, 10) + share * share * whole
    least = 1e-14 * curvature
    put(bb, 0, whole)
    put(along_b, 0, share)
    put(schur, 0, where_less(least, left, left, least))


@unchecked_kernel
def _direction(places: Places, lanes: Lanes, numbers: Numbers) -> None:
    """Change of S by dt and the unknowns' step, and S^-1 times that in ``work``."""
    r = places.r
    dS = lanes.dS
    inequality(places, lanes.M, numbers.t, lanes.dx, lanes.MX, dS)
    for j in range(r):
        e = 2 * (j * r + j)
        grown = of_lanes(numbers.dt, 0) * of_lanes(lanes.x, places.right[j])
        put(dS, e, of_lanes(dS, e) + grown)
    product(lanes.S_inverse, dS, lanes.work, r, r, r)


@unchecked_kernel
def _multiplier_step(places: Places, lanes: Lanes) -> None:
    """Change of Z and W to first order, from what `_direction` leaves."""
    r = places.r
    twice_hermitian_part(lanes.work, lanes.Z, lanes.dZ, r)
    for e in range(2 * r * r):
        put(lanes.dZ, e, -0.5 * of_lanes(lanes.dZ, e) - of_lanes(lanes.Z, e))
    for k in range(places.blocks):
        W = of_lanes(lanes.W, k)
        put(lanes.dW, k, -1.0 * W - of_lanes(lanes.dx, k) * W / of_lanes(lanes.x, k))


@unchecked_kernel
def _correct(places: Places, lanes: Lanes, numbers: Numbers) -> None:
    """The corrector's dt and step, after the predictor's.

    Its second order in Z is Q, the Hermitian part of S^-1 (dS dZ + E Z) with E = dt dD_r. That of
    the first term is a product with what `_direction` left for the predictor; that of the second
    goes into the equations as `along` says, and into dZ along with the corrector's own dS.
    """
    c, r, N = places.c, places.r, places.blocks
    m = N + places.q
    M, Si, Q, V, second = lanes.M, lanes.S_inverse, lanes.Q, lanes.V, lanes.second_D
    dZ, dx, x, number = lanes.dZ, lanes.dx, lanes.x, lanes.number
    t, dt, rho, center = numbers.t, numbers.dt, numbers.rho, of_lanes(numbers.center, 0)
    twice_hermitian_part(lanes.work, dZ, Q, r)
    for i in range(r):
        for j in range(i):
            for e in range(2 * (i * r + j), 2 * (i * r + j) + 2):
                put(V, e, 0.5 * of_lanes(Q, e))
        e = 2 * (i * r + i)
        put(V, e, 0.25 * of_lanes(Q, e))
        put(V, e + 1, 0.0)
        if i + 1 < r:
            put(V, e + 2, 0.0)
            put(V, e + 3, 0.0)
    product_of_half(M, V, lanes.MX, c, r)
    half_adjoint(places, M, t, V, lanes.MX, lanes.other)
    for k in range(N):
        put(second, k, of_lanes(dt, 0) * of_lanes(dx, k))
    newton_column(places, t, lanes, second, lanes.trial, numbers.ahead)
    _trace(places, Q, x, numbers.step)
    target = -0.5 * of_lanes(numbers.step, 0) - of_lanes(numbers.ahead, 0)
    for j in range(r):
        to = places.right[j]
        grown = of_lanes(rho, 0) * of_lanes(dZ, 2 * (j * r + j))
        put(lanes.other, to, of_lanes(lanes.other, to) + grown)
    _trace(places, Si, x, numbers.step)
    _trace(places, dZ, dx, numbers.ahead)
    target += center * of_lanes(numbers.step, 0) + of_lanes(numbers.ahead, 0) - 1.0
    for k in range(m):
        pull = center * of_lanes(lanes.pull, k) - of_lanes(lanes.other, k)
        put(lanes.pull, k, pull - of_lanes(lanes.trial, k))
    for k in range(N):
        put(numbers.step, 0, of_lanes(dx, k) * of_lanes(lanes.dW, k) / of_lanes(x, k))
        pull = of_lanes(lanes.pull, k) - of_lanes(numbers.step, 0)
        put(lanes.pull, k, pull + center / of_lanes(x, k))
        put(lanes.second_W, k, of_lanes(numbers.step, 0))
    real_cholesky_solve(lanes.H, lanes.pivots, lanes.pull, lanes.other, m)
    set_real_product(number, 12, 0, lanes.b, 0, 0, 1, lanes.other, 0, 0, 1, m)
    set_real_product(number, 13, 0, lanes.u, 0, 0, 1, lanes.other, 0, 0, 1, m)
    along_b, bb, level = of_lanes(numbers.along, 0), of_lanes(numbers.bb, 0), of_lanes(number, 12)
    change = (target - of_lanes(number, 13) + along_b * level) / of_lanes(numbers.schur, 0)
    least = -LARGEST_FALL * of_lanes(t, 0)
    change = where_less(least, change, change, least)
    put(dt, 0, change)
    put(rho, 0, where_less(0.0, bb, level / bb, 0.0) - change * along_b)
    for k in range(m):
        step = of_lanes(lanes.other, k) - change * of_lanes(lanes.toward_u, k)
        put(dx, k, step - of_lanes(rho, 0) * of_lanes(lanes.toward_b, k))
    _direction(places, lanes, numbers)
    for j in range(r):  # with E, of the predictor
        for i in range(r):
            for e in range(2 * (i * r + j), 2 * (i * r + j) + 2):
                grown = of_lanes(Si, e) * of_lanes(second, places.right[j])
                put(lanes.work, e, of_lanes(lanes.work, e) + grown)
    _multiplier_step(places, lanes)
    for e in range(2 * r * r):
        put(dZ, e, of_lanes(dZ, e) + center * of_lanes(Si, e) - 0.5 * of_lanes(Q, e))
    for k in range(N):
        dW = of_lanes(lanes.dW, k) + center / of_lanes(x, k)
        put(lanes.dW, k, dW - of_lanes(lanes.second_W, k))


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

    They are BOUNDARY_SHARE of the longest such steps, at most 1, and zero for a lane that is not
    active.
    """
    trial, held, step, high = lanes.V, numbers.held, numbers.step, numbers.high
    r = places.r
    for w in range(LANES):
        high[w] = 1.0 / BOUNDARY_SHARE if fates.active[w] else 0.0
    longest = of_lanes(high, 0)
    for k in range(places.blocks):
        now, slope = of_lanes(v, k), of_lanes(dv, k)
        most = where_less(slope, 0.0, -1.0 * now / slope, 0.0)
        longest = where_less(0.0, now + longest * slope, longest, most)
    put(low, 0, 0.0)
    put(high, 0, longest)
    put(step, 0, longest)
    fall = FALL
    for _ in range(STEP_TRIALS):
        for i in range(r):  # only the lower half
            row = 2 * i * r
            set_sum(trial, row, A, row, step, 0, first, row, 2 * (i + 1))
        for j in range(r):
            e, grown = 2 * (j * r + j), of_lanes(step, 0) * of_lanes(step, 0) * of_lanes(dt, 0)
            put(trial, e, of_lanes(trial, e) + grown * of_lanes(lanes.dx, places.right[j]))
        put(held, 0, 1.0)
        cholesky(trial, lanes.L, r, held)
        passed, now, top = of_lanes(held, 0), of_lanes(step, 0), of_lanes(high, 0)
        longest = where_less(0.0, passed, now, of_lanes(low, 0))
        top = where_less(0.0, passed, top, now)
        put(low, 0, longest)
        put(high, 0, top)
        between = where_less(0.0, longest, 0.5 * (longest + top), fall * top)
        put(step, 0, where_less(longest, top, between, now))
        found = True
        for w in range(LANES):
            found = found and low[w] == high[w]
        fall *= fall
        if found:
            break
    put(low, 0, BOUNDARY_SHARE * of_lanes(low, 0))
