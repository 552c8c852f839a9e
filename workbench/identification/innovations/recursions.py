"""Compiled recursions of innovations models: predictions and their derivatives.

Signals are deviations from offsets. A missing sample of y (NaN) is predicted, and its innovation is
set to zero.
"""

from __future__ import annotations

import numpy as np

from workbench._core.compiled import compiled


@compiled
def predictions(A, B, C, D, K, x0, u, y):  # type: ignore[no-untyped-def]
    """Predictions (N, ny) of y, one step ahead; in free run with K = 0."""
    n, nu, ny, samples = len(A), u.shape[1], y.shape[1], len(u)
    x, ahead = x0.copy(), np.empty(n)
    found, error = np.empty((samples, ny)), np.empty(ny)
    for t in range(samples):
        for o in range(ny):
            value = 0.0
            for i in range(n):
                value += C[o, i] * x[i]
            for j in range(nu):
                value += D[o, j] * u[t, j]
            found[t, o] = value
            error[o] = y[t, o] - value if y[t, o] == y[t, o] else 0.0
        for i in range(n):
            value = 0.0
            for j in range(n):
                value += A[i, j] * x[j]
            for j in range(nu):
                value += B[i, j] * u[t, j]
            for o in range(ny):
                value += K[i, o] * error[o]
            ahead[i] = value
        x, ahead = ahead, x
    return found


@compiled
def sensitivity_rows(A, B, C, D, K, x, moved, shifted, free, u, y, errors, rows):  # type: ignore[no-untyped-def]
    """Errors (T, ny) of a block of samples, and their derivatives, rows (T, ny, P).

    The columns are those of A, B, C, D, K, of the offsets of u and y, and of the initial state, in
    this order. For a missing sample of y, the error and its derivatives are zero; after it, the
    derivatives with respect to C and D that act through the gain are approximate.

    ``x`` (n,) is the state; its derivatives are ``moved`` (n, n (n + nu + ny)), one column for each
    pair of a state equation and a signal x, u or e that enters it, ``shifted`` (n, nu + ny) by the
    offsets and ``free`` (n, n) by the initial state. They are updated in place: the next block goes
    on from there. Source: L. Ljung, System Identification, 2nd ed., 1999, section 10.3.
    """
    n, nu, ny, samples = len(A), u.shape[1], y.shape[1], len(u)
    signals = n + nu + ny
    end_a, end_b = n * n, n * n + n * nu
    end_c = end_b + ny * n
    end_d = end_c + ny * nu
    end_k = end_d + n * ny
    end_o = end_k + nu + ny
    whole_closed, closed = A - K @ C, np.empty((n, n))
    whole_pushed, pushed = np.empty((n, nu + ny)), np.empty((n, nu + ny))
    whole_pushed[:, :nu] = K @ D - B
    whole_pushed[:, nu:] = -K
    signal, ahead = np.empty(signals), np.empty(n)
    seen, of_offset, of_state = (
        np.empty((ny, n * signals)), np.empty((ny, nu + ny)), np.empty((ny, n)),
    )  # fmt: skip
    next_moved = np.empty_like(moved)
    for t in range(samples):
        for o in range(ny):
            value = y[t, o]
            for i in range(n):
                value -= C[o, i] * x[i]
            for j in range(nu):
                value -= D[o, j] * u[t, j]
            errors[t, o] = value if y[t, o] == y[t, o] else 0.0
        signal[:n] = x
        signal[n : n + nu] = u[t]
        signal[n + nu :] = errors[t]
        np.dot(C, moved, seen)
        np.dot(C, shifted, of_offset)
        np.dot(C, free, of_state)
        for o in range(ny):
            row = rows[t, o]
            if y[t, o] != y[t, o]:
                row[:] = 0.0
                continue
            for i in range(n):
                place = i * signals
                for j in range(n):
                    row[i * n + j] = -seen[o, place + j]
                for j in range(nu):
                    row[end_a + i * nu + j] = -seen[o, place + n + j]
                for j in range(ny):
                    row[end_d + i * ny + j] = -seen[o, place + n + nu + j]
            for p in range(ny):
                for j in range(n + nu):
                    value = 0.0
                    for i in range(n):
                        value += K[i, p] * seen[o, i * signals + j]
                    if p == o:
                        value -= signal[j]
                    if j < n:
                        row[end_b + p * n + j] = value
                    else:
                        row[end_c + p * nu + j - n] = value
            for j in range(nu):
                row[end_k + j] = D[o, j] - of_offset[o, j]
            for j in range(ny):
                row[end_k + nu + j] = -of_offset[o, nu + j] - (1.0 if j == o else 0.0)
            for j in range(n):
                row[end_o + j] = -of_state[o, j]
        closed[:], pushed[:] = whole_closed, whole_pushed
        for o in range(ny):
            if y[t, o] != y[t, o]:  # no innovation enters the states
                for i in range(n):
                    for j in range(n):
                        closed[i, j] += K[i, o] * C[o, j]
                    for j in range(nu):
                        pushed[i, j] -= K[i, o] * D[o, j]
                    pushed[i, nu + o] = 0.0
        np.dot(closed, moved, next_moved)
        moved[:] = next_moved
        for i in range(n):
            for j in range(signals):
                moved[i, i * signals + j] += signal[j]
        shifted[:] = closed @ shifted + pushed
        free[:] = closed @ free
        for i in range(n):
            value = 0.0
            for j in range(n):
                value += A[i, j] * x[j]
            for j in range(nu):
                value += B[i, j] * u[t, j]
            for o in range(ny):
                value += K[i, o] * errors[t, o]
            ahead[i] = value
        x[:] = ahead


@compiled
def observability(A, C, samples):  # type: ignore[no-untyped-def]
    """Rows C A^t, (samples, ny, n)."""
    n, ny = len(A), len(C)
    found = np.empty((samples, ny, n))
    row = C.copy()
    for t in range(samples):
        found[t] = row
        row = row @ A
    return found


@compiled
def driven_rows(A, C, driven, free, u, rows):  # type: ignore[no-untyped-def]
    """Derivatives of the outputs of x+ = A x + B u with respect to the initial state and B.

    Those with respect to B are column by column. They are written to the first n (1 + nu) columns
    of rows (T, ny, P). ``driven`` (n, nu n) and ``free`` (n, n), the derivatives of the state, are
    updated in place.
    """
    n, nu = len(A), u.shape[1]
    seen, seen_free = np.empty((len(C), nu * n)), np.empty((len(C), n))
    ahead, ahead_free = np.empty_like(driven), np.empty_like(free)
    for t in range(len(u)):
        np.dot(C, free, seen_free)
        np.dot(C, driven, seen)
        rows[t, :, :n] = seen_free
        rows[t, :, n : n + nu * n] = seen
        np.dot(A, driven, ahead)
        np.dot(A, free, ahead_free)
        driven[:] = ahead
        free[:] = ahead_free
        for j in range(nu):
            for i in range(n):
                driven[i, j * n + i] += u[t, j]
