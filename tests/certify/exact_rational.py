"""Matrices of doubles in exact rational arithmetic: the truth that the kernel's tests ask."""

import flint
import numpy as np


def rational(value):
    """A double as a fraction."""
    return flint.fmpq(*float(value).as_integer_ratio())


def real_form(matrix):
    """The real matrix [[Re, -Im], [Im, Re]] of a complex one, exact; of products, the product."""
    matrix = np.asarray(matrix, complex)
    whole = np.block([[matrix.real, -matrix.imag], [matrix.imag, matrix.real]])
    return flint.fmpq_mat(*whole.shape, [rational(x) for x in whole.ravel()])


def is_positive_definite(form):
    """Whether a symmetric matrix is positive definite, by the pivots of exact elimination."""
    rows = form.tolist()
    for k, pivot_row in enumerate(rows):
        if not pivot_row[k] > 0:
            return False
        for row in rows[k + 1 :]:
            share = row[k] / pivot_row[k]
            for j in range(k, len(rows)):
                row[j] -= share * pivot_row[j]
    return True


def largest_outside(enclosure, form):
    """How far entries of the exact matrix lie outside an enclosure, over the radius; at most 1."""
    n, m = enclosure.mid.shape
    worst = 0.0
    for i in range(n):
        for j in range(m):
            middle = complex(enclosure.mid[i, j])
            real, imag = form[i, j] - rational(middle.real), form[n + i, j] - rational(middle.imag)
            radius = rational(enclosure.rad[i, j])
            square = real * real + imag * imag
            if square > radius * radius:
                return float("inf")
            if square > 0:
                worst = max(worst, float(square.p) / float(square.q) / float(radius.p) ** 2)
    return worst
