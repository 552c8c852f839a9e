"""Perturbations that make I - M Delta singular up to rounding, found from a direction Delta.

If M Delta has a real eigenvalue lambda > 0, then Delta / lambda makes I - M Delta singular. Without
real blocks the common phase of Delta is free and can make any eigenvalue real. With real and
complex blocks the common phase of the complex ones is the unknown in the equation Im lambda = 0.
Where there are no complex blocks, or only weakly coupled ones, the value of a real block inside its
interval is the unknown instead. Where every real block is at an end of its interval there may be no
solution.

Delta is normalised here: real blocks lie in [-1, 1], other blocks have largest singular value 1.
"""

from __future__ import annotations

import numpy as np

from workbench._core.compiled import compiled
from workbench.structure import Complex, Real, Structure

REAL, SCALAR, FULL = 0, 1, 2
"""Kinds of block in a table: real scalar, complex scalar, full complex block."""
REAL_EIGENVALUE_TOLERANCE = 1e-14
"""An eigenvalue counts as real if its imaginary part is below this share of its size. It is 45
roundings, as many as an eigenvalue of a few blocks has. With half of it Newton's method may never
end; with double of it the proof of Delta has more to mend.
"""
NEWTON_STEPS = 20
"""Most Newton steps towards a real eigenvalue. It doubles the digits with each step, so six suffice
from one digit. Half changes little; double costs time for starts that fail.
"""


def block_table(structure: Structure) -> np.ndarray:
    """The structure as an integer table for compiled code.

    Each block has a row with its kind, first row, number of rows, first column and number of
    columns.
    """
    rows = []
    places = zip(structure, structure.row_slices, structure.column_slices, strict=True)
    for block, row, column in places:
        scalar = isinstance(block, Complex) or (block.rows, block.columns) == (1, 1)
        kind = REAL if isinstance(block, Real) else SCALAR if scalar else FULL
        rows.append((kind, row.start, block.rows, column.start, block.columns))
    return np.array(rows, np.int64)


@compiled
def split(delta, table):  # type: ignore[no-untyped-def]
    """Delta with only its real blocks, and Delta with only its other blocks."""
    real, other = np.zeros_like(delta), np.zeros_like(delta)
    for kind, r, nr, c, nc in table:
        part = real if kind == REAL else other
        part[r : r + nr, c : c + nc] = delta[r : r + nr, c : c + nc]
    return real, other


@compiled
def eigenvectors(A, value):  # type: ignore[no-untyped-def]
    """Unit right and left eigenvectors x, y of an eigenvalue: A x = value x, y* A = value y*."""
    U, _, Vh = np.linalg.svd(A - value * np.eye(A.shape[0]))
    return np.conj(Vh[-1]), np.ascontiguousarray(U[:, -1])


@compiled
def eigenvalue_sensitivity(M, delta, x, y):  # type: ignore[no-untyped-def]
    """The q with d lambda = q* (d Delta) x for eigenvectors x, y of M Delta; 0 for a defective
    eigenvalue.
    """
    product = np.vdot(y, x)
    q = np.conj(M.T) @ y
    if abs(product) < 1e-13:
        return np.zeros_like(q)
    return q / np.conj(product)


@compiled
def turned(M, table, delta, near, free):  # type: ignore[no-untyped-def]
    """Find a real eigenvalue of M Delta by Newton's method in the phase of the complex blocks.

    Parameters
    ----------
    M, table
        Matrix (columns, rows) and `block_table`.
    delta
        Complex (rows, columns); changed in place.
    near
        The eigenvalue nearest to this is followed; 0: the largest.
    free
        Number of the real block whose value is the unknown instead of the phase; -1: the phase.

    Returns
    -------
    value, phase, x, q, weight
        The real eigenvalue (0: not found), the phase by which the complex blocks were turned, the
        right eigenvector and the sensitivity of the eigenvalue, and the factor in
        d lambda = Re(weight q* dDelta x), which holds while the eigenvalue is kept real.
    """
    phase = 0.0
    some_real = np.any(table[:, 0] == REAL)
    some_complex = np.any(table[:, 0] != REAL)
    x = np.zeros(M.shape[0], np.complex128)
    q = np.zeros(M.shape[1], np.complex128)
    for _ in range(NEWTON_STEPS):
        A = M @ delta
        values = np.linalg.eigvals(A)
        if near == 0 or not some_real:
            value = values[np.argmax(np.abs(values))]
        else:
            value = values[np.argmin(np.abs(values - near))]
        size = abs(value)
        if not size > 1e-200:
            break
        x, y = eigenvectors(A, value)
        q = eigenvalue_sensitivity(M, delta, x, y)
        # d lambda by the unknown is i * effect. To keep lambda real, the unknown compensates the
        # imaginary part of all other changes.
        if free >= 0:
            _, r, n, c, _ = table[free]
            effect = np.vdot(q[r : r + n], x[c : c + n]) / 1j
        elif some_complex:
            _, other = split(delta, table)
            effect = np.vdot(q, other @ x)
        else:
            effect = 0j
        level = abs(effect.real) > 1e-12 * size
        weight = np.conj(effect) / effect.real if level else 1.0 + 0j
        if abs(value.imag) <= REAL_EIGENVALUE_TOLERANCE * size and value.real > 0:
            return value.real, phase, x, q, weight
        if not level:
            break
        if free < 0:
            step = -np.arctan2(value.imag, effect.real)
            if some_real and abs(step) > 0.5:
                step = np.sign(step) * 0.5
            delta += (np.exp(1j * step) - 1) * other
            phase += step
        else:
            step = -value.imag / effect.real
            _, r, n, c, _ = table[free]
            moved = delta[r, c].real + step
            if not abs(moved) < 1:
                break
            for i in range(n):
                delta[r + i, c + i] = moved
        near = value + 1j * effect * step
        if some_real and near.real > 0:
            near = near.real + 0j
    return 0.0, phase, x, q, 1.0 + 0j


@compiled
def rotated(M, delta):  # type: ignore[no-untyped-def]
    """Size of the largest eigenvalue of M Delta; Delta is turned in place so that it is real and
    positive.
    """
    values = np.linalg.eigvals(M @ delta)
    value = values[np.argmax(np.abs(values))]
    size = abs(value)
    if not size > 1e-200:
        return 0.0
    delta *= np.conj(value) / size
    return size


@compiled
def _turned_radius(M_real, M_other, value):  # type: ignore[no-untyped-def]
    """Spectral radius of (value I - M_real)^-1 M_other, and the eigenvalue that attains it.

    Some phase of the complex blocks makes `value` an eigenvalue of M Delta where the radius is 1.
    """
    A = value * np.eye(M_real.shape[0]) - M_real
    if not np.linalg.cond(A) < 1e15:
        return np.inf, 1.0 + 0j
    roots = np.linalg.eigvals(np.linalg.solve(A, M_other))
    root = roots[np.argmax(np.abs(roots))]
    return abs(root), root


@compiled
def attained(M, table, delta):  # type: ignore[no-untyped-def]
    """The largest real eigenvalue found along a direction with complex blocks; 0: none.

    ``delta`` is changed in place to the Delta that has it. The phase is eliminated: lambda is an
    eigenvalue for some phase where the spectral radius of (lambda I - M D_real)^-1 M D_other is 1.
    This radius is below 1 for large lambda, so the largest lambda is bracketed and bisected.
    """
    some_real = np.any(table[:, 0] == REAL)
    if not some_real:
        return rotated(M, delta)
    real, other = split(delta, table)
    M_real, M_other = M @ real, M @ other
    above = np.linalg.norm(M_real, 2) + np.linalg.norm(M_other, 2)
    if not above > 1e-200:
        return 0.0
    below = above
    for _ in range(40):
        below *= 0.8
        if _turned_radius(M_real, M_other, below)[0] >= 1:
            break
        above = below
    else:
        return 0.0
    for _ in range(20):
        middle = 0.5 * (below + above)
        if _turned_radius(M_real, M_other, middle)[0] >= 1:
            below = middle
        else:
            above = middle
    root = _turned_radius(M_real, M_other, below)[1]
    delta += (np.conj(root) / abs(root) - 1) * other
    return turned(M, table, delta, below + 0j, -1)[0]


@compiled
def innermost(table, delta):  # type: ignore[no-untyped-def]
    """Index of the real block farthest inside its interval; -1 if all real blocks are at the
    ends.
    """
    place, least = -1, 1.0
    for k in range(len(table)):
        kind, r, _, c, _ = table[k]
        if kind == REAL and abs(delta[r, c].real) < least:
            place, least = k, abs(delta[r, c].real)
    return place
