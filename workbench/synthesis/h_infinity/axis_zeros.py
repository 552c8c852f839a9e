"""Invariant zeros on the imaginary axis, judged in units that suit each state and channel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workbench._core.arrays import EPS, ComplexArray, RealArray
from workbench.systems.balancing import balancing
from workbench.systems.hidden_states import ZERO_ROUNDING

AXIS_TOLERANCE = 1e-11
"""Smallest singular value, in balanced units, up to which a system matrix counts as singular."""
NEAR_AXIS = 0.1
"""Share of its size by which a mode may lie off the axis and yet be searched for a zero near it."""
NEGLIGIBLE_SHARE = 1e-6
"""Components of a zero's direction of at most this size, in balanced units, count as zero."""
REFINED_BELOW = 1e-2
"""Largest singular value, in balanced units, from which a zero is sought by Newton steps."""
REFINEMENTS = 3
"""Newton steps from the computed frequency of a mode to that of a zero."""


class AxisZero(NamedTuple):
    """A zero j omega; its ``outputs`` (k, n) of the states show what moves there unseen.

    Each output is as large as the terms of z that cancel there; where z has no such terms, as the
    largest entry of C, or 1.
    """

    omega: float
    outputs: RealArray


def axis_zeros(A: RealArray, B: RealArray, C: RealArray, D: RealArray) -> list[AxisZero]:
    """Invariant zeros of a system on the imaginary axis, at frequencies of at least 0.

    A zero is a frequency at which the system matrix [[A - j omega, B], [C, D]] loses rank. Rows and
    columns of this matrix have no common unit, so it is balanced at each frequency: units of time,
    states and signals do not count, nor that some modes are slow and others fast.

    Parameters
    ----------
    A, B, C, D
        Realisation with balanced states, D^T D = 1.
    """
    n = len(A)
    system = np.block([[_cleared(A, A.ravel()), B], [_cleared(C, C), D]])
    # With D^T D = 1 the zeros are the modes of A - B D^T C that are not seen in (1 - D D^T) C.
    modes = np.linalg.eigvals(A - B @ D.T @ C).astype(complex)
    near = modes[(modes.imag > 0.0) & (abs(modes.real) <= NEAR_AXIS * abs(modes))]
    found: list[AxisZero] = []
    for start in (0.0, *near.imag):  # modes of a multiple zero at 0 are computed far from 0
        omega, directions = _null_space(system, n, float(start))
        if len(directions) and not any(np.isclose(omega, each.omega, atol=0.0) for each in found):
            found.append(AxisZero(omega, _outputs(system, n, directions)))
    return found


def _cleared(M: RealArray, among: RealArray) -> RealArray:
    """M without entries that are rounding errors of the largest ones, in each row, of others."""
    largest = abs(among).max(axis=-1, initial=0.0, keepdims=True)
    return np.where(abs(M) > ZERO_ROUNDING * EPS * largest, M, 0.0)


def _null_space(system: RealArray, n: int, omega: float) -> tuple[float, ComplexArray]:
    """The frequency of a zero near omega, and vectors (k, n + m) that the system matrix cancels.

    No vectors where there is no zero. Each has unit size in balanced units.
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
        turn = 1j * np.vdot(left, right)  # how the singular value falls with the frequency
        if turn == 0.0 or values[-1] > REFINED_BELOW:
            break
        omega += float((values[-1] / turn).real)
    return omega, np.zeros((0, len(system.T)), complex)


def _outputs(system: RealArray, n: int, directions: ComplexArray) -> RealArray:
    """Outputs (k, n) of the states along directions (k, n + m) of a zero."""
    C = system[n:, :n]
    alone = float(abs(C).max(initial=0.0)) or 1.0
    outputs = []
    for direction in directions:
        x = direction[:n]
        terms = float((abs(system[n:]) @ abs(direction)).max(initial=0.0))
        row = x.conj() / np.vdot(x, x).real * (terms or alone * abs(x).max())
        outputs += [part for part in (row.real, row.imag) if part.any()]
    return np.array(outputs).reshape(-1, n)
