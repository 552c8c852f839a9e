"""The inequality of the upper bound with diagonal D and G, its adjoint, and its Newton system."""

from __future__ import annotations

from workbench.compiled import unchecked_kernel
from workbench.mu.upper.lanes.algebra import fill_upper_half, hermitian_product, product
from workbench.mu.upper.lanes.simd import (
    LANES,
    TILE,
    Lane,
    set_real_product,
    set_scaled,
    take_product_left,
    take_tile_left,
)
from workbench.mu.upper.lanes.state import Lanes, Places


@unchecked_kernel
def inequality(places: Places, M: Lane, t: Lane, x: Lane, scaled: Lane, S: Lane) -> None:
    """S = t D_r - M^H D_l M - j (G M - M^H G^H) for t (LANES,); ``scaled`` receives D_l M."""
    c, r = places.c, places.r
    for i in range(c):
        set_scaled(scaled, i * r * 2, x, places.left[i], M, i * r * 2, 2 * r)
    for e in range(2 * r * r * LANES):
        S[e] = 0.0
    for i in range(0, r, TILE):
        for j in range(0, i + 1, TILE):
            if i + TILE <= r:
                take_tile_left(S, i * r + j, r, M, i, 1, r, scaled, j, 1, r, c)
            else:
                for q in range(j, min(j + TILE, r)):
                    take_product_left(S, i * r + q, 0, M, i, 0, r, scaled, q, 0, r, c)
    for i in range(r):
        start = (i * r + i) * 2 * LANES
        for w in range(LANES):
            S[start + w] += t[w] * x[places.right[i] * LANES + w]
            S[start + LANES + w] = 0.0
    for k in range(places.q):
        i, j = places.row[k], places.column[k]
        g = (places.blocks + k) * LANES
        for b in range(r):
            at = (i * r + b) * 2 * LANES
            # -j g m_b in row j, and its conjugate in column j; only the lower half is kept
            place = (max(j, b) * r + min(j, b)) * 2 * LANES
            side = 1.0 if b <= j else -1.0
            for w in range(LANES):
                S[place + w] += x[g + w] * M[at + LANES + w]
                S[place + LANES + w] -= side * x[g + w] * M[at + w]
            if b == j:
                for w in range(LANES):
                    S[place + w] += x[g + w] * M[at + LANES + w]
                    S[place + LANES + w] = 0.0
    fill_upper_half(S, r)


@unchecked_kernel
def inequality_adjoint(places: Places, M: Lane, t: Lane, X: Lane, MX: Lane, y: Lane) -> None:
    """The adjoint of `inequality` at a Hermitian X, given M X."""
    c, r = places.c, places.r
    for e in range((places.blocks + places.q) * LANES):
        y[e] = 0.0
    for j in range(r):
        at, to = (j * r + j) * 2 * LANES, places.right[j] * LANES
        for w in range(LANES):
            y[to + w] += t[w] * X[at + w]
    for i in range(c):
        to = places.left[i] * LANES
        for j in range(r):
            at = (i * r + j) * 2 * LANES
            for w in range(LANES):
                y[to + w] -= MX[at + w] * M[at + w] + MX[at + LANES + w] * M[at + LANES + w]
    for k in range(places.q):
        at = (places.row[k] * r + places.column[k]) * 2 * LANES
        to = (places.blocks + k) * LANES
        for w in range(LANES):
            y[to + w] = 2.0 * MX[at + LANES + w]


@unchecked_kernel
def add_diagonal(places: Places, X: Lane, y: Lane) -> None:
    """Add the diagonal of X (r, r) to y, block by block."""
    r = places.r
    for j in range(r):
        at, to = (j * r + j) * 2 * LANES, places.right[j] * LANES
        for w in range(LANES):
            y[to + w] += X[at + w]


@unchecked_kernel
def between_M(places: Places, M: Lane, X: Lane, MX: Lane, MXM: Lane) -> None:
    """MX = M X and MXM = M X M^H."""
    c, r = places.c, places.r
    product(M, X, MX, c, r, r)
    hermitian_product(MX, M, MXM, c, r)


@unchecked_kernel
def newton_matrix(places: Places, t: Lane, lanes: Lanes) -> None:
    """H[k, l] = Re trace(F_k S^-1 F_l Z) + (d_k^-1 w_k where k = l), F_k the derivatives of S.

    With S^-1 and Z between M and M^H in T and U; see `between_M`.
    """
    c, r, N = places.c, places.r, places.blocks
    m = N + places.q
    H, Si, Z = lanes.H, lanes.S_inverse, lanes.Z
    TM, UM, TC, UC = lanes.T_M, lanes.U_M, lanes.T_C, lanes.U_C
    for e in range(m * m * LANES):
        H[e] = 0.0
    for e in range(r * r):
        set_real_product(lanes.P_R, e, 0, Si, 2 * e, 0, 1, Z, 2 * e, 0, 1, 2)
    for e in range(c * c):
        set_real_product(lanes.P_C, e, 0, TC, 2 * e, 0, 1, UC, 2 * e, 0, 1, 2)
    for e in range(c * r):
        set_real_product(lanes.P_M, e, 0, TM, 2 * e, 0, 1, UM, 2 * e, 0, 1, 2)
    for i in range(r):
        for j in range(r):
            to, at = (places.right[i] * m + places.right[j]) * LANES, (i * r + j) * LANES
            for w in range(LANES):
                H[to + w] += t[w] * t[w] * lanes.P_R[at + w]
    for i in range(c):
        for j in range(c):
            to, at = (places.left[i] * m + places.left[j]) * LANES, (i * c + j) * LANES
            for w in range(LANES):
                H[to + w] += lanes.P_C[at + w]
        for j in range(r):
            at = (i * r + j) * LANES
            to = (places.left[i] * m + places.right[j]) * LANES
            back = (places.right[j] * m + places.left[i]) * LANES
            for w in range(LANES):
                part = t[w] * lanes.P_M[at + w]
                H[to + w] -= part
                H[back + w] -= part
    for k in range(places.q):
        _skew_row(places, t, lanes, k)
    for k in range(N):
        to = (k * m + k) * LANES
        for w in range(LANES):
            H[to + w] += lanes.W[k * LANES + w] / lanes.x[k * LANES + w]


@unchecked_kernel
def _skew_row(places: Places, t: Lane, lanes: Lanes, k: int) -> None:
    """The row of H of the k-th real scalar, to its diagonal."""
    c, r, N = places.c, places.r, places.blocks
    m, two = N + places.q, 2 * LANES
    H, Si, Z = lanes.H, lanes.S_inverse, lanes.Z
    TM, UM, TC, UC = lanes.T_M, lanes.U_M, lanes.T_C, lanes.U_C
    p, q = places.row[k], places.column[k]
    for j in range(r):  # with the part t e_j e_j^T of d
        to = ((N + k) * m + places.right[j]) * LANES
        a, b = (q * r + j) * two, (p * r + j) * two
        for w in range(LANES):
            # S^-1[j, q] is the conjugate of S^-1[q, j]
            first = Si[a + w] * UM[b + LANES + w] - Si[a + LANES + w] * UM[b + w]
            other = TM[b + w] * Z[a + LANES + w] - TM[b + LANES + w] * Z[a + w]
            H[to + w] += t[w] * (first - other)
    for i in range(c):  # with the part - m_i^H m_i of d
        to = ((N + k) * m + places.left[i]) * LANES
        a, b = (i * r + q) * two, (p * c + i) * two
        for w in range(LANES):
            first = TM[a + w] * UC[b + LANES + w] + TM[a + LANES + w] * UC[b + w]
            # T_C[i, p] is the conjugate of T_C[p, i]
            other = -TC[b + LANES + w] * UM[a + w] - TC[b + w] * UM[a + LANES + w]
            H[to + w] += other - first
    for other_ in range(k + 1):
        i, j = places.row[other_], places.column[other_]
        to = ((N + k) * m + N + other_) * LANES
        pi, qj = (p * c + i) * two, (q * r + j) * two
        pj, iq = (p * r + j) * two, (i * r + q) * two
        for w in range(LANES):
            same = TC[pi + w] * Z[qj + w] + TC[pi + LANES + w] * Z[qj + LANES + w]
            same += Si[qj + w] * UC[pi + w] + Si[qj + LANES + w] * UC[pi + LANES + w]
            cross = TM[pj + w] * UM[iq + w] - TM[pj + LANES + w] * UM[iq + LANES + w]
            cross += TM[iq + w] * UM[pj + w] - TM[iq + LANES + w] * UM[pj + LANES + w]
            H[to + w] += same - cross


@unchecked_kernel
def along_t(places: Places, t: Lane, lanes: Lanes, curvature: Lane) -> None:
    """u = F*(V) and <V, D_r> (LANES,), V being the Hermitian part of S^-1 D_r Z.

    From what `newton_matrix` leaves: V itself is not needed.
    """
    c, r, N = places.c, places.r, places.blocks
    u, x, two = lanes.u, lanes.x, 2 * LANES
    TM, UM, Si, Z = lanes.T_M, lanes.U_M, lanes.S_inverse, lanes.Z
    for e in range((N + places.q) * LANES):
        u[e] = 0.0
    for i in range(r):
        to = places.right[i] * LANES
        for j in range(r):
            at, of = (i * r + j) * LANES, places.right[j] * LANES
            for w in range(LANES):
                u[to + w] += lanes.P_R[at + w] * x[of + w]
    for w in range(LANES):
        curvature[w] = 0.0
    for k in range(N):
        for w in range(LANES):
            e = k * LANES + w
            curvature[w] += x[e] * u[e]
            u[e] *= t[w]
    for i in range(c):
        to = places.left[i] * LANES
        for j in range(r):
            at, of = (i * r + j) * LANES, places.right[j] * LANES
            for w in range(LANES):
                u[to + w] -= lanes.P_M[at + w] * x[of + w]
    for k in range(places.q):
        p, q, to = places.row[k], places.column[k], (N + k) * LANES
        for j in range(r):
            # Z[j, q] is the conjugate of Z[q, j]
            a, b, of = (p * r + j) * two, (q * r + j) * two, places.right[j] * LANES
            for w in range(LANES):
                part = TM[a + LANES + w] * Z[b + w] - TM[a + w] * Z[b + LANES + w]
                part += UM[a + LANES + w] * Si[b + w] - UM[a + w] * Si[b + LANES + w]
                u[to + w] += part * x[of + w]
