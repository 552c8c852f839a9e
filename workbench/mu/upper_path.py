"""A primal-dual interior-point method for the generalised eigenvalue problem of the upper bound.

    minimise t  over  D > 0, G  with  S = t D_r - A(D, G) >= 0,   A = M^H D_l M + j (G M - M^H G^H)

With multipliers Z of S and W of D, the conditions are

    F*(Z) + W = nu C,   <Z, D_r> = 1,   Z S = 0,   W D = 0,

F the derivative of S by the unknowns, C the normalisation of D. Newton's method on them with
Z S = W D = mu I in the direction of Helmberg, Kojima and Monteiro, Mehrotra's predictor and
corrector, and the second-order terms of the product t D_r in the corrector. The problem is not
convex in (t, D, G) together, but quasi-convex, and S and D stay positive at every step.
"""

from __future__ import annotations

import numpy as np

from workbench.compiled import compiled
from workbench.mu.upper_linear import (
    factor,
    factor_normal,
    inner,
    inverse,
    make_hermitian,
    multiply,
    multiply_adjoint,
    solve_normal,
)
from workbench.mu.upper_pattern import Pattern, adjoint, collect, fill, read, slack

TINY = 1e-16
"""Share of the first t at which t counts as nothing: a bound of 1e-8 where 1 is usual."""
CONVEX = 1e-3
SHARE = 0.95
"""Share of the way to the boundary that a step takes."""


@compiled
def square(n: int) -> np.ndarray:
    """A square complex matrix of zeros."""
    return np.zeros((n, n), np.complex128)


@compiled
def reach(
    A: np.ndarray, first: np.ndarray, second: np.ndarray, trial: np.ndarray, L: np.ndarray
) -> float:
    """A step a <= 1 for which A + a first + a^2 second stays positive, with some way to spare."""
    low, high = 0.0, 1.0 / SHARE
    step = high
    for _ in range(60):
        for i in range(A.shape[0]):
            for j in range(i + 1):
                trial[i, j] = A[i, j] + step * (first[i, j] + step * second[i, j])
        if factor(trial, L):
            low = step
        else:
            high = step
        if low > 0.0 and high - low < 0.05 * high:
            break
        step = 0.5 * (low + high)
    return SHARE * low


@compiled
def hessian(
    pattern: Pattern, t: float, T: np.ndarray, U: np.ndarray, H: np.ndarray, value: np.ndarray
) -> None:
    """Lower half of H[k, l] = Re trace(E_k T E_l U), E_k the sparse derivatives of K."""
    for e in range(value.size):
        value[e] = pattern.fixed[e] + t * pattern.growing[e]
    first, at, to = pattern.first, pattern.at, pattern.to
    for k in range(H.shape[0]):
        for other in range(k + 1):
            total = 0.0
            for e in range(first[k], first[k + 1]):
                part = 0.0j
                for f in range(first[other], first[other + 1]):
                    part += T[to[e], at[f]] * value[f] * U[to[f], at[e]]
                total += value[e].real * part.real - value[e].imag * part.imag
            H[k, other] = total


@compiled
def add_positivity(
    pattern: Pattern, D_inverse: np.ndarray, W: np.ndarray, H: np.ndarray
) -> None:
    """Add Re trace(e_k D^-1 e_l W) to the lower half of H, e_k the basis of the compact D."""
    row, column, kind = pattern.row, pattern.column, pattern.kind
    for k in range(H.shape[0]):
        if pattern.skew[k]:
            break
        a, b = row[k], column[k]
        v = 1j if kind[k] == 2 else 1.0 + 0j
        for other in range(k + 1):
            p, q = row[other], column[other]
            w = 1j if kind[other] == 2 else 1.0 + 0j
            total = v * D_inverse[b, p] * w * W[q, a]
            if p != q:
                total += v * D_inverse[b, q] * np.conj(w) * W[p, a]
            if a != b:
                total += np.conj(v) * D_inverse[a, p] * w * W[q, b]
                if p != q:
                    total += np.conj(v) * D_inverse[a, q] * np.conj(w) * W[p, b]
            H[k, other] += total.real


@compiled
def sandwich(
    M: np.ndarray, X: np.ndarray, MX: np.ndarray, MXM: np.ndarray, T: np.ndarray
) -> None:
    """T = P X P^H with P = [M; I], for a Hermitian X; M X and M X M^H on the way."""
    c, r = M.shape
    multiply(M, X, MX)
    multiply_adjoint(MX, M, MXM)
    T[:c, :c] = MXM
    T[:c, c:] = MX
    for i in range(r):
        for j in range(c):
            T[c + i, j] = np.conj(MX[j, i])
    T[c:, c:] = X


@compiled
def multiplier_step(
    S_inverse: np.ndarray, dS: np.ndarray, Z: np.ndarray, work: np.ndarray, dZ: np.ndarray
) -> None:
    """dZ = -Z - the Hermitian part of S^-1 dS Z."""
    multiply(dS, Z, work)
    multiply(S_inverse, work, dZ)
    make_hermitian(dZ)
    for i in range(Z.shape[0]):
        for j in range(Z.shape[0]):
            dZ[i, j] = -Z[i, j] - dZ[i, j]


@compiled
def follow(
    M: np.ndarray,
    pattern: Pattern,
    t: float,
    x: np.ndarray,
    Z: np.ndarray,
    W: np.ndarray,
    accuracy: float,
    iterations: int,
) -> tuple[float, float, int]:
    """Follow the central path from a point with S > 0, D > 0, Z > 0, W > 0.

    x (m,), Z (r, r) and W (N, N) are changed in place. Stops when the duality gap is below
    ``accuracy`` times t, or t below nothing, or after so many iterations.

    Returns
    -------
    t, the duality gap relative to t, and the iterations taken.
    """
    c, r = M.shape
    size, m = pattern.size, x.size
    D, G, dD, dG = square(size), square(size), square(size), square(size)
    part, skew, D_inverse, LD = square(size), square(size), square(size), square(size)
    dW, QD, work_D, no_D = square(size), square(size), square(size), square(size)
    S, B, dS, dB, S_inverse, LS = square(r), square(r), square(r), square(r), square(r), square(r)
    V, dZ, Q, work, no_S = square(r), square(r), square(r), square(r), square(r)
    Y, MX = np.zeros((c, r), np.complex128), np.zeros((c, r), np.complex128)
    MXM, T, U = square(c), square(c + r), square(c + r)
    value = np.zeros(pattern.fixed.size, np.complex128)
    H = np.zeros((m, m))
    u, C, rhs, dx = np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m)
    other, toward_u, toward_C = np.zeros(m), np.zeros(m), np.zeros(m)

    for k in range(m):
        C[k] = 1.0 if pattern.kind[k] == 0 and not pattern.skew[k] else 0.0
    nothing, gap = TINY * t, np.inf
    for iteration in range(iterations):
        fill(pattern, x, D, G)
        slack(pattern, M, t, D, G, Y, B, S)
        if not (factor(S, LS) and factor(D, LD)):
            return t, gap, iteration
        gap = inner(S, Z) + inner(D, W)
        if t <= nothing:
            return t, 0.0, iteration
        gap /= t * inner(Z, B)
        if gap <= accuracy:
            return t, gap, iteration
        inverse(LS, work, S_inverse)
        inverse(LD, work_D, D_inverse)

        sandwich(M, S_inverse, MX, MXM, T)
        adjoint(pattern, M, t, S_inverse, MX, MXM, part, skew)
        read(pattern, part, skew, rhs)  # with D^-1, added below, the pull to the centre
        sandwich(M, Z, MX, MXM, U)
        hessian(pattern, t, T, U, H, value)
        add_positivity(pattern, D_inverse, W, H)
        factor_normal(H)

        # V = S^-1 D_r Z: how t and the unknowns act on each other through S, less what t D_r adds.
        multiply(B, Z, work)
        multiply(S_inverse, work, V)
        curvature = inner(B, V)
        make_hermitian(V)
        multiply(M, V, MX)
        multiply_adjoint(MX, M, MXM)
        adjoint(pattern, M, t, V, MX, MXM, part, skew)
        collect(pattern.right, Z, -1.0, part)
        read(pattern, part, skew, u)
        solve_normal(H, u, toward_u)
        solve_normal(H, C, toward_C)
        uu, uC, CC = np.dot(u, toward_u), np.dot(u, toward_C), np.dot(C, toward_C)

        # Predictor: the right-hand side is -1 in the equation <Z, D_r> = 1 and zero elsewhere.
        along = uC / CC if CC > 0.0 else 0.0
        schur = curvature - uu + uC * along
        if schur <= CONVEX * curvature:  # t D_r bends the other way: go by what is convex
            schur = curvature
        dt = -1.0 / schur
        nu = -dt * along
        for k in range(m):
            dx[k] = -dt * toward_u[k] - nu * toward_C[k]
        fill(pattern, dx, dD, dG)
        slack(pattern, M, t, dD, dG, Y, dB, dS)
        for i in range(r):
            for j in range(r):
                dS[i, j] += dt * B[i, j]
                Q[i, j] = dt * dB[i, j]
        multiplier_step(S_inverse, dS, Z, work, dZ)
        multiplier_step(D_inverse, dD, W, work_D, dW)
        primal = min(reach(S, dS, Q, work, LS), reach(D, dD, no_D, work_D, LD))
        dual = min(reach(Z, dZ, no_S, work, LS), reach(W, dW, no_D, work_D, LD))
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

        # Corrector: Q = S^-1 (dS dZ + dt dD_r Z), in W likewise.
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
        collect(pattern.right, dZ, -dt, part)
        read(pattern, part, skew, other)
        for k in range(m):
            rhs[k] = center * rhs[k] - other[k]
        solve_normal(H, rhs, other)
        ub, Cb = np.dot(u, other), np.dot(C, other)
        dt = (target - ub + along * Cb) / schur
        nu = (Cb / CC if CC > 0.0 else 0.0) - dt * along
        for k in range(m):
            dx[k] = other[k] - dt * toward_u[k] - nu * toward_C[k]
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
        primal = min(reach(S, dS, no_S, work, LS), reach(D, dD, no_D, work_D, LD))
        no_S[:] = 0.0
        dual = min(reach(Z, dZ, no_S, work, LS), reach(W, dW, no_D, work_D, LD))
        if t + primal * dt < -nothing:  # any t < 0 will do, and G need not grow for more
            primal = (t + nothing) / -dt
        t += primal * dt
        for k in range(m):
            x[k] += primal * dx[k]
        for i in range(r):
            for j in range(r):
                Z[i, j] += dual * dZ[i, j]
        for i in range(size):
            for j in range(size):
                W[i, j] += dual * dW[i, j]
    return t, gap, iterations
