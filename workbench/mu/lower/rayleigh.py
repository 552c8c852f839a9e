"""Eigenpairs of M Delta that are followed while Delta moves, by two-sided Rayleigh quotients.

An eigenvalue decomposition of a small matrix takes LAPACK many times as long as one elimination,
and a search looks at thousands of Deltas. These functions follow one eigenvalue with its left and
right vectors instead: each step is one elimination with the eigenvalue as the shift, and converges
cubically (A. Ostrowski, "On the convergence of the Rayleigh quotient iteration III", 1959). They
are plain loops that write into arrays of the caller.
"""

from __future__ import annotations

import numpy as np

from workbench.compiled import unchecked_kernel

TINY_PIVOT = 1e-15
"""A pivot below this share of the largest entry is replaced by it: the shift is an eigenvalue."""


@unchecked_kernel
def square(z):  # type: ignore[no-untyped-def]
    """Squared size of a complex number, without the square root and the scaling of abs."""
    return z.real * z.real + z.imag * z.imag


@unchecked_kernel
def inner_product(a, b, start_a, start_b, count):  # type: ignore[no-untyped-def]
    """The inner product a* b of parts of two vectors."""
    total = 0j
    for i in range(count):
        total += np.conj(a[start_a + i]) * b[start_b + i]
    return total


@unchecked_kernel
def length(v, start, count):  # type: ignore[no-untyped-def]
    """Euclidean norm of a part of a vector."""
    total = 0.0
    for i in range(start, start + count):
        total += square(v[i])
    return np.sqrt(total)


@unchecked_kernel
def copy(source, target):  # type: ignore[no-untyped-def]
    """Copy a vector."""
    for i in range(len(source)):
        target[i] = source[i]


@unchecked_kernel
def factor_shifted(A, shift, L, pivots):  # type: ignore[no-untyped-def]
    """Write the factors of A - shift I to L, inverse pivots on its diagonal; rows are exchanged."""
    n = A.shape[0]
    largest = 0.0
    for i in range(n):
        for j in range(n):
            L[i, j] = A[i, j]
        L[i, i] -= shift
        for j in range(n):
            largest = max(largest, square(L[i, j]))
    least = TINY_PIVOT * np.sqrt(largest) + 1e-290
    for k in range(n):
        place, most = k, square(L[k, k])
        for i in range(k + 1, n):
            size = square(L[i, k])
            if size > most:
                place, most = i, size
        pivots[k] = place
        if place != k:
            for j in range(n):
                L[k, j], L[place, j] = L[place, j], L[k, j]
        if not most > least * least:
            L[k, k] = least
            most = least * least
        inverse = np.conj(L[k, k]) * (1.0 / most)
        L[k, k] = inverse
        for i in range(k + 1, n):
            entry = L[i, k] * inverse
            L[i, k] = entry
            for j in range(k + 1, n):
                L[i, j] -= entry * L[k, j]


@unchecked_kernel
def solve_factored(L, pivots, x):  # type: ignore[no-untyped-def]
    """Replace x by the solution of the factored system, scaled to length 1."""
    n = len(x)
    for k in range(n):
        if pivots[k] != k:
            x[k], x[pivots[k]] = x[pivots[k]], x[k]
    for i in range(n):
        total = x[i]
        for j in range(i):
            total -= L[i, j] * x[j]
        x[i] = total
    for i in range(n - 1, -1, -1):
        total = x[i]
        for j in range(i + 1, n):
            total -= L[i, j] * x[j]
        x[i] = total * L[i, i]
    normalise(x)


@unchecked_kernel
def solve_adjoint(L, pivots, y):  # type: ignore[no-untyped-def]
    """Replace y by the solution of the adjoint of the factored system, scaled to length 1."""
    n = len(y)
    for i in range(n):
        value = y[i] * np.conj(L[i, i])
        y[i] = value
        for j in range(i + 1, n):
            y[j] -= np.conj(L[i, j]) * value
    for i in range(n - 1, -1, -1):
        value = y[i]
        for j in range(i):
            y[j] -= np.conj(L[i, j]) * value
    for k in range(n - 1, -1, -1):
        if pivots[k] != k:
            y[k], y[pivots[k]] = y[pivots[k]], y[k]
    normalise(y)


@unchecked_kernel
def normalise(x):  # type: ignore[no-untyped-def]
    """Scale a vector to length 1; NaN for a vector that is zero or not finite."""
    largest = 0.0
    for i in range(len(x)):
        largest = max(largest, abs(x[i].real), abs(x[i].imag))
    scale = 1.0 / largest
    total = 0.0
    for i in range(len(x)):
        x[i] *= scale
        total += square(x[i])
    scale = 1.0 / np.sqrt(total)
    for i in range(len(x)):
        x[i] *= scale


@unchecked_kernel
def rayleigh_step(A, shift, L, pivots, x, y):  # type: ignore[no-untyped-def]
    """Improve the eigenvectors x, y of A at an estimate of the eigenvalue, and return the new one.

    NaN where the vectors have become orthogonal, as those of a defective eigenvalue are.
    """
    n = A.shape[0]
    factor_shifted(A, shift, L, pivots)
    solve_factored(L, pivots, x)
    solve_adjoint(L, pivots, y)
    over, under = 0j, 0j
    for i in range(n):
        total = 0j
        for j in range(n):
            total += A[i, j] * x[j]
        over += np.conj(y[i]) * total
        under += np.conj(y[i]) * x[i]
    size = square(under)
    if not size > 1e-26:
        return complex(np.nan, np.nan)
    return over * np.conj(under) / size
