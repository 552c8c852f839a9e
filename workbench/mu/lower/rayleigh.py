"""Eigenpairs of M Delta that are followed while Delta moves, by two-sided Rayleigh quotients.

An eigenvalue decomposition of a small matrix takes LAPACK many times as long as one elimination,
and a search looks at thousands of Deltas. These functions follow one eigenvalue with its left and
right vectors instead: each step is one elimination with the eigenvalue as the shift, and converges
cubically (A. Ostrowski, "On the convergence of the Rayleigh quotient iteration III", 1959).

All vectors and matrices of a search are rows of one complex array, the workspace ``w``, because a
call of compiled code takes the longer the more arrays it is given. X, Y and so on number its rows.
"""

from __future__ import annotations

import numpy as np

from workbench._core.compiled import unchecked_kernel

# NumPy integers: Numba would compile a function once more for each Python integer that it is given.
X, Y, Q = np.arange(3)
"""Rows of the right and left eigenvectors of M Delta, and of the eigenvalue's sensitivity q."""
KEPT, BEST = np.array([3, 5])
"""First of two rows each: the eigenvectors to return to, and the eigenvectors of the best Delta."""
EFFECTS, EXCHANGES = np.array([7, 8])
"""Rows of the effects q* x of blocks, and of the row exchanges of the elimination."""
B, U = np.array([9, 10])
"""Rows of the two vectors of Delta's outputs in a power iteration."""
LOOP = np.int64(11)
"""First row of M Delta. Its factors follow, and then a trial Delta."""
TINY_PIVOT = 1e-15
"""A pivot below this share of the largest entry is replaced by that value: the shift is an
eigenvalue then. It is four roundings: then the pivot is rounding. Half or double changes the size
of a vector that is normalised afterwards.
"""


@unchecked_kernel
def squared_size(z):  # type: ignore[no-untyped-def]
    """Squared size of a complex number, without the square root and the scaling of abs."""
    return z.real * z.real + z.imag * z.imag


@unchecked_kernel
def inner_product(w, a, start_a, b, start_b, count):  # type: ignore[no-untyped-def]
    """The inner product a* b of parts of two rows."""
    total = 0j
    for i in range(count):
        total += np.conj(w[a, start_a + i]) * w[b, start_b + i]
    return total


@unchecked_kernel
def part_length(w, row, start, count):  # type: ignore[no-untyped-def]
    """Euclidean norm of a part of a row."""
    total = 0.0
    for i in range(start, start + count):
        total += squared_size(w[row, i])
    return np.sqrt(total)


@unchecked_kernel
def copy_pair(w, source, target):  # type: ignore[no-untyped-def]
    """Copy two rows."""
    for i in range(w.shape[1]):
        w[target, i] = w[source, i]
        w[target + 1, i] = w[source + 1, i]


@unchecked_kernel
def _factor(w, n, shift):  # type: ignore[no-untyped-def]
    """Factor M Delta - shift I with row exchanges; the diagonal holds inverse pivots."""
    L, largest = LOOP + w.shape[1], 0.0
    for i in range(n):
        for j in range(n):
            entry = w[LOOP + i, j] - (shift if i == j else 0j)
            w[L + i, j] = entry
            largest = max(largest, squared_size(entry))
    least = TINY_PIVOT * np.sqrt(largest) + 1e-140
    for k in range(n):
        place, most = k, squared_size(w[L + k, k])
        for i in range(k + 1, n):
            size = squared_size(w[L + i, k])
            if size > most:
                place, most = i, size
        w[EXCHANGES, k] = complex(place, 0.0)
        if place != k:
            for j in range(n):
                w[L + k, j], w[L + place, j] = w[L + place, j], w[L + k, j]
        pivot = w[L + k, k]
        if not most > least * least:
            pivot, most = complex(least, 0.0), least * least
        inverse = np.conj(pivot) * (1.0 / most)
        w[L + k, k] = inverse
        for i in range(k + 1, n):
            entry = w[L + i, k] * inverse
            w[L + i, k] = entry
            for j in range(k + 1, n):
                w[L + i, j] -= entry * w[L + k, j]


@unchecked_kernel
def _solve(w, n):  # type: ignore[no-untyped-def]
    """Solve the factored system for x and its adjoint for y, both scaled to length 1."""
    L = LOOP + w.shape[1]
    for k in range(n):
        place = int(w[EXCHANGES, k].real)
        w[X, k], w[X, place] = w[X, place], w[X, k]
    for i in range(n):
        total = w[X, i]
        for j in range(i):
            total -= w[L + i, j] * w[X, j]
        w[X, i] = total
        value = w[Y, i] * np.conj(w[L + i, i])
        w[Y, i] = value
        for j in range(i + 1, n):
            w[Y, j] -= np.conj(w[L + i, j]) * value
    for i in range(n - 1, -1, -1):
        total = w[X, i]
        for j in range(i + 1, n):
            total -= w[L + i, j] * w[X, j]
        w[X, i] = total * w[L + i, i]
        value = w[Y, i]
        for j in range(i):
            w[Y, j] -= np.conj(w[L + i, j]) * value
    for k in range(n - 1, -1, -1):
        place = int(w[EXCHANGES, k].real)
        w[Y, k], w[Y, place] = w[Y, place], w[Y, k]
    for row in range(2):
        largest, total = 0.0, 0.0
        for i in range(n):
            largest = max(largest, abs(w[row, i].real), abs(w[row, i].imag))
        scale = 1.0 / largest
        for i in range(n):
            w[row, i] *= scale
            total += squared_size(w[row, i])
        scale = 1.0 / np.sqrt(total)
        for i in range(n):
            w[row, i] *= scale


@unchecked_kernel
def rayleigh_step(w, n, shift):  # type: ignore[no-untyped-def]
    """Improve the eigenvectors of M Delta (n, n) at an estimate of the eigenvalue; return the new
    eigenvalue.

    NaN if the left and right vectors have become orthogonal, as those of a defective eigenvalue
    are.
    """
    _factor(w, n, shift)
    _solve(w, n)
    over, under = 0j, 0j
    for i in range(n):
        total = 0j
        for j in range(n):
            total += w[LOOP + i, j] * w[X, j]
        over += np.conj(w[Y, i]) * total
        under += np.conj(w[Y, i]) * w[X, i]
    size = squared_size(under)
    if not size > 1e-26:
        return complex(np.nan, np.nan)
    return over * np.conj(under) * (1.0 / size)
