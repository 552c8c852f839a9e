"""Small dense matrices in lanes: products, Cholesky factors, inverses, solutions.

Matrices are flat arrays of lanes, entry (i, j) of n columns at number i n + j; see
`workbench._core.machine_code.sums`.
"""

from __future__ import annotations

import numpy as np

from workbench._core.compiled import unchecked_kernel
from workbench._core.machine_code.sums import (
    TILE,
    Lane,
    add_product_right,
    add_tile_right,
    set_negative_scaled,
    set_product,
    set_product_left,
    set_product_right,
    set_scaled,
    set_tile,
    set_tile_left,
    set_tile_right,
    take_product_right,
    take_real_product,
    take_real_tile,
    take_tile_right,
)
from workbench._core.machine_code.values import of_lanes, put, square_root, where_less
from workbench.mu.upper.linear_algebra import UNSEEN_PIVOT


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
def product_of_half(A: Lane, B: Lane, C: Lane, rows: int, n: int) -> None:
    """C = A B for a lower triangle B (n, n), with zeros stored directly above its diagonal."""
    for i in range(0, rows, TILE):
        for j in range(0, n, TILE):
            if i + TILE <= rows and j + TILE <= n:
                a, b = i * n + j, j * n + j
                set_tile(C, i * n + j, n, A, a, n, 1, B, b, 1, n, n - j)
            else:
                for p in range(i, min(i + TILE, rows)):
                    for q in range(j, min(j + TILE, n)):
                        c = p * n + q
                        set_product(C, c, 0, A, c, 0, 1, B, q * n + q, 0, n, n - q)


@unchecked_kernel
def hermitian_product(A: Lane, B: Lane, C: Lane, rows: int, inner: int) -> None:
    """C = A B^H for A and B (rows, inner) whose product is Hermitian."""
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
            e, back = 2 * (i * n + j), 2 * (j * n + i)
            put(C, back, of_lanes(C, e))
            put(C, back + 1, -1.0 * of_lanes(C, e + 1))


@unchecked_kernel
def cholesky(A: Lane, L: Lane, n: int, held: Lane) -> None:
    """L = the lower Cholesky factor of A; ``held`` (LANES,) becomes 0 where A is not > 0.

    The imaginary parts of the diagonal hold the reciprocals of the pivots.
    """
    for i in range(0, n, TILE):
        for j in range(0, i + 1, TILE):
            if i + TILE <= n:
                for p in range(i, i + TILE):
                    for e in range(2 * (p * n + j), 2 * (p * n + j + TILE)):
                        put(L, e, of_lanes(A, e))
                take_tile_right(L, i * n + j, n, L, i * n, n, 1, L, j * n, n, 1, j)
                first, other = 2 * (j * n + j), 2 * (j * n + n + j)
                if j == i:
                    _set_pivot(L, first, held)
                    _divide(L, other, L, first)
                    square = of_lanes(L, other) * of_lanes(L, other)
                    square += of_lanes(L, other + 1) * of_lanes(L, other + 1)
                    put(L, other + 2, of_lanes(L, other + 2) - square)
                    _set_pivot(L, other + 2, held)
                else:
                    for e in range(2 * (i * n + j), 2 * (i * n + 2 * n + j), 2 * n):
                        _divide(L, e, L, first)
                        x, y, u = of_lanes(L, e), of_lanes(L, e + 1), of_lanes(L, other)
                        v = of_lanes(L, other + 1)
                        put(L, e + 2, of_lanes(L, e + 2) - x * u - y * v)
                        put(L, e + 3, of_lanes(L, e + 3) - y * u + x * v)
                        _divide(L, e + 2, L, other + 2)
            else:
                for q in range(j, min(j + TILE, n)):
                    e = 2 * (i * n + q)
                    put(L, e, of_lanes(A, e))
                    put(L, e + 1, of_lanes(A, e + 1))
                    take_product_right(L, i * n + q, 0, L, i * n, 0, 1, L, q * n, 0, 1, q)
                    if q < i:
                        _divide(L, e, L, 2 * (q * n + q))
                    else:
                        _set_pivot(L, e, held)


@unchecked_kernel
def _divide(X: Lane, e: int, L: Lane, pivot: int) -> None:
    """Divide a complex entry by a pivot; the pivot's imaginary part holds its reciprocal."""
    share = of_lanes(L, pivot + 1)
    put(X, e, of_lanes(X, e) * share)
    put(X, e + 1, of_lanes(X, e + 1) * share)


@unchecked_kernel
def _set_pivot(L: Lane, e: int, held: Lane) -> None:
    """Replace a square by its root and that root's reciprocal, 1 where it is not positive."""
    square = of_lanes(L, e)
    finite = where_less(square, np.inf, of_lanes(held, 0), 0.0)
    put(held, 0, where_less(0.0, square, finite, 0.0))
    root = square_root(where_less(0.0, square, where_less(square, np.inf, square, 1.0), 1.0))
    put(L, e, root)
    put(L, e + 1, 1.0 / root)


@unchecked_kernel
def inverse_of_factored(L: Lane, work: Lane, X: Lane, n: int) -> None:
    """X = (L L^H)^-1 from the result of `cholesky`; ``work`` receives L^-1.

    Zeros of L^-1 are stored directly above its diagonal only.
    """
    for j in range(n):
        for i in range(max(j - 1, 0), n):
            e = 2 * (i * n + j)
            if i < j:
                put(work, e, 0.0)
                put(work, e + 1, 0.0)
            elif i == j:
                put(work, e, of_lanes(L, e + 1))
                put(work, e + 1, 0.0)
            else:
                set_product(work, i * n + j, 0, L, i * n + j, 0, 1, work, j * n + j, 0, n, i - j)
                set_negative_scaled(work, e, L, 2 * (i * n + i) + 1, work, e, 2)
    for i in range(0, n, TILE):
        for j in range(0, i + 1, TILE):
            e, a, b = i * n + j, i * n + i, i * n + j
            if i + TILE <= n:
                set_tile_left(X, e, n, work, a, 1, n, work, b, 1, n, n - i)
            else:
                for q in range(j, min(j + TILE, n)):
                    set_product_left(X, i * n + q, 0, work, a, 0, n, work, i * n + q, 0, n, n - i)
    fill_upper_half(X, n)


@unchecked_kernel
def real_cholesky(H: Lane, pivots: Lane, m: int) -> None:
    """Replace the lower half of a real H >= 0 by its Cholesky factor; ``pivots`` are reciprocals.

    An unknown that has no influence on H gets a nearly infinite pivot, so that a solution leaves
    it unchanged.
    """
    for i in range(m):
        put(pivots, i, 1e-14 * of_lanes(H, i * m + i))
    for i in range(0, m, TILE):
        for j in range(0, i + 1, TILE):
            height, done = min(TILE, m - i), 0
            if height == TILE:
                done = j
                take_real_tile(H, i * m + j, m, H, i * m, m, 1, H, j * m, m, 1, j)
            for p in range(i, i + height):
                for q in range(j, min(j + TILE, p + 1)):
                    e = p * m + q
                    a, b = p * m + done, q * m + done
                    take_real_product(H, e, 0, H, a, 0, 1, H, b, 0, 1, q - done)
                    if q < p:
                        put(H, e, of_lanes(H, e) * of_lanes(pivots, q))
                    else:
                        square = of_lanes(H, e)
                        seen = where_less(of_lanes(pivots, p), square, square, UNSEEN_PIVOT**2)
                        root = square_root(seen)
                        put(H, e, root)
                        put(pivots, p, 1.0 / root)


@unchecked_kernel
def real_cholesky_solve(L: Lane, pivots: Lane, b: Lane, x: Lane, m: int) -> None:
    """Solve L L^T x = b."""
    for i in range(m):
        put(x, i, of_lanes(b, i))
        take_real_product(x, i, 0, L, i * m, 0, 1, x, 0, 0, 1, i)
        set_scaled(x, i, pivots, i, x, i, 1)
    for i in range(m - 1, -1, -1):
        take_real_product(x, i, 0, L, (i + 1) * m + i, 0, m, x, i + 1, 0, 1, m - 1 - i)
        set_scaled(x, i, pivots, i, x, i, 1)
