"""Invariant zeros on the imaginary axis, computed in units that suit each state and channel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workbench._core.arrays import EPS, ComplexArray, RealArray
from workbench.systems.balancing import balancing
from workbench.systems.hidden_states import ZERO_ROUNDING

AXIS_TOLERANCE = 1e-11
"""A system matrix whose least singular value, in balanced units, is at most this counts as
singular.
"""
NEAR_AXIS = 0.1
"""Modes whose distance from the axis is below this share of their size start a search for a
zero.
"""
NEGLIGIBLE_SHARE = 1e-6
"""Components of a zero's direction below this size, in balanced units, count as zero."""
REFINED_BELOW = 1e-2
"""Newton steps towards a zero are made while the least singular value, in balanced units, is below
this.
"""
REFINEMENTS = 3
"""Number of Newton steps from the computed frequency of a mode to that of a zero."""


class AxisZero(NamedTuple):
    """A zero j omega; its ``outputs`` (k, n) of the states show the motion that z does not show.

    Each output is as large as the terms of z that cancel at the zero. If z has no such terms, it is
    as large as the largest entry of C, or 1.
    """

    omega: float
    outputs: RealArray


def axis_zeros(A: RealArray, B: RealArray, C: RealArray, D: RealArray) -> list[AxisZero]:
    """Invariant zeros of a system on the imaginary axis, at frequencies of at least 0.

    A zero is a frequency at which the system matrix [[A - j omega, B], [C, D]] loses rank. Rows and
    columns of this matrix have no common unit, so it is balanced at each frequency. So the result
    does not depend on the units of time, states and signals, nor on modes being slow or fast.

    Parameters
    ----------
    A, B, C, D
        Realisation with balanced states, D^T D = 1.
    """
    n = len(A)
    system = np.block([[_without_rounding(A, A.ravel()), B], [_without_rounding(C, C), D]])
    # With D^T D = 1 the zeros are the modes of A - B D^T C that are unobservable through (1 - D
    # D^T) C.
    modes = np.linalg.eigvals(A - B @ D.T @ C).astype(complex)
    near = modes[(modes.imag > 0.0) & (abs(modes.real) <= NEAR_AXIS * abs(modes))]
    found: list[AxisZero] = []
    for start in (0.0, *near.imag):  # rounding moves the modes of a multiple zero at 0 far from 0
        omega, directions = _null_space(system, n, float(start))
        if len(directions) and not any(np.isclose(omega, each.omega, atol=0.0) for each in found):
            found.append(AxisZero(omega, _showing_outputs(system, n, directions)))
    return found


def _without_rounding(M: RealArray, among: RealArray) -> RealArray:
    """M without entries that are rounding errors, relative to the largest entry of each row of
    `among`.
    """
    largest = abs(among).max(axis=-1, initial=0.0, keepdims=True)
    return np.where(abs(M) > ZERO_ROUNDING * EPS * largest, M, 0.0)


def _null_space(system: RealArray, n: int, omega: float) -> tuple[float, ComplexArray]:
    """The frequency of a zero near omega, and a basis (k, n + m) of the system matrix's null space.

    The basis is empty if there is no zero. Each vector has norm 1 in balanced units.
    """
    for _ in range(1 + REFINEMENTS):
        pencil = system.astype(complex)
        pencil[range(n), range(n)] -= 1j * omega
        rows, columns = balancing(pencil, 0)
        U, values, Vh = np.linalg.svd(rows[:, None] * pencil * columns, full_matrices=False)
        small = values <= AXIS_TOLERANCE
        if small.any():
            kept = np.where(abs(Vh[small]) > NEGLIGIBLE_SHARE, Vh[small].conj(), 0.0)
            return abs(omega), kept * columns
        left, right = U[:n, -1] * rows[:n], Vh[-1, :n].conj() * columns[:n]
        turn = 1j * np.vdot(left, right)  # derivative of the singular value by the frequency
        if turn == 0.0 or values[-1] > REFINED_BELOW:
            break
        omega += float((values[-1] / turn).real)
    return omega, np.zeros((0, len(system.T)), complex)


def _showing_outputs(system: RealArray, n: int, directions: ComplexArray) -> RealArray:
    """Outputs (k, n) that show the states along the directions (k, n + m) of a zero."""
    C = system[n:, :n]
    alone = float(abs(C).max(initial=0.0)) or 1.0
    outputs = []
    for direction in directions:
        x = direction[:n]
        terms = float((abs(system[n:]) @ abs(direction)).max(initial=0.0))
        row = x.conj() / np.vdot(x, x).real * (terms or alone * abs(x).max())
        outputs += [part for part in (row.real, row.imag) if part.any()]
    return np.array(outputs).reshape(-1, n)
