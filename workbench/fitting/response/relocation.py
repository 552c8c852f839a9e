"""The compiled part of a relocation of poles: small least-squares problems of many rows."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import EPS, ComplexArray, RealArray
from workbench._core.compiled import compiled, unchecked

LEAST_CONSTANT = 1e-8
"""Smallest size of the constant of a new denominator, relative to the present one."""


@unchecked
def denominator_matrix(
    columns: RealArray, sums: RealArray, weight: float, total: float, upper: ComplexArray
) -> RealArray:
    """Matrix (k, k) whose eigenvalues are the zeros of the denominator of least error.

    Parameters
    ----------
    columns
        Errors (N, k + 1) caused by each of its coefficients: those of the partial fractions, and
        the constant.
    sums, weight, total
        Sums (k + 1,) of the values of these functions, the wanted total of their combination, and
        the weight of this equation.
    upper
        Present poles, real ones and then those of each pair with positive imaginary part.
    """
    rows, count = columns.shape[0], columns.shape[1] - 1
    table = np.zeros((count + 2, rows + 1))
    for j in range(count + 1):
        # the constant is the last column that may be left without a coefficient
        k = j + 1 if j < count else 0
        for i in range(rows):
            table[k, i] = columns[i, j]
        table[k, rows] = weight * sums[j]
    table[count + 1, rows] = weight * total
    share = nearest_coefficients(table)
    constant = share[0]
    if np.abs(constant) < LEAST_CONSTANT:
        constant = np.copysign(LEAST_CONSTANT, constant)
    matrix = np.zeros((count, count))
    at = 0
    for pole in upper:
        entry = 1.0 if pole.imag == 0 else 2.0
        for j in range(count):
            matrix[at, j] = -entry * share[j + 1] / constant
        matrix[at, at] += pole.real
        if pole.imag != 0:
            matrix[at, at + 1] += pole.imag
            matrix[at + 1, at] -= pole.imag
            matrix[at + 1, at + 1] += pole.real
            at += 1
        at += 1
    return matrix


@compiled
def nearest_coefficients(table: RealArray) -> RealArray:
    """Coefficients (n,) with which n columns come nearest to another one.

    ``table`` (n + 1, N) holds the columns and then the other one, each as a row; it is overwritten.
    Columns are orthogonalised one after the other by the modified Gram-Schmidt method, which is as
    accurate as Householder's here (Bjorck, BIT 7, 1967). A column that depends on the columns
    before it gets the coefficient 0.
    """
    count, rows = table.shape[0] - 1, table.shape[1]
    size, triangle = np.ones(count), np.zeros((count, count + 1))
    for j in range(count):
        square = 0.0
        for i in range(rows):
            square += table[j, i] ** 2
        if square > 0.0:
            size[j] = np.sqrt(square)
        for i in range(rows):
            table[j, i] /= size[j]
    for j in range(count):
        square = 0.0
        for i in range(rows):
            square += table[j, i] ** 2
        if square <= (EPS * rows) ** 2:
            continue
        triangle[j, j] = np.sqrt(square)
        for i in range(rows):
            table[j, i] /= triangle[j, j]
        for k in range(j + 1, count + 1):
            shared = 0.0
            for i in range(rows):
                shared += table[j, i] * table[k, i]
            triangle[j, k] = shared
            for i in range(rows):
                table[k, i] -= shared * table[j, i]
    found = np.zeros(count)
    for j in range(count - 1, -1, -1):
        if triangle[j, j] > 0.0:
            left = triangle[j, count]
            for k in range(j + 1, count):
                left -= triangle[j, k] * found[k]
            found[j] = left / triangle[j, j]
    return found / size
