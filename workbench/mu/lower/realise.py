"""Turn a nearby Delta into one for which M Delta has a real eigenvalue, by Newton's method.

The unknown of Im lambda = 0 is the common phase of the complex blocks or the value of one real
block, as in `workbench.mu.lower.attain`; but one eigenvalue is followed, instead of being searched
for among all, which takes a tenth of the time.
"""

from __future__ import annotations

import numpy as np

from workbench._core.compiled import compiled, unchecked_kernel
from workbench.mu.lower.attain import FULL, REAL
from workbench.mu.lower.rayleigh import (
    LOOP,
    Q,
    X,
    Y,
    inner_product,
    rayleigh_step,
    squared_size,
)

NEWTON_STEPS = 12
"""Largest number of Newton steps towards a real eigenvalue. Newton's method doubles the digits, so
four steps suffice from two digits; the others are for poor starts. With half of them a proposal
from such a start may stay unproven.
"""
REAL_BLOCK_ADVANTAGE = 3.0
"""A real block replaces the phase as the unknown if its effect is larger by this factor. The phase
has no ends, so it is preferred. Half or double changes the unknown for matrices with both kinds of
blocks, and with it the way of an ascent.
"""
SEARCH_TOLERANCE, FINAL_TOLERANCE = 1e-10, 1e-14
"""Largest imaginary part of an eigenvalue that counts as real, as a share of its size: while Deltas
are compared, and for the Delta that is returned. Comparisons need ten digits; a proof mends what is
left of the last two. Half or double: a step more or less.
"""
NO_BLOCK: int = np.int64(-1)  # type: ignore[assignment]
"""Stands for the absence of a real block. A NumPy integer, because Numba would compile once more
for a Python integer.
"""
FOLLOWED_CHANGE = 1e-5
"""A Rayleigh quotient has settled once it changes by less than this share: its remaining error is
of the order of the cube of that change. The cube, 1e-15, is the rounding of a double. With half of
it a step more is taken; with eight times as much the eigenvalue would be wrong in its last three
digits.
"""


@compiled
def workspace(table, rows, columns):  # type: ignore[no-untyped-def]
    """Arrays for searches with a structure of this `block_table` and size.

    The first array is complex and holds vectors and matrices, numbered as in
    `workbench.mu.lower.rayleigh`; the second one is real and holds vectors of parameters, numbered
    as in `workbench.mu.lower.ascent`.
    """
    count, width = 0, max(rows, columns)
    for k in range(len(table)):
        count += 2 * (table[k, 2] + table[k, 4]) if table[k, 0] == FULL else 1
    return np.zeros((LOOP + 3 * width, width), np.complex128), np.zeros((10 + count, count))


@unchecked_kernel
def set_loop(M, table, delta, w):  # type: ignore[no-untyped-def]
    """Set M Delta (columns, columns) of the workspace."""
    columns = M.shape[0]
    for k in range(len(table)):
        r, nr, c, nc = table[k, 1], table[k, 2], table[k, 3], table[k, 4]
        if table[k, 0] == FULL:
            for i in range(columns):
                for j in range(c, c + nc):
                    total = 0j
                    for m in range(r, r + nr):
                        total += M[i, m] * delta[m, j]
                    w[LOOP + i, j] = total
        else:
            value = delta[r, c]
            for i in range(columns):
                for j in range(nc):
                    w[LOOP + i, c + j] = M[i, r + j] * value


@unchecked_kernel
def followed(M, table, delta, near, w):  # type: ignore[no-untyped-def]
    """The eigenvalue of M Delta nearest to an estimate, after one more Rayleigh step.

    NaN if it is 0 or cannot be followed. Sets x, y, q and M Delta of the workspace.
    """
    set_loop(M, table, delta, w)
    value = rayleigh_step(w, len(M), near)
    if not 1e-280 < squared_size(value) < 1e280:
        return complex(np.nan, np.nan)
    set_sensitivity(M, w)
    return value


@unchecked_kernel
def set_sensitivity(M, w):  # type: ignore[no-untyped-def]
    """Set the q with d lambda = q* (d Delta) x for the eigenvectors x, y of M Delta."""
    under = inner_product(w, Y, 0, X, 0, len(M))
    scale = under * (1.0 / squared_size(under))
    for j in range(M.shape[1]):
        total = 0j
        for i in range(len(M)):
            total += np.conj(M[i, j]) * w[Y, i]
        w[Q, j] = total * scale


@unchecked_kernel
def block_effect(delta, table, k, w):  # type: ignore[no-untyped-def]
    """q* x of a scalar block, q* Delta x of a full block."""
    r, nr, c, nc = table[k, 1], table[k, 2], table[k, 3], table[k, 4]
    if table[k, 0] != FULL:
        return inner_product(w, Q, r, X, c, nr)
    total = 0j
    for i in range(r, r + nr):
        part = 0j
        for j in range(c, c + nc):
            part += delta[i, j] * w[X, j]
        total += np.conj(w[Q, i]) * part
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
    """The best unknown for keeping the eigenvalue real: a real block, or NO_BLOCK for the phase."""
    place, most = NO_BLOCK, REAL_BLOCK_ADVANTAGE * abs(phase_effect(delta, table, w).real)
    for k in range(len(table)):
        if table[k, 0] == REAL:
            room = 1.0 - abs(delta[table[k, 1], table[k, 3]].real)
            effect = room * abs(block_effect(delta, table, k, w).imag)
            if effect > most:
                place, most = k, effect
    return place


@unchecked_kernel
def realise(M, table, delta, near, free, tolerance, w):  # type: ignore[no-untyped-def]
    """Move Delta until the followed eigenvalue is real.

    Parameters
    ----------
    M, table
        Matrix (columns, rows) and `block_table`.
    delta
        Complex (rows, columns); changed in place.
    near
        Estimate of the eigenvalue; x and y of the workspace estimate its vectors.
    free
        Number of the real block whose value is the unknown, or NO_BLOCK for the phase.
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
        value = followed(M, table, delta, near, w)
        size = np.sqrt(squared_size(value))
        if not size > 0:
            break
        effect = 0j
        if free >= 0:
            effect = block_effect(delta, table, free, w) * -1j
        elif some_complex:
            effect = phase_effect(delta, table, w) if some_real else value
        level = abs(effect.real) > 1e-12 * size
        settled = squared_size(value - near) <= (FOLLOWED_CHANGE * size) ** 2
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
