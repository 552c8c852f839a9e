"""A primal-dual interior-point method for the generalised eigenvalue problem of the upper bound.

    minimise t  over  D > 0, G  with  S = t D_r - A(D, G) >= 0,   A = M^H D_l M + j (G M - M^H G^H)

With multipliers Z of S and W of D, and F the derivative of S with respect to the unknowns x, the
optimality conditions are

    F*(Z) + W = rho b,   b = F_t*(Z),   <Z, D_r> = 1,   Z S = 0,   W D = 0.

x and all its multiples prove the same t, so every step may satisfy <Z, D_r(dx)> = <b, dx> = 0. This
condition removes the only term that is not convex, the product t D_r. Its multiplier rho takes the
place of the term, and t - rho is the value of the dual problem. The method is Newton's for Z S = W
D = mu I in the direction of Helmberg, Kojima and Monteiro, with Mehrotra's predictor and corrector;
the corrector includes the second order of t D_r. S and D stay positive definite at every step.
"""

from __future__ import annotations

import numpy as np

from workbench._core.compiled import unchecked, unchecked_kernel
from workbench.mu.upper.linear_algebra import (
    copy,
    factor,
    factor_normal,
    inner,
    inverse_from_factor,
    make_hermitian,
    multiply,
    multiply_adjoint,
    solve_normal,
)
from workbench.mu.upper.newton import (
    add_positivity,
    hessian,
    multiplier_step,
    reach,
    sandwich,
)
from workbench.mu.upper.path_state import Direction, NewtonSystem, Point, Scratch, path_state
from workbench.mu.upper.pattern import Pattern, adjoint, basis_products, collect, fill, slack

NEGLIGIBLE_T = 1e-16
"""t below this share of its first value counts as zero; this is a bound of 1e-8 where 1 is usual.
Rounding of t is as large. Half or double changes nothing but for a bound of 0.
"""
LARGEST_FALL = 1.5
"""Largest share of t by which one step may lower t; a t below 0 is no better than 0. With half of
it, below 1, paths may take more iterations; double changes little, since t = 0 ends the path.
"""
LOST_STEP, RECOVERY_RISE, RECOVERIES = 0.1, 1.2, 12
"""A step shorter than the first number means that the path is lost: t is multiplied by the second
number and the path starts again, at most as often as the third number says. Twelve rises together
raise t by a factor of nine. Half or double changes how soon a path is given up, and which bound
remains; each is proven.
"""
PREDICTOR_BLUR, CORRECTOR_BLUR = 0.3, 0.05
"""Relative accuracy of the step lengths of the predictor and of the corrector. The predictor only
tells how far to aim, and the corrector goes there. Half or double: more trials, or shorter steps.
"""
STEP_HALVINGS = 20
"""Largest number of halvings of a step until S and D are positive definite after it. They leave
1e-6 of a step; then rounding decides, and the path is lost. Half or double changes how soon that is
told.
"""
EARLY_GAP = 0.1
"""Relative duality gap at which a point is kept as the start for the next matrix. It is near enough
to be of use and central enough to start from. With half of it starts are nearer to the border, and
fail more often; double saves fewer iterations.
"""


@unchecked
def follow(
    M: np.ndarray,
    pattern: Pattern,
    t: float,
    x: np.ndarray,
    early: np.ndarray,
    accuracy: float,
    iterations: int,
    enough: float = 0.0,
) -> tuple[float, float, int]:
    """Follow the central path from a point with S > 0 and D > 0; x (m,) is changed in place.

    The path ends when the duality gap and the remaining fall of t are below ``accuracy`` times t,
    when t is negligible or ``enough``, or after ``iterations`` iterations. If t is at most
    ``enough``, the gap is 0. ``early`` (m,) receives the unknowns of a point well before the end,
    which is a good start for a neighbouring M.

    Returns
    -------
    t of the early point (0 without one), the duality gap relative to t, and the iterations made.
    """
    point, step, system, scratch = path_state(M, pattern, x.size)
    nothing, gap = NEGLIGIBLE_T * t, np.inf
    lost, recoveries, early_t = True, RECOVERIES, 0.0
    if not _move_to(M, pattern, t, x, point, scratch):
        return 0.0, gap, 0
    for iteration in range(iterations):
        inverse_from_factor(point.LS, scratch.work, point.S_inverse)
        inverse_from_factor(point.LD, scratch.work_D, point.D_inverse)
        if lost:
            _centre(point)
        inside = inner(point.S, point.Z) + inner(point.D, point.W)
        gap = inside / (t * inner(point.Z, point.B))
        if early_t == 0.0 and gap <= EARLY_GAP and iteration > 0:
            early_t = t
            copy(x, early)

        along, bb, schur = _newton_system(M, pattern, t, point, system, scratch)
        dt = max(-1.0 / schur, -LARGEST_FALL * t)
        if gap <= accuracy and -dt <= accuracy * t:
            return early_t, gap, iteration
        rho = -dt * along
        center = _predict(M, pattern, t, dt, rho, point, step, system, scratch)
        dt, primal, dual = _correct(
            M, pattern, t, dt, rho, center, (along, bb, schur), point, step, system, scratch
        )

        if t + primal * dt < -nothing:  # any t < 0 suffices, and G need not grow further
            primal = (t + nothing) / -dt
        for _ in range(STEP_HALVINGS):  # S is not linear in the step, and is rounded
            for k in range(x.size):
                system.other[k] = x[k] + primal * step.dx[k]
            ahead = t + primal * dt
            if _move_to(M, pattern, ahead, system.other, point, scratch):
                break
            primal *= 0.5
        else:
            return early_t, gap, iteration
        t = ahead
        copy(system.other, x)
        if t <= max(nothing, enough):
            return early_t, 0.0, iteration + 1
        _add(point.Z, dual, step.dZ)
        _add(point.W, dual, step.dW)
        lost = min(primal, dual) < LOST_STEP and recoveries > 0
        if lost:
            recoveries -= 1
            t *= RECOVERY_RISE
            slack(pattern.left, pattern.right, M, t, point.D, point.G, scratch.Y, point.B, point.S)
            factor(point.S, point.LS)
    return early_t, gap, iterations


@unchecked_kernel
def _move_to(
    M: np.ndarray, pattern: Pattern, t: float, x: np.ndarray, point: Point, scratch: Scratch
) -> bool:
    """Set D, G, B = D_r, S and factors of S and D from the unknowns; False if S or D is not > 0."""
    fill(pattern, x, point.D, point.G)
    slack(pattern.left, pattern.right, M, t, point.D, point.G, scratch.Y, point.B, point.S)
    return factor(point.S, point.LS) and factor(point.D, point.LD)


@unchecked_kernel
def _centre(point: Point) -> None:
    """Set the multipliers as if the point lay on the central path: Z = mu S^-1, W = mu D^-1, <Z,
    D_r> = 1.
    """
    mu = 1.0 / inner(point.S_inverse, point.B)
    for i in range(point.Z.shape[0]):
        for j in range(point.Z.shape[0]):
            point.Z[i, j] = mu * point.S_inverse[i, j]
    for i in range(point.W.shape[0]):
        for j in range(point.W.shape[0]):
            point.W[i, j] = mu * point.D_inverse[i, j]


@unchecked_kernel
def _add(X: np.ndarray, share: float, dX: np.ndarray) -> None:
    """X + share dX, written to X."""
    for i in range(X.shape[0]):
        for j in range(X.shape[0]):
            X[i, j] += share * dX[i, j]


@unchecked
def _newton_system(
    M: np.ndarray,
    pattern: Pattern,
    t: float,
    point: Point,
    system: NewtonSystem,
    scratch: Scratch,
) -> tuple[float, float, float]:
    """The equations of a Newton step, factored: H, u = F*(V), b, and H^-1 u and H^-1 b.

    ``system.pull`` receives F*(S^-1), without D^-1: half of the pull to the centre. Returns
    <u, H^-1 b> / <b, H^-1 b>, <b, H^-1 b> and the Schur complement of t.
    """
    sandwich(M, point.S_inverse, scratch.MX, scratch.MXM, scratch.T)
    adjoint(pattern, M, t, point.S_inverse, scratch.MX, scratch.MXM, scratch.part, scratch.skew)
    basis_products(pattern, scratch.part, scratch.skew, system.pull)
    sandwich(M, point.Z, scratch.MX, scratch.MXM, scratch.U)
    hessian(pattern, t, scratch.T, scratch.U, system.H, scratch.value)
    add_positivity(pattern, point.D_inverse, point.W, system.H)
    factor_normal(system.H)

    # V = S^-1 D_r Z: the interaction of t and the unknowns through S.
    multiply(point.B, point.Z, scratch.work)
    multiply(point.S_inverse, scratch.work, scratch.V)
    curvature = inner(point.B, scratch.V)
    make_hermitian(scratch.V)
    multiply(M, scratch.V, scratch.MX)
    multiply_adjoint(scratch.MX, M, scratch.MXM)
    adjoint(pattern, M, t, scratch.V, scratch.MX, scratch.MXM, scratch.part, scratch.skew)
    basis_products(pattern, scratch.part, scratch.skew, system.u)
    scratch.part[:] = 0.0
    collect(pattern.right, point.Z, 1.0, scratch.part)
    basis_products(pattern, scratch.part, scratch.no_D, system.b)
    solve_normal(system.H, system.u, system.toward_u)
    solve_normal(system.H, system.b, system.toward_b)
    bb = np.dot(system.b, system.toward_b)
    along = np.dot(system.u, system.toward_b) / bb if bb > 0.0 else 0.0
    schur = curvature - np.dot(system.u, system.toward_u) + along**2 * bb
    return along, bb, max(schur, 1e-14 * curvature)


@unchecked_kernel
def _predict(
    M: np.ndarray,
    pattern: Pattern,
    t: float,
    dt: float,
    rho: float,
    point: Point,
    step: Direction,
    system: NewtonSystem,
    scratch: Scratch,
) -> float:
    """The predictor: -1 in the equation <Z, D_r> = 1 and zero elsewhere on the right-hand side.

    ``scratch.Q`` receives the second order of S. Returns how far from the boundary the corrector
    should aim: the size of the products Z S and W D there.
    """
    for k in range(step.dx.size):
        step.dx[k] = -dt * system.toward_u[k] - rho * system.toward_b[k]
    _direction(M, pattern, t, dt, point, step, scratch.Q, scratch)
    S, D, Z, W = point.S, point.D, point.Z, point.W
    dS, dD, dZ, dW = step.dS, step.dD, step.dZ, step.dW
    work, work_D, no_S, no_D = scratch.work, scratch.work_D, scratch.no_S, scratch.no_D
    Q, LS, LD = scratch.Q, point.LS, point.LD
    primal = min(
        reach(S, dS, Q, work, LS, PREDICTOR_BLUR), reach(D, dD, no_D, work_D, LD, PREDICTOR_BLUR)
    )
    dual = min(
        reach(Z, dZ, no_S, work, LS, PREDICTOR_BLUR), reach(W, dW, no_D, work_D, LD, PREDICTOR_BLUR)
    )
    now, ahead = inner(S, Z) + inner(D, W), 0.0
    for i in range(S.shape[0]):
        for j in range(S.shape[0]):
            s = S[i, j] + primal * (dS[i, j] + primal * Q[i, j])
            z = Z[i, j] + dual * dZ[i, j]
            ahead += s.real * z.real + s.imag * z.imag
    for i in range(D.shape[0]):
        for j in range(D.shape[0]):
            d = D[i, j] + primal * dD[i, j]
            w = W[i, j] + dual * dW[i, j]
            ahead += d.real * w.real + d.imag * w.imag
    return max(min(ahead / now, 1.0), 0.0) ** 3 * now / (S.shape[0] + D.shape[0])


@unchecked_kernel
def _direction(
    M: np.ndarray,
    pattern: Pattern,
    t: float,
    dt: float,
    point: Point,
    step: Direction,
    second: np.ndarray,
    scratch: Scratch,
) -> None:
    """Change of D, G, S and, to first order, of Z and W by dt and the unknowns' step.

    ``second`` receives the second order of S, dt dD_r.
    """
    fill(pattern, step.dx, step.dD, step.dG)
    slack(pattern.left, pattern.right, M, t, step.dD, step.dG, scratch.Y, step.dB, step.dS)
    for i in range(point.S.shape[0]):
        for j in range(point.S.shape[0]):
            step.dS[i, j] += dt * point.B[i, j]
            second[i, j] = dt * step.dB[i, j]
    multiplier_step(point.S_inverse, step.dS, point.Z, scratch.work, step.dZ)
    multiplier_step(point.D_inverse, step.dD, point.W, scratch.work_D, step.dW)


@unchecked_kernel
def _correct(
    M: np.ndarray,
    pattern: Pattern,
    t: float,
    dt: float,
    rho: float,
    center: float,
    schur_system: tuple[float, float, float],
    point: Point,
    step: Direction,
    system: NewtonSystem,
    scratch: Scratch,
) -> tuple[float, float, float]:
    """The corrector; returns dt and the lengths of the primal and the dual step."""
    along, bb, schur = schur_system
    S, D, Z, W = point.S, point.D, point.Z, point.W
    dS, dD, dZ, dW = step.dS, step.dD, step.dZ, step.dW
    V, Q, QD, work, work_D = scratch.V, scratch.Q, scratch.QD, scratch.work, scratch.work_D
    # Q = S^-1 (dS dZ + dt dD_r Z), and likewise for W.
    multiply(Q, Z, V)
    multiply(dS, dZ, work)
    for i in range(S.shape[0]):
        for j in range(S.shape[0]):
            work[i, j] += V[i, j]
    multiply(point.S_inverse, work, Q)
    make_hermitian(Q)
    multiply(dD, dW, work_D)
    multiply(point.D_inverse, work_D, QD)
    make_hermitian(QD)
    target = center * inner(point.S_inverse, point.B) - inner(Q, point.B)
    target = target + inner(dZ, step.dB) - 1.0
    multiply(M, Q, scratch.MX)
    multiply_adjoint(scratch.MX, M, scratch.MXM)
    adjoint(pattern, M, t, Q, scratch.MX, scratch.MXM, scratch.part, scratch.skew)
    for i in range(D.shape[0]):
        for j in range(D.shape[0]):
            scratch.part[i, j] += QD[i, j] - center * point.D_inverse[i, j]
    collect(pattern.right, dZ, rho, scratch.part)
    basis_products(pattern, scratch.part, scratch.skew, system.other)
    for k in range(step.dx.size):
        system.pull[k] = center * system.pull[k] - system.other[k]
    solve_normal(system.H, system.pull, system.other)
    level = np.dot(system.b, system.other)
    dt = max((target - np.dot(system.u, system.other) + along * level) / schur, -LARGEST_FALL * t)
    rho = (level / bb if bb > 0.0 else 0.0) - dt * along
    for k in range(step.dx.size):
        step.dx[k] = system.other[k] - dt * system.toward_u[k] - rho * system.toward_b[k]
    no_S, no_D, LS, LD = scratch.no_S, scratch.no_D, point.LS, point.LD
    _direction(M, pattern, t, dt, point, step, no_S, scratch)
    for i in range(S.shape[0]):
        for j in range(S.shape[0]):
            dZ[i, j] += center * point.S_inverse[i, j] - Q[i, j]
    for i in range(D.shape[0]):
        for j in range(D.shape[0]):
            dW[i, j] += center * point.D_inverse[i, j] - QD[i, j]
    primal = min(
        reach(S, dS, no_S, work, LS, CORRECTOR_BLUR), reach(D, dD, no_D, work_D, LD, CORRECTOR_BLUR)
    )
    no_S[:] = 0.0
    dual = min(
        reach(Z, dZ, no_S, work, LS, CORRECTOR_BLUR), reach(W, dW, no_D, work_D, LD, CORRECTOR_BLUR)
    )
    return dt, primal, dual
