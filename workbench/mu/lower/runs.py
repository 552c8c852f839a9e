"""Runs that lead from random vectors to a Delta for which M Delta has a real eigenvalue.

A power iteration aligns the complex blocks. Real blocks are held at a vertex, or moved as in the
power iteration of mixed mu. With real blocks only, the best Delta of the linearised problem is
taken repeatedly instead. The remaining imaginary part is removed by moving all real blocks
together.

Sources: A. Packard, M. Fan and J. Doyle, "A power method for the structured singular value",
CDC 1988; P. Young and J. Doyle, "Computation of mu with real and complex uncertainties", CDC 1990.
"""

from __future__ import annotations

import numpy as np

from workbench._core.compiled import inlined, unchecked_kernel
from workbench.mu.lower.attain import FULL, REAL
from workbench.mu.lower.rayleigh import (
    EFFECTS,
    B,
    Q,
    U,
    X,
    Y,
    inner_product,
    part_length,
    squared_size,
)
from workbench.mu.lower.realise import (
    NO_BLOCK,
    SEARCH_TOLERANCE,
    best_unknown,
    block_effect,
    blocks_of,
    followed,
    realise,
    set_block,
)

POWER_STEPS, FIRST_STEPS = 20, 1
"""Largest number of steps of a power iteration that runs until it settles, and of one that only
starts a run at a level. A run ends earlier by `SETTLED_CHANGE`. Half or double: starts of ascents
that are a little less or more settled.
"""
ALIGNING_STEPS = 6
"""Number of steps that align complex blocks with the eigenvalue next to a level. Each step aligns
to about the square of the error before. With half of them a run may lead elsewhere; double costs
time.
"""
SETTLED_CHANGE = 1e-2
"""A power iteration ends when its vectors change by less than this; an ascent follows. The ascent
needs no better start. With half of it a run takes a step or two more; with double of it ascents
take more steps.
"""
LINEARISED_STEPS = 6
"""Largest number of steps to the best Delta of the linearised problem of real blocks. Half or
double: runs end a little earlier or later, and an ascent follows.
"""
RESTORING_STEPS = 15
"""Largest number of steps that remove the imaginary part of an eigenvalue. Each removes it to first
order. With half of them fewer runs reach `NEARLY_REAL`; double costs time for runs that fail.
"""
HELD = np.bool_(False)
"""Real blocks do not move. A NumPy bool, because Numba would compile once more for a Python
constant.
"""
NEARLY_REAL = 1e-3
"""Newton's method takes over once the imaginary part of an eigenvalue is below this share of its
size. Newton's method doubles these three digits with each step. Half or double: a step more or less
of either method.
"""


@unchecked_kernel
def realised_run(M, table, reals, moving, level, delta, order, w):  # type: ignore[no-untyped-def]
    """Set Delta by one run, and return its real eigenvalue (0: none).

    The run starts from rows B and U of the workspace and from values of the real blocks, ``reals``
    (blocks,), which it changes if ``moving``. If ``level`` is positive, the run searches for the
    eigenvalue next to it; otherwise it follows the power iteration. The eigenvectors are left in X
    and Y.
    """
    some_complex = blocks_of(table)[1]
    steps = FIRST_STEPS if level > 0 else POWER_STEPS
    near = complex(_power_run(M, table, reals, moving, steps, delta, w), 0.0)
    if level > 0:
        near = _aligned(M, table, reals, level, delta, w)
    if not near.real > 0:
        return 0.0
    value = 0.0
    if some_complex:
        value = realise(M, table, delta, near, NO_BLOCK, SEARCH_TOLERANCE, w)[0]
    else:
        near = _linearised(M, table, delta, near, order, w)
    if not value > 0:
        value = _restored(M, table, delta, near, w)
        if value > 0:
            free, near = best_unknown(table, delta, w), complex(value, 0.0)
            value = realise(M, table, delta, near, free, SEARCH_TOLERANCE, w)[0]
    return value


@unchecked_kernel
def _power_run(M, table, reals, moving, steps, delta, w):  # type: ignore[no-untyped-def]
    """Growth at the end of a power iteration (0: the vectors vanished); sets Delta, x and y."""
    columns, rows = M.shape
    growth = 0.0
    for i in range(columns):
        w[X, i] = 0j
    for _ in range(steps):
        change, total = 0.0, 0.0
        for i in range(columns):
            entry = 0j
            for j in range(rows):
                entry += M[i, j] * w[B, j]
            w[Y, i] = entry
            total += squared_size(entry)
        if not total > 1e-280:
            return 0.0
        growth = np.sqrt(total)
        for i in range(columns):
            entry = w[Y, i] * (1.0 / growth)
            change = max(change, squared_size(entry - w[X, i]))
            w[X, i] = entry
        _align(table, reals, moving, delta, w)
        total = 0.0
        for j in range(rows):
            entry = 0j
            for i in range(columns):
                entry += np.conj(M[i, j]) * w[Y, i]
            w[U, j] = entry
            total += squared_size(entry)
        if not total > 1e-280:
            return 0.0
        scale = 1.0 / np.sqrt(total)
        for j in range(rows):
            w[U, j] *= scale
        _align(table, reals, moving, delta, w)
        if change < SETTLED_CHANGE**2:
            break
    return growth


@unchecked_kernel
def _align(table, reals, moving, delta, w):  # type: ignore[no-untyped-def]
    """Set the Delta that aligns u = U (rows,) with a = X (columns,), Y = Delta* u, B = Delta a.

    Real blocks that are ``moving`` first take a step towards an end of their interval, unless a
    and u are orthogonal.
    """
    for k in range(len(table)):
        r, nr, c, nc = table[k, 1], table[k, 2], table[k, 3], table[k, 4]
        size_a = part_length(w, X, c, nc)
        if table[k, 0] == FULL:
            size_u = part_length(w, U, r, nr)
            both = size_a * size_u
            for i in range(nr):
                for j in range(nc):
                    if both > 1e-200:
                        delta[r + i, c + j] = w[U, r + i] * np.conj(w[X, c + j]) * (1.0 / both)
                    else:
                        delta[r + i, c + j] = 1.0 if i == 0 and j == 0 else 0.0
            for j in range(nc):
                w[Y, c + j] = w[X, c + j] * (size_u / size_a) if size_a > 1e-200 else 0j
            for i in range(nr):
                w[B, r + i] = w[U, r + i] * (size_a / size_u) if size_u > 1e-200 else 0j
        else:
            product = inner_product(w, X, c, U, r, nr)
            value = complex(reals[k], 0.0)
            if table[k, 0] != REAL:
                size = squared_size(product)
                value = product * (1.0 / np.sqrt(size)) if size > 1e-280 else 1.0 + 0j
            elif moving:
                old = part_length(w, B, r, nr) / size_a if size_a > 1e-200 else 1.0
                reals[k] = min(max((-old if reals[k] < 0 else old) + product.real, -1.0), 1.0)
                value = complex(reals[k], 0.0)
            set_block(delta, table, k, value)
            for i in range(nr):
                w[Y, c + i], w[B, r + i] = np.conj(value) * w[U, r + i], value * w[X, c + i]


@inlined
def _aligned(M, table, reals, level, delta, w):  # type: ignore[no-untyped-def]
    """Estimate of an eigenvalue (0: lost) after steps that align the complex blocks with it.

    The eigenvalue is the one next to a level, with the real blocks held. Where complex blocks are
    weakly coupled, or real blocks repeated, there are large real eigenvalues that no power
    iteration finds.
    """
    value = 0j
    for _ in range(ALIGNING_STEPS):
        value = followed(M, table, delta, complex(level, 0.0), w)
        if not squared_size(value) > 0:
            return 0j
        for j in range(M.shape[1]):
            w[U, j] = w[Q, j]
        _align(table, reals, HELD, delta, w)
    return complex(np.sqrt(squared_size(value)), 0.0)


@unchecked_kernel
def _linearised(M, table, delta, near, order, w):  # type: ignore[no-untyped-def]
    """Estimate of a real eigenvalue after steps to the best Delta of the linearised problem.

    For real blocks only. lambda is near sum a_k t_k with effects a_k. The largest real value of
    that sum with |t_k| <= 1 has t_k = sign Re((1 + i nu) a_k) for all but one block; this linear
    program is solved by sorting the ratios Re a_k / Im a_k. ``order`` (blocks,) is scratch space
    for sorting.
    """
    for _ in range(LINEARISED_STEPS):
        value = followed(M, table, delta, near, w)
        if not squared_size(value) > 0:
            break
        balance = 0.0
        for k in range(len(table)):
            effect = block_effect(delta, table, k, w)
            if effect.imag == 0:
                effect = complex(effect.real, 1e-300)
            w[EFFECTS, k] = effect
            balance += abs(effect.imag)
            j = k
            while j > 0 and _ratio(w[EFFECTS, order[j - 1]]) > _ratio(effect):
                order[j] = order[j - 1]
                j -= 1
            order[j] = k
        # With nu below all ratios, t_k Im a_k is positive for every k. One block after the other
        # changes its sign until the sum would be negative: that block takes a value between its
        # ends.
        total, change, passed = 0.0, 0.0, False
        for place in range(len(table)):
            k = order[place]
            imag = w[EFFECTS, k].imag
            t = 1.0 if imag > 0 else -1.0
            if not passed:
                after = balance - 2 * abs(imag)
                passed = after <= 0
                t = t * (1 - balance / abs(imag)) if passed else -t
                balance = after
            change = max(change, abs(delta[table[k, 1], table[k, 3]].real - t))
            set_block(delta, table, k, complex(t, 0.0))
            total += w[EFFECTS, k].real * t
        near = complex(total, 0.0)
        if change < 1e-6:
            break
    return near


@unchecked_kernel
def _ratio(effect):  # type: ignore[no-untyped-def]
    """Real part over imaginary part."""
    return effect.real / effect.imag


@unchecked_kernel
def _restored(M, table, delta, near, w):  # type: ignore[no-untyped-def]
    """A nearly real positive eigenvalue (0: none) after the shortest moves of the real blocks."""
    for _ in range(RESTORING_STEPS):
        value = followed(M, table, delta, near, w)
        size = squared_size(value)
        if not size > 0:
            break
        if value.real < 0 and abs(value.imag) <= NEARLY_REAL * -value.real:
            for i in range(delta.shape[0]):
                for j in range(delta.shape[1]):
                    delta[i, j] = -delta[i, j]
            near = -value
            continue
        if (
            abs(value.imag) <= NEARLY_REAL * value.real
            and squared_size(value - near) <= 1e-4 * size
        ):
            return value.real
        total = 0.0
        for k in range(len(table)):
            if table[k, 0] == REAL:
                effect = block_effect(delta, table, k, w)
                old = delta[table[k, 1], table[k, 3]].real
                inside = abs(old) < 1 or -value.imag * effect.imag * old < 0
                total += effect.imag**2 if inside else 0.0
        if not total > 1e-24 * size:
            break
        near = value
        for k in range(len(table)):
            if table[k, 0] == REAL:
                effect = block_effect(delta, table, k, w)
                old = delta[table[k, 1], table[k, 3]].real
                moved = min(max(old - value.imag * effect.imag / total, -1.0), 1.0)
                near += effect * (moved - old)
                set_block(delta, table, k, complex(moved, 0.0))
        if near.real > 0:
            near = complex(near.real, 0.0)
    return 0.0
