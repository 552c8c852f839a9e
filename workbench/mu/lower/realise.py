"""Turn a nearby Delta into one for which M Delta has a real eigenvalue, by Newton's method.

The unknown of Im lambda = 0 is the common phase of the complex blocks or the value of one real
block, as in `workbench.mu.lower.attain`; but the eigenvalue is followed and not looked for among
all, which takes a tenth of the time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workbench.compiled import compiled, unchecked_kernel
from workbench.mu.lower.attain import FULL, REAL
from workbench.mu.lower.rayleigh import inner_product, rayleigh_step, square

NEWTON_STEPS = 12
"""Most Newton steps towards a real eigenvalue."""
REAL_BLOCK_ADVANTAGE = 3.0
"""A real block replaces the phase as the unknown if its effect is larger by this factor."""
SEARCH_TOLERANCE, FINAL_TOLERANCE = 1e-10, 1e-14
"""Largest imaginary part of an eigenvalue that counts as real, as a share of its size: while Deltas
are compared, and for the Delta that is returned."""
FOLLOWED_CHANGE = 1e-5
"""A Rayleigh quotient has settled once it changes by less than this share: its error is then of
the order of the cube."""


class Workspace(NamedTuple):
    """Arrays of one search; ``x``, ``y`` and ``q`` belong to the eigenvalue that is followed."""

    A: np.ndarray
    """M Delta (columns, columns)."""
    L: np.ndarray
    """Its factors after a shift (columns, columns)."""
    pivots: np.ndarray
    """Row exchanges (columns,)."""
    x: np.ndarray
    """Right eigenvector of M Delta (columns,)."""
    y: np.ndarray
    """Left eigenvector (columns,)."""
    q: np.ndarray
    """Sensitivity (rows,): d lambda = q* (d Delta) x."""
    kept: np.ndarray
    """Eigenvectors x, y to return to (2, columns)."""
    best: np.ndarray
    """Eigenvectors x, y of the best Delta (2, columns)."""
    there: np.ndarray
    """A Delta that is tried (rows, columns)."""
    effects: np.ndarray
    """q* x of each block (blocks,)."""
    vectors: np.ndarray
    """Vectors of real parameters (8, parameters)."""
    inverse: np.ndarray
    """Approximate inverse of the Hessian (parameters, parameters)."""
    held: np.ndarray
    """Parameters held at their bounds (parameters,)."""
    bounded: np.ndarray
    """Parameters between -1 and 1: those of real blocks (parameters,)."""


@compiled
def workspace(table, rows, columns):  # type: ignore[no-untyped-def]
    """Arrays for searches with a structure of this `block_table` and size."""
    count = 0
    for k in range(len(table)):
        count += 2 * (table[k, 2] + table[k, 4]) if table[k, 0] == FULL else 1
    bounded = np.zeros(count, np.bool_)
    at = 0
    for k in range(len(table)):
        bounded[at] = table[k, 0] == REAL
        at += 2 * (table[k, 2] + table[k, 4]) if table[k, 0] == FULL else 1
    return Workspace(
        np.zeros((columns, columns), np.complex128),
        np.zeros((columns, columns), np.complex128),
        np.zeros(columns, np.int64),
        np.zeros(columns, np.complex128),
        np.zeros(columns, np.complex128),
        np.zeros(rows, np.complex128),
        np.zeros((2, columns), np.complex128),
        np.zeros((2, columns), np.complex128),
        np.zeros((rows, columns), np.complex128),
        np.zeros(len(table), np.complex128),
        np.zeros((8, count)),
        np.zeros((count, count)),
        np.zeros(count, np.bool_),
        bounded,
    )


@unchecked_kernel
def set_loop(M, delta, table, A):  # type: ignore[no-untyped-def]
    """A = M Delta (columns, columns)."""
    columns = M.shape[0]
    for k in range(len(table)):
        r, nr, c, nc = table[k, 1], table[k, 2], table[k, 3], table[k, 4]
        if table[k, 0] == FULL:
            for i in range(columns):
                for j in range(c, c + nc):
                    total = 0j
                    for m in range(r, r + nr):
                        total += M[i, m] * delta[m, j]
                    A[i, j] = total
        else:
            value = delta[r, c]
            for i in range(columns):
                for j in range(nc):
                    A[i, c + j] = M[i, r + j] * value


@unchecked_kernel
def followed(M, delta, table, near, w):  # type: ignore[no-untyped-def]
    """The eigenvalue of M Delta that is followed, after one more step from an estimate of it.

    NaN where it is 0 or cannot be followed. Sets x, y, q and M Delta of the workspace.
    """
    set_loop(M, delta, table, w.A)
    value = rayleigh_step(w.A, near, w.L, w.pivots, w.x, w.y)
    if not 1e-280 < square(value) < 1e280:
        return complex(np.nan, np.nan)
    set_sensitivity(M, w)
    return value


@unchecked_kernel
def set_sensitivity(M, w):  # type: ignore[no-untyped-def]
    """Set the sensitivity q of the eigenvalue, and the effects q* x of scalar blocks."""
    under = inner_product(w.y, w.x, 0, 0, len(w.x))
    scale = under * (1.0 / square(under))
    for j in range(len(w.q)):
        total = 0j
        for i in range(len(w.x)):
            total += np.conj(M[i, j]) * w.y[i]
        w.q[j] = total * scale


@unchecked_kernel
def block_effect(delta, table, k, w):  # type: ignore[no-untyped-def]
    """q* x of a scalar block, q* Delta x of a full block."""
    r, nr, c, nc = table[k, 1], table[k, 2], table[k, 3], table[k, 4]
    if table[k, 0] != FULL:
        return inner_product(w.q, w.x, r, c, nr)
    total = 0j
    for i in range(r, r + nr):
        part = 0j
        for j in range(c, c + nc):
            part += delta[i, j] * w.x[j]
        total += np.conj(w.q[i]) * part
    return total


@unchecked_kernel
def phase_effect(delta, table, w):  # type: ignore[no-untyped-def]
    """q* Delta x of all complex blocks together; times i, it is d lambda by their phase."""
    total = 0j
    for k in range(len(table)):
        if table[k, 0] != REAL:
            one = block_effect(delta, table, k, w)
            total += one if table[k, 0] == FULL else one * delta[table[k, 1], table[k, 3]]
    return total


@unchecked_kernel
def set_block(delta, table, k, value):  # type: ignore[no-untyped-def]
    """Give a scalar block a value."""
    for i in range(table[k, 2]):
        delta[table[k, 1] + i, table[k, 3] + i] = value


@unchecked_kernel
def turn_complex(delta, table, phase):  # type: ignore[no-untyped-def]
    """Turn all complex blocks by a phase."""
    turn = complex(np.cos(phase), np.sin(phase))
    for k in range(len(table)):
        if table[k, 0] != REAL:
            for i in range(table[k, 1], table[k, 1] + table[k, 2]):
                for j in range(table[k, 3], table[k, 3] + table[k, 4]):
                    delta[i, j] *= turn


@unchecked_kernel
def blocks_of(table):  # type: ignore[no-untyped-def]
    """Whether there are real blocks, and whether there are complex ones."""
    real, other = False, False
    for k in range(len(table)):
        if table[k, 0] == REAL:
            real = True
        else:
            other = True
    return real, other


@unchecked_kernel
def best_unknown(table, delta, w):  # type: ignore[no-untyped-def]
    """The best unknown to keep the eigenvalue real: a real block's number, or -1 for the phase."""
    place, most = -1, REAL_BLOCK_ADVANTAGE * abs(phase_effect(delta, table, w).real)
    for k in range(len(table)):
        if table[k, 0] == REAL:
            room = 1.0 - abs(delta[table[k, 1], table[k, 3]].real)
            effect = room * abs(block_effect(delta, table, k, w).imag)
            if effect > most:
                place, most = k, effect
    return place


@unchecked_kernel
def realise(M, table, delta, near, free, tolerance, w):  # type: ignore[no-untyped-def]
    """Move Delta until the eigenvalue that is followed is real.

    Parameters
    ----------
    M, table
        Matrix (columns, rows) and `block_table`.
    delta
        Complex (rows, columns); changed in place.
    near
        Estimate of the eigenvalue; x and y of the workspace estimate its vectors.
    free
        Number of the real block whose value is the unknown instead of the phase; -1: the phase.
    tolerance
        Largest imaginary part, as a share of the eigenvalue.

    Returns
    -------
    value, phase, weight
        The real eigenvalue (0: not found), the phase by which the complex blocks were turned, and
        the factor in d lambda = Re(weight q* dDelta x), which holds while lambda is kept real.
    """
    phase = 0.0
    some_real, some_complex = blocks_of(table)
    for _ in range(NEWTON_STEPS):
        value = followed(M, delta, table, near, w)
        size = np.sqrt(square(value))
        if not size > 0:
            break
        effect = 0j
        if free >= 0:
            effect = block_effect(delta, table, free, w) * -1j
        elif some_complex:
            effect = phase_effect(delta, table, w) if some_real else value
        level = abs(effect.real) > 1e-12 * size
        settled = square(value - near) <= (FOLLOWED_CHANGE * size) ** 2
        if settled and abs(value.imag) <= tolerance * size and value.real > 0:
            weight = np.conj(effect) * (1.0 / effect.real) if level else 1.0 + 0j
            return value.real, phase, weight
        near = value
        if abs(value.imag) <= FINAL_TOLERANCE * size and (value.real > 0 or some_real):
            continue
        if not level:
            break
        if free < 0:
            step = -np.arctan2(value.imag, effect.real)
            if some_real:
                step = min(max(step, -0.5), 0.5)
            turn_complex(delta, table, step)
            phase += step
        else:
            step = -value.imag / effect.real
            moved = delta[table[free, 1], table[free, 3]].real + step
            if not abs(moved) < 1:
                break
            set_block(delta, table, free, complex(moved, 0.0))
        near = value + 1j * effect * step if some_real else complex(size, 0.0)
        if near.real > 0:
            near = complex(near.real, 0.0)
    return 0.0, phase, 1.0 + 0j
