"""A primal-dual interior-point method for the generalised eigenvalue problem of the upper bound.

    minimise t  over  D > 0, G  with  S = t D_r - A(D, G) >= 0,   A = M^H D_l M + j (G M - M^H G^H)

With multipliers Z of S and W of D, and F the derivative of S by the unknowns x, the conditions are

    F*(Z) + W = rho b,   b = F_t*(Z),   <Z, D_r> = 1,   Z S = 0,   W D = 0.

x and all its multiples prove the same t, so every step may satisfy <Z, D_r(dx)> = <b, dx> = 0.
This condition removes the only term that is not convex, that of the product t D_r. Its multiplier
rho takes the place of the term, and t - rho is the value of the dual problem. The method is
Newton's for Z S = W D = mu I in the direction of Helmberg, Kojima and Monteiro, with Mehrotra's
predictor and corrector; the corrector includes the second order of t D_r. S and D stay positive
definite at every step.
"""

from __future__ import annotations

import numpy as np

from workbench.compiled import compiled
from workbench.mu.upper.linear_algebra import (
    factor,
    factor_normal,
    inner,
    inverse,
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
    square,
)
from workbench.mu.upper.pattern import Pattern, adjoint, collect, fill, read, slack

NEGLIGIBLE_T = 1e-16
"""t below this share of its first value counts as zero: a bound of 1e-8 where 1 is usual."""
LARGEST_FALL = 1.5
"""Largest share of t by which one step may lower t; a t below 0 is no better than 0."""
LOST_STEP, RECOVERY_RISE, RECOVERIES = 0.1, 1.2, 12
"""A step shorter than the first number means that the path is lost: t is multiplied by the second
number and the path starts again, at most as often as the third number says."""
PREDICTOR_BLUR, CORRECTOR_BLUR = 0.3, 0.05
"""Relative accuracy of the step lengths of the predictor and of the corrector."""
STEP_HALVINGS = 20
"""Most halvings of a step until S and D are positive definite after it."""
EARLY_GAP = 0.1
"""Relative duality gap at which a point is kept as the start for the next matrix."""


@compiled
def follow(
    M: np.ndarray,
    pattern: Pattern,
    t: float,
    x: np.ndarray,
    early: np.ndarray,
    accuracy: float,
    iterations: int,
) -> tuple[float, float, int]:
    """Follow the central path from a point with S > 0 and D > 0; x (m,) is changed in place.

    The path ends when the duality gap and the remaining fall of t are below ``accuracy`` times t,
    when t is negligible, or after ``iterations`` iterations. ``early`` (m,) receives the unknowns
    of a point well before the end, which is a good start for a neighbouring M.

    Returns
    -------
    t of the early point (0 without one), the duality gap relative to t, and the iterations made.
    """
    c, r = M.shape
    size, m = pattern.size, x.size
    D, G, dD, dG = square(size), square(size), square(size), square(size)
    part, skew, D_inverse, LD = square(size), square(size), square(size), square(size)
    W, dW, QD, work_D, no_D = square(size), square(size), square(size), square(size), square(size)
    S, B, dS, dB, S_inverse, LS = square(r), square(r), square(r), square(r), square(r), square(r)
    V, Z, dZ, Q, work, no_S = square(r), square(r), square(r), square(r), square(r), square(r)
    Y, MX = np.zeros((c, r), np.complex128), np.zeros((c, r), np.complex128)
    MXM, T, U = square(c), square(c + r), square(c + r)
    value = np.zeros(pattern.fixed.size, np.complex128)
    H = np.zeros((m, m))
    u, b, rhs, dx = np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m)
    other, toward_u, toward_b = np.zeros(m), np.zeros(m), np.zeros(m)

    nothing, gap = NEGLIGIBLE_T * t, np.inf
    lost, recoveries, early_t = True, RECOVERIES, 0.0
    fill(pattern, x, D, G)
    slack(pattern, M, t, D, G, Y, B, S)
    if not (factor(S, LS) and factor(D, LD)):
        return 0.0, gap, 0
    for iteration in range(iterations):
        inverse(LS, work, S_inverse)
        inverse(LD, work_D, D_inverse)
        if lost:  # set the multipliers as on the central path
            mu = 1.0 / inner(S_inverse, B)
            for i in range(r):
                for j in range(r):
                    Z[i, j] = mu * S_inverse[i, j]
            for i in range(size):
                for j in range(size):
                    W[i, j] = mu * D_inverse[i, j]
        gap = (inner(S, Z) + inner(D, W)) / (t * inner(Z, B))
        if early_t == 0.0 and gap <= EARLY_GAP and iteration > 0:
            early_t = t
            early[:] = x

        sandwich(M, S_inverse, MX, MXM, T)
        adjoint(pattern, M, t, S_inverse, MX, MXM, part, skew)
        read(pattern, part, skew, rhs)  # with D^-1, added below, the centring direction
        sandwich(M, Z, MX, MXM, U)
        hessian(pattern, t, T, U, H, value)
        add_positivity(pattern, D_inverse, W, H)
        factor_normal(H)

        # V = S^-1 D_r Z couples t and the unknowns through S.
        multiply(B, Z, work)
        multiply(S_inverse, work, V)
        curvature = inner(B, V)
        make_hermitian(V)
        multiply(M, V, MX)
        multiply_adjoint(MX, M, MXM)
        adjoint(pattern, M, t, V, MX, MXM, part, skew)
        read(pattern, part, skew, u)
        part[:] = 0.0
        collect(pattern.right, Z, 1.0, part)
        read(pattern, part, no_D, b)
        solve_normal(H, u, toward_u)
        solve_normal(H, b, toward_b)
        bb = np.dot(b, toward_b)
        along = np.dot(u, toward_b) / bb if bb > 0.0 else 0.0
        schur = max(curvature - np.dot(u, toward_u) + along**2 * bb, 1e-14 * curvature)

        # Predictor: the right-hand side is -1 in the equation <Z, D_r> = 1 and zero elsewhere.
        dt = max(-1.0 / schur, -LARGEST_FALL * t)
        rho = -dt * along
        if gap <= accuracy and -dt <= accuracy * t:
            return early_t, gap, iteration
        for k in range(m):
            dx[k] = -dt * toward_u[k] - rho * toward_b[k]
        fill(pattern, dx, dD, dG)
        slack(pattern, M, t, dD, dG, Y, dB, dS)
        for i in range(r):
            for j in range(r):
                dS[i, j] += dt * B[i, j]
                Q[i, j] = dt * dB[i, j]
        multiplier_step(S_inverse, dS, Z, work, dZ)
        multiplier_step(D_inverse, dD, W, work_D, dW)
        primal = min(
            reach(S, dS, Q, work, LS, PREDICTOR_BLUR),
            reach(D, dD, no_D, work_D, LD, PREDICTOR_BLUR),
        )
        dual = min(
            reach(Z, dZ, no_S, work, LS, PREDICTOR_BLUR),
            reach(W, dW, no_D, work_D, LD, PREDICTOR_BLUR),
        )
        now, ahead = inner(S, Z) + inner(D, W), 0.0
        for i in range(r):
            for j in range(r):
                s = S[i, j] + primal * (dS[i, j] + primal * Q[i, j])
                z = Z[i, j] + dual * dZ[i, j]
                ahead += s.real * z.real + s.imag * z.imag
        for i in range(size):
            for j in range(size):
                d = D[i, j] + primal * dD[i, j]
                w = W[i, j] + dual * dW[i, j]
                ahead += d.real * w.real + d.imag * w.imag
        center = max(min(ahead / now, 1.0), 0.0) ** 3 * now / (r + size)

        # Corrector: Q = S^-1 (dS dZ + dt dD_r Z), and the same for W.
        multiply(Q, Z, V)
        multiply(dS, dZ, work)
        for i in range(r):
            for j in range(r):
                work[i, j] += V[i, j]
        multiply(S_inverse, work, Q)
        make_hermitian(Q)
        multiply(dD, dW, work_D)
        multiply(D_inverse, work_D, QD)
        make_hermitian(QD)
        target = center * inner(S_inverse, B) - inner(Q, B) + inner(dZ, dB) - 1.0
        multiply(M, Q, MX)
        multiply_adjoint(MX, M, MXM)
        adjoint(pattern, M, t, Q, MX, MXM, part, skew)
        for i in range(size):
            for j in range(size):
                part[i, j] += QD[i, j] - center * D_inverse[i, j]
        collect(pattern.right, dZ, rho, part)
        read(pattern, part, skew, other)
        for k in range(m):
            rhs[k] = center * rhs[k] - other[k]
        solve_normal(H, rhs, other)
        level = np.dot(b, other)
        dt = max((target - np.dot(u, other) + along * level) / schur, -LARGEST_FALL * t)
        rho = (level / bb if bb > 0.0 else 0.0) - dt * along
        for k in range(m):
            dx[k] = other[k] - dt * toward_u[k] - rho * toward_b[k]
        fill(pattern, dx, dD, dG)
        slack(pattern, M, t, dD, dG, Y, dB, dS)
        for i in range(r):
            for j in range(r):
                dS[i, j] += dt * B[i, j]
                no_S[i, j] = dt * dB[i, j]
        multiplier_step(S_inverse, dS, Z, work, dZ)
        multiplier_step(D_inverse, dD, W, work_D, dW)
        for i in range(r):
            for j in range(r):
                dZ[i, j] += center * S_inverse[i, j] - Q[i, j]
        for i in range(size):
            for j in range(size):
                dW[i, j] += center * D_inverse[i, j] - QD[i, j]
        primal = min(
            reach(S, dS, no_S, work, LS, CORRECTOR_BLUR),
            reach(D, dD, no_D, work_D, LD, CORRECTOR_BLUR),
        )
        no_S[:] = 0.0
        dual = min(
            reach(Z, dZ, no_S, work, LS, CORRECTOR_BLUR),
            reach(W, dW, no_D, work_D, LD, CORRECTOR_BLUR),
        )
        if t + primal * dt < -nothing:  # any t < 0 is enough; G need not grow further
            primal = (t + nothing) / -dt
        for _ in range(STEP_HALVINGS):  # S is not linear in the step, and has rounding errors
            for k in range(m):
                other[k] = x[k] + primal * dx[k]
            ahead = t + primal * dt
            fill(pattern, other, D, G)
            slack(pattern, M, ahead, D, G, Y, B, S)
            if factor(S, LS) and factor(D, LD):
                break
            primal *= 0.5
        else:
            return early_t, gap, iteration
        t = ahead
        x[:] = other
        if t <= nothing:
            return early_t, 0.0, iteration + 1
        for i in range(r):
            for j in range(r):
                Z[i, j] += dual * dZ[i, j]
        for i in range(size):
            for j in range(size):
                W[i, j] += dual * dW[i, j]
        lost = min(primal, dual) < LOST_STEP and recoveries > 0
        if lost:
            recoveries -= 1
            t *= RECOVERY_RISE
            slack(pattern, M, t, D, G, Y, B, S)
            factor(S, LS)
    return early_t, gap, iterations
