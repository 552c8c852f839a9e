"""Stable transfer matrices T = U L with stable inverses, which mix repeated channels.

U is upper triangular and L lower triangular, both with ones on the diagonal. Their n (n - 1) other
entries may be any stable functions; here they are sums of second-order sections,

    u(s) = c + sum (e + f s / p) / (s^2 / p^2 + 2 b s / p + 1),    p, b > 0.

Unlike the biquads of D an entry may be zero and may have any zeros, so it is a sum and no product.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench.fitting.sections import PolynomialSections
from workbench.synthesis.mu.biquads import DAMPING_RANGE, LARGEST_LOG_GAIN, FrequencyRange
from workbench.systems.realisation import Matrices, in_series, side_by_side


def beside(n: int) -> Any:
    """Rows and columns of the n (n - 1) off-diagonal entries, in their order."""
    return np.nonzero(~np.eye(n, dtype=bool))


def triangular_factors(entries: Array, n: int) -> tuple[Array, Array]:
    """U and L (F, n, n) with given entries (n (n - 1), F)."""
    T = np.zeros((entries.shape[1], n, n), complex)
    i, j = beside(n)
    T[:, i, j] = entries.T
    return np.triu(T) + np.eye(n), np.tril(T) + np.eye(n)


def change(entries: Array, n: int, by: Array) -> tuple[Array, Array]:
    """Derivatives of Re tr(by dT T^-1) by the entries, where `by` has shape (F, n, n).

    Returns T^-1 by T, which multiplies the change T^-1 dT in the trace, and the factor
    (n (n - 1), F) that multiplies the change of each entry.
    """
    U, L = triangular_factors(entries, n)
    i, j = beside(n)
    inside: Array = np.linalg.solve(U, by)
    upper = inside[:, j, i]
    inside = np.linalg.solve(L, inside @ U)
    return inside @ L, np.where(i < j, upper, inside[:, j, i]).T


def responses(x: RealArray, omega: RealArray) -> tuple[Array, Array]:
    """Entries (rows, F) at frequencies [rad/s], and their derivatives (rows, P, F) by the
    parameters.

    The parameters x have shape (rows, P). A row is c and, for each section, log p, log b, e, f. A
    row has as many parameters as a gain with the same number of biquads.
    """
    value = np.repeat(x[:, :1], len(omega), axis=1).astype(complex)
    slope = np.zeros((*x.shape, len(omega)), complex)
    slope[:, 0] = 1.0
    log_p, log_b, e, f = (x[:, first::4, None] for first in range(1, 5))
    ratio = omega * np.exp(-log_p)
    sections = PolynomialSections.at(ratio, 1.0, 2 * np.exp(log_b), 1.0)
    one = 1 / sections.values
    s = 1j * ratio * one
    parts = zip(sections.magnitude_shares, sections.phase_shares, strict=True)
    first, second = (real + 1j * imaginary for real, imaginary in parts)
    section = e * one + f * s
    value += section.sum(axis=1)
    # ds / d log p = -s
    slope[:, 1::4] = section * (first + 2 * second) - f * s
    slope[:, 2::4] = -section * first
    slope[:, 3::4], slope[:, 4::4] = one, s
    return value, slope


def parameter_bounds(size: int, within: FrequencyRange) -> list[tuple[float, float]]:
    """Limits of the parameters of a row, with corners within frequencies [rad/s]."""
    low, high = np.log(within)
    section = [
        (float(low), float(high)),
        (float(np.log(DAMPING_RANGE[0])), float(np.log(DAMPING_RANGE[1]))),
        (-LARGEST_LOG_GAIN, LARGEST_LOG_GAIN),
        (-LARGEST_LOG_GAIN, LARGEST_LOG_GAIN),
    ]
    return [(-LARGEST_LOG_GAIN, LARGEST_LOG_GAIN), *section * (size // 4)]


def systems(x: RealArray, n: int) -> tuple[Matrices, Matrices]:
    """T and its inverse, for parameters (n (n - 1), P)."""
    i, j = beside(n)
    unit: RealArray = np.eye(n)
    pair = []
    for chosen in (i < j, i > j):
        A, B, C, D = side_by_side([_entry(row) for row in x[chosen]], int(chosen.sum()))
        into, out = unit[j[chosen]], unit[:, i[chosen]]
        pair.append((A, B @ into, out @ C, out @ D @ into + unit))
    U, L = pair
    return in_series(L, U), in_series(_inverse(U), _inverse(L))


def _entry(row: RealArray) -> Matrices:
    """An entry as a system."""
    sections = row[1:].reshape(-1, 4)
    n = 2 * len(sections)
    A, B, C = np.zeros((n, n)), np.zeros((n, 1)), np.zeros((1, n))
    for k, (log_p, log_b, e, f) in enumerate(sections):
        p, at = np.exp(log_p), slice(2 * k, 2 * k + 2)
        A[at, at] = p * np.array([[0.0, 1.0], [-1.0, -2.0 * np.exp(log_b)]])
        B[2 * k + 1], C[0, at] = p, (e, f)
    direct: RealArray = row[:1, None]
    return A, B, C, direct


def _inverse(T: Matrices) -> Matrices:
    """Inverse of a system with an invertible direct term."""
    A, B, C, D = T
    back = np.asarray(np.linalg.inv(D))
    return A - B @ back @ C, B @ back, -back @ C, back
