"""Edges of the box of real blocks on which M Delta has a large real eigenvalue.

det(lambda I - M Delta) is affine in a real block that is not repeated. So an edge between two
vertices has the eigenvalue lambda exactly where the determinants p and p' of its ends are of
opposite sign: Im(p conj p') = 0 and Re(p conj p') < 0. The characteristic polynomials of all
vertices thus show the real eigenvalues of all edges (R. Dailey, "A new algorithm for the real
structured singular value", ACC 1990, searches edges one by one). The interval of a repeated block
is divided, which makes the estimates approximate.
"""

from __future__ import annotations

import numpy as np

from workbench._core.compiled import unchecked_kernel
from workbench.mu.lower.rayleigh import LOOP, X
from workbench.mu.lower.realise import NO_BLOCK, set_block, set_loop

MOST_POINTS = 64
"""Largest number of vertices, with the points that divide intervals, whose edges are searched. That
is six real blocks. With half of them matrices of six blocks start from random vectors only; with
double of them seven blocks are searched, for twice the time.
"""
REPEATED_POINTS = 9
"""Number of points that divide the interval of a repeated block. Estimates between them are
interpolated to about 1 %, and an ascent follows. With half of them an edge's eigenvalue may be
missed; double leaves less of `MOST_POINTS` to others.
"""
LEVELS = 48
"""Number of levels of lambda at which determinants are computed. Two eigenvalues on one edge within
a level, 2 % of the range, hide each other. With half of them more are missed; double costs time.
"""


@unchecked_kernel
def point_count(table):  # type: ignore[no-untyped-def]
    """Number of vertices and points between them; more than MOST_POINTS means that the edges are
    too many.
    """
    count = 1
    for k in range(len(table)):
        count *= 2 if table[k, 2] == 1 else REPEATED_POINTS
        if count > MOST_POINTS:
            break
    return count


@unchecked_kernel
def set_point(table, point, skipped, share, delta):  # type: ignore[no-untyped-def]
    """Set Delta to a point of the grid, with the block ``skipped`` moved on by a share of a step.

    Returns the distance in point numbers to the neighbour along that block; 0 where the point is
    the last one along it.
    """
    stride, step = 1, 0
    for k in range(len(table)):
        count = 2 if table[k, 2] == 1 else REPEATED_POINTS
        at = point // stride % count
        value = -1.0 + 2.0 * at / (count - 1)
        if k == skipped:
            value += 2.0 * share / (count - 1)
            step = stride if at + 1 < count else 0
        set_block(delta, table, k, complex(value, 0.0))
        stride *= count
    return step


@unchecked_kernel
def set_polynomials(M, table, count, delta, polynomials, w):  # type: ignore[no-untyped-def]
    """Characteristic polynomials (count, n + 1) of M Delta at all points; highest power first.

    By the method of Faddeev and Le Verrier.
    """
    n, L = len(M), LOOP + w.shape[1]
    for point in range(count):
        set_point(table, point, NO_BLOCK, 0.0, delta)
        set_loop(M, table, delta, w)
        polynomials[point, 0] = 1.0
        for i in range(n):
            for j in range(n):
                w[L + i, j] = w[LOOP + i, j]
        for k in range(1, n + 1):
            trace = 0j
            for i in range(n):
                trace += w[L + i, i]
            polynomials[point, k] = trace * (-1.0 / k)
            if k == n:
                break
            for i in range(n):
                w[L + i, i] += polynomials[point, k]
            for j in range(n):
                for i in range(n):
                    total = 0j
                    for m in range(n):
                        total += w[LOOP + i, m] * w[L + m, j]
                    w[X, i] = total
                for i in range(n):
                    w[L + i, j] = w[X, i]


@unchecked_kernel
def set_determinants(polynomials, count, level, values):  # type: ignore[no-untyped-def]
    """Values (count,) of the polynomials at a level of lambda."""
    for point in range(count):
        total = polynomials[point, 0]
        for k in range(1, polynomials.shape[1]):
            total = total * level + polynomials[point, k]
        values[point] = total


@unchecked_kernel
def set_crossings(table, polynomials, count, least, most, values, delta, found):  # type: ignore[no-untyped-def]
    """Estimates of the largest real eigenvalues on edges, between levels of lambda.

    Sets the rows of ``found`` (R, 4): eigenvalue, number of the point, number of the block along
    which the edge runs, and the place on the edge from 0 to 1; the largest first, 0 for none.
    """
    for i in range(len(found)):
        found[i, 0] = 0.0
    for step in range(LEVELS + 1):
        level = most - (most - least) * step / LEVELS
        before, now = values[(step + 1) % 2], values[step % 2]
        set_determinants(polynomials, count, level, now)
        if step == 0:
            continue
        for point in range(count):
            p, old_p = now[point], before[point]
            for k in range(len(table)):
                further = set_point(table, point, k, 0.0, delta)
                if further == 0:
                    continue
                q, old_q = now[point + further], before[point + further]
                product, old = p * np.conj(q), old_p * np.conj(old_q)
                if product.imag * old.imag < 0:
                    share = product.imag / (product.imag - old.imag)
                    if product.real + share * (old.real - product.real) < 0:
                        size, other = abs(p), abs(q)
                        size += share * (abs(old_p) - size)
                        other += share * (abs(old_q) - other)
                        value = level + share * (most - least) / LEVELS
                        _keep(found, value, point, k, size / (size + other))


@unchecked_kernel
def _keep(found, value, point, block, place):  # type: ignore[no-untyped-def]
    """Insert a row into the list of the largest."""
    i = len(found) - 1
    if not value > found[i, 0]:
        return
    while i > 0 and value > found[i - 1, 0]:
        for k in range(4):
            found[i, k] = found[i - 1, k]
        i -= 1
    found[i, 0], found[i, 1], found[i, 2], found[i, 3] = value, point, block, place
