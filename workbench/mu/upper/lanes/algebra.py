"""Small dense matrices in lanes: products, Cholesky factors, inverses, solutions.

Matrices are flat arrays of lanes (see `workbench.mu.upper.lanes.simd`), entry (i, j) of n columns
at number i n + j.
"""

from __future__ import annotations

import numpy as np

from workbench.compiled import unchecked_kernel
from workbench.mu.upper.lanes.simd import (
    LANES,
    TILE,
    Lane,
    add_product_right,
    add_tile_right,
    set_conjugate,
    set_entry,
    set_negative_scaled,
    set_product,
    set_product_left,
    set_product_right,
    set_scaled,
    set_tile,
    set_tile_right,
    take_product_right,
    take_real_product,
)

UNSEEN_PIVOT = 1e100
"""Pivot used for an unknown without influence on H; its step then becomes zero."""


@unchecked_kernel
def product(A: Lane, B: Lane, C: Lane, rows: int, inner: int, columns: int) -> None:
    """C = A B."""
    for i in range(0, rows, TILE):
        for j in range(0, columns, TILE):
            if i + TILE <= rows and j + TILE <= columns:
                c = i * columns + j
                set_tile(C, c, columns, A, i * inner, inner, 1, B, j, 1, columns, inner)
            else:
                for p in range(i, min(i + TILE, rows)):
                    for q in range(j, min(j + TILE, columns)):
                        c = p * columns + q
                        set_product(C, c, 0, A, p * inner, 0, 1, B, q, 0, columns, inner)


@unchecked_kernel
def hermitian_product(A: Lane, B: Lane, C: Lane, rows: int, inner: int) -> None:
    """C = A B^H where that is Hermitian, of A and B (rows, inner)."""
    for i in range(0, rows, TILE):
        for j in range(0, i + 1, TILE):
            if i + TILE <= rows:
                a, b = i * inner, j * inner
                set_tile_right(C, i * rows + j, rows, A, a, inner, 1, B, b, inner, 1, inner)
            else:
                for q in range(j, min(j + TILE, rows)):
                    a, b = i * inner, q * inner
                    set_product_right(C, i * rows + q, 0, A, a, 0, 1, B, b, 0, 1, inner)
    fill_upper_half(C, rows)


@unchecked_kernel
def twice_hermitian_part(X: Lane, Z: Lane, C: Lane, n: int) -> None:
    """C = X Z + (X Z)^H for a Hermitian Z."""
    for i in range(0, n, TILE):
        for j in range(0, i + 1, TILE):
            a, b = i * n, j * n
            if i + TILE <= n:
                set_tile_right(C, a + j, n, X, a, n, 1, Z, b, n, 1, n)
                add_tile_right(C, a + j, n, Z, a, n, 1, X, b, n, 1, n)
            else:
                for q in range(j, min(j + TILE, n)):
                    b = q * n
                    set_product_right(C, a + q, 0, X, a, 0, 1, Z, b, 0, 1, n)
                    add_product_right(C, a + q, 0, Z, a, 0, 1, X, b, 0, 1, n)
    fill_upper_half(C, n)


@unchecked_kernel
def fill_upper_half(C: Lane, n: int) -> None:
    """Fill the upper half of a Hermitian C."""
    for i in range(n):
        for j in range(i):
            set_conjugate(C, j * n + i, C, i * n + j)


@unchecked_kernel
def cholesky(A: Lane, L: Lane, n: int, held: Lane) -> None:
    """L = the lower Cholesky factor of A; ``held`` (LANES,) becomes 0 where A is not > 0."""
    for i in range(n):
        for j in range(i + 1):
            e = i * n + j
            set_entry(L, e, A, e)
            take_product_right(L, e, 0, L, i * n, 0, 1, L, j * n, 0, 1, j)
            if j < i:
                set_scaled(L, 2 * e, L, 2 * (j * n + j) + 1, L, 2 * e, 2)
            else:  # the imaginary part of the diagonal holds the reciprocal of the pivot
                start = e * 2 * LANES
                for w in range(LANES):
                    square = L[start + w]
                    if not 0.0 < square < np.inf:
                        held[w] = 0
                        square = 1.0
                    root = np.sqrt(square)
                    L[start + w] = root
                    L[start + LANES + w] = 1.0 / root


@unchecked_kernel
def inverse_of_factored(L: Lane, work: Lane, X: Lane, n: int) -> None:
    """X = (L L^H)^-1 from what `cholesky` leaves; ``work`` receives the lower half of L^-1."""
    for j in range(n):
        for i in range(j, n):
            e, pivot = (i * n + j) * 2 * LANES, (i * n + i) * 2 * LANES + LANES
            if i == j:
                for w in range(LANES):
                    work[e + w] = L[pivot + w]
                    work[e + LANES + w] = 0.0
            else:
                set_product(work, i * n + j, 0, L, i * n + j, 0, 1, work, j * n + j, 0, n, i - j)
                set_negative_scaled(
                    work, 2 * (i * n + j), L, 2 * (i * n + i) + 1, work, 2 * (i * n + j), 2
                )
    for i in range(n):
        for j in range(i + 1):
            set_product_left(X, i * n + j, 0, work, i * n + i, 0, n, work, i * n + j, 0, n, n - i)
    fill_upper_half(X, n)


@unchecked_kernel
def real_cholesky(H: Lane, pivots: Lane, m: int) -> None:
    """Replace the lower half of a real H >= 0 by its Cholesky factor; ``pivots`` are reciprocals.

    An unknown that has no influence on H gets a nearly infinite pivot, so that a solution leaves
    it unchanged.
    """
    for i in range(m):
        own = (i * m + i) * LANES
        for w in range(LANES):
            pivots[i * LANES + w] = 1e-14 * H[own + w]
        for j in range(i + 1):
            take_real_product(H, i * m + j, 0, H, i * m, 0, 1, H, j * m, 0, 1, j)
            if j < i:
                set_scaled(H, i * m + j, pivots, j, H, i * m + j, 1)
        for w in range(LANES):
            square = H[own + w]
            root = np.sqrt(square) if square > pivots[i * LANES + w] else UNSEEN_PIVOT
            H[own + w] = root
            pivots[i * LANES + w] = 1.0 / root


@unchecked_kernel
def real_cholesky_solve(L: Lane, pivots: Lane, b: Lane, x: Lane, m: int) -> None:
    """Solve L L^T x = b."""
    for i in range(m):
        for w in range(LANES):
            x[i * LANES + w] = b[i * LANES + w]
        take_real_product(x, i, 0, L, i * m, 0, 1, x, 0, 0, 1, i)
        set_scaled(x, i, pivots, i, x, i, 1)
    for i in range(m - 1, -1, -1):
        take_real_product(x, i, 0, L, (i + 1) * m + i, 0, m, x, i + 1, 0, 1, m - 1 - i)
        set_scaled(x, i, pivots, i, x, i, 1)
