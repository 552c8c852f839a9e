"""The power iteration for mixed mu in plain steps, as a reference for the compiled search.

Sources: A. Packard, M. Fan and J. Doyle, "A power method for the structured singular value",
CDC 1988; P. Young and J. Doyle, "Computation of mu with real and complex uncertainties", CDC 1990.
"""

from __future__ import annotations

import numpy as np

from workbench.mu.lower.attain import REAL, SCALAR, attained, innermost, rotated, turned

POWER_STEPS = 60
"""Most steps of one run; a run that has not settled by then seldom does later."""
SETTLED_CHANGE = 1e-6
"""A run ends when the vectors change by less; the eigenvalue's error is then about its square."""


def _size(v):
    """Euclidean norm."""
    total = 0.0
    for value in v:
        total += value.real * value.real + value.imag * value.imag
    return np.sqrt(total)


def _aligned(a, w, table, reals, z, b):
    """Set z = Delta^H w and b = Delta a for the Delta that aligns w with a.

    Real blocks have the values ``reals``.
    """
    for k in range(len(table)):
        kind, r, nr, c, nc = table[k]
        if kind == REAL:
            for i in range(nr):
                z[c + i], b[r + i] = reals[k] * w[r + i], reals[k] * a[c + i]
        elif kind == SCALAR:
            product = np.vdot(a[c : c + nc], w[r : r + nr])
            unit = product / abs(product) if abs(product) > 1e-200 else 1.0 + 0j
            for i in range(nr):
                z[c + i], b[r + i] = np.conj(unit) * w[r + i], unit * a[c + i]
        else:
            size_a, size_w = _size(a[c : c + nc]), _size(w[r : r + nr])
            ratio = size_w / size_a if size_a > 1e-200 else 0.0
            for i in range(nc):
                z[c + i] = ratio * a[c + i]
            ratio = size_a / size_w if size_w > 1e-200 else 0.0
            for i in range(nr):
                b[r + i] = ratio * w[r + i]


def _update_reals(a, b, w, table, reals):
    """Move ``reals`` towards an end of [-1, 1]; they stay inside where a and w are orthogonal."""
    for k in range(len(table)):
        kind, r, nr, c, nc = table[k]
        if kind == REAL:
            size_a = _size(a[c : c + nc])
            old = _size(b[r : r + nr]) / size_a if size_a > 1e-200 else 1.0
            value = np.sign(reals[k]) * old + np.vdot(a[c : c + nc], w[r : r + nr]).real
            reals[k] = min(max(value, -1.0), 1.0)


def iterate(M, table, b, w, reals):
    """The Delta at the end of one run of the power iteration from vectors b, w (rows).

    b, w and the values of the real blocks are changed in place.
    """
    columns = len(M)
    adjoint = np.ascontiguousarray(np.conj(M.T))
    z = np.zeros(columns, np.complex128)
    a = np.zeros(columns, np.complex128)
    for _ in range(POWER_STEPS):
        new = M @ b
        size = _size(new)
        if not size > 1e-200:
            break
        change = 0.0
        for i in range(columns):
            new[i] /= size
            change = max(change, abs(new[i] - a[i]))
        a = new
        _update_reals(a, b, w, table, reals)
        _aligned(a, w, table, reals, z, b)
        new = adjoint @ z
        size = _size(new)
        if not size > 1e-200:
            break
        w[:] = new / size
        _update_reals(a, b, w, table, reals)
        _aligned(a, w, table, reals, z, b)
        if change < SETTLED_CHANGE:
            break
    return aligned_delta(a, w, table, reals)


def aligned_delta(a, w, table, reals):
    """The Delta (rows, columns) that aligns w (rows) with a (columns)."""
    delta = np.zeros((len(w), len(a)), np.complex128)
    for k in range(len(table)):
        kind, r, nr, c, nc = table[k]
        if kind == REAL:
            for i in range(nr):
                delta[r + i, c + i] = reals[k]
        elif kind == SCALAR:
            product = np.vdot(a[c : c + nc], w[r : r + nr])
            unit = product / abs(product) if abs(product) > 1e-200 else 1.0 + 0j
            for i in range(nr):
                delta[r + i, c + i] = unit
        else:
            size = _size(a[c : c + nc]) * _size(w[r : r + nr])
            for i in range(nr):
                for j in range(nc):
                    if size > 1e-200:
                        delta[r + i, c + j] = w[r + i] * np.conj(a[c + j]) / size
                    else:
                        delta[r + i, c + j] = 1.0 if i == 0 and j == 0 else 0.0
    return delta


def power_batch(Ms, table, starts, start_reals):
    """Lower bounds of a batch and their Deltas, by runs from given starts and one warm start.

    Parameters
    ----------
    Ms
        Complex (B, columns, rows), entries of order one.
    table
        `block_table`.
    starts, start_reals
        Unit vectors b and w of each start, complex (S, 2, rows), and its real blocks, (S, blocks).

    Returns
    -------
    values, deltas
        Shapes (S + 1, B), 0 where nothing was found, and (S + 1, B, rows, columns). The last run
        of each matrix starts from the end of the best run of the previous matrix.
    """
    batch, columns, rows = Ms.shape
    runs = len(starts) + 1
    values = np.zeros((runs, batch))
    deltas = np.zeros((runs, batch, rows, columns), np.complex128)
    warm, warm_reals = starts[0].copy(), start_reals[0].copy()
    some_complex = np.any(table[:, 0] != REAL)
    for m in range(batch):
        best = 0.0
        next_warm, next_reals = warm, warm_reals
        for s in range(runs):
            if s == runs - 1:
                vectors, reals = warm.copy(), warm_reals.copy()
            else:
                vectors, reals = starts[s].copy(), start_reals[s].copy()
            delta = iterate(Ms[m], table, vectors[0], vectors[1], reals)
            if not np.all(np.isfinite(delta.real) & np.isfinite(delta.imag)):
                continue
            value = settled(Ms[m], table, delta)
            if value == 0 and some_complex and s == runs - 1 and best == 0:
                value = attained(Ms[m], table, delta)
            values[s, m], deltas[s, m] = value, delta
            if value > best:
                best, next_warm, next_reals = value, vectors, reals
        warm, warm_reals = next_warm, next_reals
    return values, deltas


def settled(M, table, delta):
    """A real eigenvalue near the most positive one of M Delta, 0 for none; delta is changed."""
    if not np.any(table[:, 0] == REAL):
        return rotated(M, delta)
    values = np.linalg.eigvals(M @ delta)
    near = values[np.argmax(values.real - np.abs(values.imag))]
    if not near.real > 0:
        return 0.0
    trial = delta.copy()
    free = -1 if np.any(table[:, 0] != REAL) else innermost(table, delta)
    value = turned(M, table, trial, near, free)[0]
    if value > 0:
        delta[:] = trial
    return value
