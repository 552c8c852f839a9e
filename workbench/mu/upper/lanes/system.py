"""The inequality of the upper bound with diagonal D and G, its adjoint, and its Newton system."""

from __future__ import annotations

from workbench._core.compiled import unchecked_kernel
from workbench._core.machine_code.sums import (
    TILE,
    Lane,
    set_real_product,
    set_scaled,
    take_product_left,
    take_tile_left,
)
from workbench._core.machine_code.values import Values, of_lanes, put
from workbench.mu.upper.lanes.algebra import fill_upper_half, hermitian_product, product
from workbench.mu.upper.lanes.state import Lanes, Places


@unchecked_kernel
def inequality(places: Places, M: Lane, t: Lane, x: Lane, scaled: Lane, S: Lane) -> None:
    """S = t D_r - M^H D_l M - j (G M - M^H G^H) for t (LANES,); ``scaled`` receives D_l M."""
    c, r = places.c, places.r
    for i in range(c):
        set_scaled(scaled, i * r * 2, x, places.left[i], M, i * r * 2, 2 * r)
    for e in range(2 * r * r):
        put(S, e, 0.0)
    for i in range(0, r, TILE):
        for j in range(0, i + 1, TILE):
            if i + TILE <= r:
                take_tile_left(S, i * r + j, r, M, i, 1, r, scaled, j, 1, r, c)
            else:
                for q in range(j, min(j + TILE, r)):
                    take_product_left(S, i * r + q, 0, M, i, 0, r, scaled, q, 0, r, c)
    for i in range(r):
        e = 2 * (i * r + i)
        put(S, e, of_lanes(S, e) + of_lanes(t, 0) * of_lanes(x, places.right[i]))
        put(S, e + 1, 0.0)
    for k in range(places.q):
        i, j = places.row[k], places.column[k]
        g = of_lanes(x, places.blocks + k)
        for b in range(r):
            # -j g m_b in row j, and its conjugate in column j; only the lower half is kept
            at, e = 2 * (i * r + b), 2 * (max(j, b) * r + min(j, b))
            side = 1.0 if b < j else -1.0
            put(S, e, of_lanes(S, e) + g * of_lanes(M, at + 1))
            put(S, e + 1, of_lanes(S, e + 1) - side * g * of_lanes(M, at))
        e, at = 2 * (j * r + j), 2 * (i * r + j)
        put(S, e, of_lanes(S, e) + g * of_lanes(M, at + 1))
        put(S, e + 1, 0.0)
    fill_upper_half(S, r)


@unchecked_kernel
def inequality_adjoint(places: Places, M: Lane, t: Lane, X: Lane, MX: Lane, y: Lane) -> None:
    """The adjoint of `inequality` at a Hermitian X, given M X."""
    add_adjoint(places, M, t, X, MX, y)
    for k in range(places.q):
        at = 2 * (places.row[k] * places.r + places.column[k])
        put(y, places.blocks + k, 2.0 * of_lanes(MX, at + 1))


@unchecked_kernel
def half_adjoint(places: Places, M: Lane, t: Lane, X: Lane, MX: Lane, y: Lane) -> None:
    """The adjoint of `inequality` at X + X^H for a lower triangle X, given M X."""
    r = places.r
    add_adjoint(places, M, t, X, MX, y)
    for k in range(places.blocks):
        put(y, k, 2.0 * of_lanes(y, k))
    for k in range(places.q):
        p, q = places.row[k], places.column[k]
        part = of_lanes(MX, 2 * (p * r + q) + 1)
        for j in range(q + 1):
            a, b = 2 * (p * r + j), 2 * (q * r + j)  # M X^H, whose X^H has conjugates of row q
            part += of_lanes(M, a + 1) * of_lanes(X, b) - of_lanes(M, a) * of_lanes(X, b + 1)
        put(y, places.blocks + k, 2.0 * part)


@unchecked_kernel
def add_adjoint(places: Places, M: Lane, t: Lane, X: Lane, MX: Lane, y: Lane) -> None:
    """The part of the adjoint for D: t X_r less the real diagonal of M X M^H, block by block."""
    c, r = places.c, places.r
    for k in range(places.blocks):
        put(y, k, 0.0)
    for j in range(r):
        to = places.right[j]
        put(y, to, of_lanes(y, to) + of_lanes(t, 0) * of_lanes(X, 2 * (j * r + j)))
    for i in range(c):
        total = of_lanes(y, places.left[i])
        for e in range(2 * i * r, 2 * (i + 1) * r):
            total -= of_lanes(MX, e) * of_lanes(M, e)
        put(y, places.left[i], total)


@unchecked_kernel
def add_diagonal(places: Places, X: Lane, y: Lane) -> None:
    """Add the diagonal of X (r, r) to y, block by block."""
    for j in range(places.r):
        to = places.right[j]
        put(y, to, of_lanes(y, to) + of_lanes(X, 2 * (j * places.r + j)))


@unchecked_kernel
def between_M(places: Places, M: Lane, X: Lane, MX: Lane, MXM: Lane) -> None:
    """MX = M X and MXM = M X M^H."""
    c, r = places.c, places.r
    product(M, X, MX, c, r, r)
    hermitian_product(MX, M, MXM, c, r)


@unchecked_kernel
def newton_matrix(places: Places, t: Lane, lanes: Lanes) -> None:
    """H[k, l] = Re trace(F_k S^-1 F_l Z) + (d_k^-1 w_k where k = l), F_k the derivatives of S.

    T and U hold S^-1 and Z between M and M^H; see `between_M`. Only the lower half is set.
    """
    c, r, N = places.c, places.r, places.blocks
    m = N + places.q
    H, left, right = lanes.H, places.left, places.right
    for i in range(m):
        for e in range(i * m, i * m + i + 1):
            put(H, e, 0.0)
    for e in range(r * r):
        put(lanes.P_R, e, _both(lanes.S_inverse, lanes.Z, e))
    for e in range(c * c):
        put(lanes.P_C, e, _both(lanes.T_C, lanes.U_C, e))
    for e in range(c * r):
        put(lanes.P_M, e, _both(lanes.T_M, lanes.U_M, e))
    grown = of_lanes(t, 0)
    for i in range(r):
        for j in range(r):
            if right[j] <= right[i]:
                to = right[i] * m + right[j]
                part = grown * grown * of_lanes(lanes.P_R, i * r + j)
                put(H, to, of_lanes(H, to) + part)
    for i in range(c):
        for j in range(c):
            if left[j] <= left[i]:
                to = left[i] * m + left[j]
                put(H, to, of_lanes(H, to) + of_lanes(lanes.P_C, i * c + j))
        for j in range(r):
            to = max(left[i], right[j]) * m + min(left[i], right[j])
            part = grown * of_lanes(lanes.P_M, i * r + j)
            if left[i] == right[j]:
                part = 2.0 * part
            put(H, to, of_lanes(H, to) - part)
    for k in range(places.q):
        _skew_row(places, t, lanes, k)
    for k in range(N):
        to = k * m + k
        put(H, to, of_lanes(H, to) + of_lanes(lanes.W, k) / of_lanes(lanes.x, k))


@unchecked_kernel
def _both(A: Lane, B: Lane, e: int) -> Values:
    """The real part of A[e] conj(B[e])."""
    return of_lanes(A, 2 * e) * of_lanes(B, 2 * e) + of_lanes(A, 2 * e + 1) * of_lanes(B, 2 * e + 1)


@unchecked_kernel
def _skew_row(places: Places, t: Lane, lanes: Lanes, k: int) -> None:
    """The row of H that belongs to the k-th real scalar, up to its diagonal."""
    c, r, N = places.c, places.r, places.blocks
    m, grown = N + places.q, of_lanes(t, 0)
    H, Si, Z = lanes.H, lanes.S_inverse, lanes.Z
    TM, UM, TC, UC = lanes.T_M, lanes.U_M, lanes.T_C, lanes.U_C
    p, q, row = places.row[k], places.column[k], (N + k) * m
    for j in range(r):  # times the part t e_j e_j^T of d; S^-1[j, q] is the conjugate of S^-1[q, j]
        to, a, b = row + places.right[j], 2 * (q * r + j), 2 * (p * r + j)
        part = of_lanes(Si, a) * of_lanes(UM, b + 1) - of_lanes(Si, a + 1) * of_lanes(UM, b)
        part += of_lanes(TM, b + 1) * of_lanes(Z, a) - of_lanes(TM, b) * of_lanes(Z, a + 1)
        put(H, to, of_lanes(H, to) + grown * part)
    for i in range(c):  # times the part - m_i^H m_i of d; T_C[i, p] is the conjugate of T_C[p, i]
        to, a, b = row + places.left[i], 2 * (i * r + q), 2 * (p * c + i)
        part = of_lanes(TM, a) * of_lanes(UC, b + 1) + of_lanes(TM, a + 1) * of_lanes(UC, b)
        part += of_lanes(TC, b + 1) * of_lanes(UM, a) + of_lanes(TC, b) * of_lanes(UM, a + 1)
        put(H, to, of_lanes(H, to) - part)
    for other in range(k + 1):
        i, j = places.row[other], places.column[other]
        pi, qj, pj, iq = 2 * (p * c + i), 2 * (q * r + j), 2 * (p * r + j), 2 * (i * r + q)
        part = of_lanes(TC, pi) * of_lanes(Z, qj) + of_lanes(TC, pi + 1) * of_lanes(Z, qj + 1)
        part += of_lanes(Si, qj) * of_lanes(UC, pi) + of_lanes(Si, qj + 1) * of_lanes(UC, pi + 1)
        part -= of_lanes(TM, pj) * of_lanes(UM, iq) - of_lanes(TM, pj + 1) * of_lanes(UM, iq + 1)
        part -= of_lanes(TM, iq) * of_lanes(UM, pj) - of_lanes(TM, iq + 1) * of_lanes(UM, pj + 1)
        put(H, row + N + other, part)


@unchecked_kernel
def newton_column(places: Places, t: Lane, lanes: Lanes, d: Lane, u: Lane, inside: Lane) -> None:
    """u = F*(V) and <V, D_r> (LANES,) of V, the Hermitian part of S^-1 E Z, E the D_r of d (N,).

    From what `newton_matrix` leaves: V itself is not needed.
    """
    c, r, N = places.c, places.r, places.blocks
    TM, UM, Si, Z = lanes.T_M, lanes.U_M, lanes.S_inverse, lanes.Z
    for k in range(N):
        put(u, k, 0.0)
    for i in range(r):
        total = of_lanes(u, places.right[i])
        for j in range(r):
            total += of_lanes(lanes.P_R, i * r + j) * of_lanes(d, places.right[j])
        put(u, places.right[i], total)
    set_real_product(inside, 0, 0, lanes.x, 0, 0, 1, u, 0, 0, 1, N)
    for k in range(N):
        put(u, k, of_lanes(u, k) * of_lanes(t, 0))
    for i in range(c):
        total = of_lanes(u, places.left[i])
        for j in range(r):
            total -= of_lanes(lanes.P_M, i * r + j) * of_lanes(d, places.right[j])
        put(u, places.left[i], total)
    for k in range(places.q):
        p, q = places.row[k], places.column[k]
        total = 0.0 * of_lanes(t, 0)
        for j in range(r):  # Z[j, q] is the conjugate of Z[q, j]
            a, b = 2 * (p * r + j), 2 * (q * r + j)
            part = of_lanes(TM, a + 1) * of_lanes(Z, b) - of_lanes(TM, a) * of_lanes(Z, b + 1)
            part += of_lanes(UM, a + 1) * of_lanes(Si, b) - of_lanes(UM, a) * of_lanes(Si, b + 1)
            total += part * of_lanes(d, places.right[j])
        put(u, N + k, total)
