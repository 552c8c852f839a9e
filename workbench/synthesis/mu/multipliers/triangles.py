"""Stable transfer matrices T = U L with stable inverses, which mix repeated channels.

U is upper triangular and L lower triangular, both with ones on the diagonal. Their n (n - 1) other
entries may be any stable functions; here they are sums of second-order sections,

    u(s) = c + sum (e + f s / p) / (s^2 / p^2 + 2 b s / p + 1),    p, b > 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.synthesis.mu.biquads import DAMPING_RANGE, LARGEST_LOG_GAIN, FrequencyRange


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
    for first in range(1, x.shape[1], 4):
        corner, damping = (np.exp(x[:, first + k, None]) for k in (0, 1))
        e, f = x[:, first + 2, None], x[:, first + 3, None]
        s = 1j * omega / corner
        below = 1.0 / (s**2 + 2 * damping * s + 1)
        section = (e + f * s) * below
        value += section
        # ds / d log p = -s
        slope[:, first] = -f * s * below + section * below * (2 * s**2 + 2 * damping * s)
        slope[:, first + 1] = -section * below * 2 * damping * s
        slope[:, first + 2], slope[:, first + 3] = below, s * below
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


def systems(x: RealArray, n: int) -> tuple[StateSpace, StateSpace]:
    """T and its inverse as systems, for parameters (n (n - 1), P)."""
    import control

    parts = [(i, j, _entry(row)) for i, j, row in zip(*beside(n), x, strict=True)]
    unit: RealArray = np.eye(n)
    pair = []
    for upper in (True, False):
        chosen = [part for part in parts if (part[0] < part[1]) == upper]
        out, into = unit[:, [i for i, _, _ in chosen]], unit[[j for _, j, _ in chosen]]
        pair.append(out * control.append(*(entry for _, _, entry in chosen)) * into + unit)
    U, L = pair
    return U * L, _inverse(L) * _inverse(U)


def _entry(row: RealArray) -> StateSpace:
    """An entry as a system."""
    import control

    sections = row[1:].reshape(-1, 4)
    n = 2 * len(sections)
    A, B, C = np.zeros((n, n)), np.zeros((n, 1)), np.zeros((1, n))
    for k, (log_p, log_b, e, f) in enumerate(sections):
        p, at = np.exp(log_p), slice(2 * k, 2 * k + 2)
        A[at, at] = p * np.array([[0.0, 1.0], [-1.0, -2.0 * np.exp(log_b)]])
        B[2 * k + 1], C[0, at] = p, (e, f)
    return control.StateSpace(A, B, C, [[row[0]]], remove_useless_states=False)


def _inverse(T: StateSpace) -> StateSpace:
    """Inverse of a system with an invertible direct term."""
    import control

    back = np.linalg.inv(T.D)
    A = T.A - T.B @ back @ T.C
    return control.StateSpace(A, T.B @ back, -back @ T.C, back, remove_useless_states=False)
