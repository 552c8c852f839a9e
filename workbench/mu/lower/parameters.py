"""Local parameters of a normalised Delta, and the gradient of a real eigenvalue of M Delta.

The parameter of a real block is its value in [-1, 1], that of a complex scalar its angle. The
parameters of a full block are the two vectors of a dyad u v*, of any length; a full block that
attains mu may be a dyad.
"""

from __future__ import annotations

import numpy as np

from workbench.compiled import compiled
from workbench.mu.lower.attain import FULL, REAL


@compiled
def parameters(delta, table):  # type: ignore[no-untyped-def]
    """Real parameters of a normalised Delta: value, angle, or the top dyad of each block."""
    count = 0
    for kind, _, nr, _, nc in table:
        count += 2 * (nr + nc) if kind == FULL else 1
    p = np.empty(count)
    at = 0
    for kind, r, nr, c, nc in table:
        if kind == REAL:
            p[at] = min(max(delta[r, c].real, -1.0), 1.0)
            at += 1
        elif kind == FULL:
            U, _, Vh = np.linalg.svd(np.ascontiguousarray(delta[r : r + nr, c : c + nc]))
            for i in range(nr):
                p[at + 2 * i], p[at + 2 * i + 1] = U[i, 0].real, U[i, 0].imag
            at += 2 * nr
            for i in range(nc):
                p[at + 2 * i], p[at + 2 * i + 1] = Vh[0, i].real, -Vh[0, i].imag
            at += 2 * nc
        else:
            p[at] = np.angle(delta[r, c])
            at += 1
    return p


@compiled
def _unit(p, at, n):  # type: ignore[no-untyped-def]
    """Unit vector of the n complex entries stored at a place, and their norm."""
    v = np.empty(n, np.complex128)
    for i in range(n):
        v[i] = p[at + 2 * i] + 1j * p[at + 2 * i + 1]
    size = np.sqrt(np.sum(v.real**2 + v.imag**2))
    return v / size, size


@compiled
def perturbation(p, phase, table, rows, columns):  # type: ignore[no-untyped-def]
    """Delta (rows, columns) from its parameters, with complex blocks turned by a common phase."""
    delta = np.zeros((rows, columns), np.complex128)
    turn = np.exp(1j * phase)
    at = 0
    for kind, r, nr, c, nc in table:
        if kind == FULL:
            u, _ = _unit(p, at, nr)
            v, _ = _unit(p, at + 2 * nr, nc)
            at += 2 * (nr + nc)
            delta[r : r + nr, c : c + nc] = turn * u.reshape((nr, 1)) * np.conj(v)
        else:
            value = p[at] + 0j if kind == REAL else turn * np.exp(1j * p[at])
            at += 1
            for i in range(nr):
                delta[r + i, c + i] = value
    return delta


@compiled
def eigenvalue_gradient(p, delta, table, x, q, weight):  # type: ignore[no-untyped-def]
    """Gradient d lambda / dp with lambda kept real: d lambda = Re(weight q* d(Delta) x)."""
    g = np.zeros(len(p))
    at = 0
    for kind, r, nr, c, nc in table:
        if kind == FULL:
            u, size_u = _unit(p, at, nr)
            v, size_v = _unit(p, at + 2 * nr, nc)
            turn = np.vdot(u, np.ascontiguousarray(delta[r : r + nr, c : c + nc]) @ v)
            forward = np.vdot(v, x[c : c + nc])
            backward = np.vdot(q[r : r + nr], u)
            along_u = np.conj(weight * turn * forward) * q[r : r + nr]
            along_u = (along_u - np.vdot(u, along_u).real * u) / size_u
            along_v = weight * turn * backward * x[c : c + nc]
            along_v = (along_v - np.vdot(v, along_v).real * v) / size_v
            for i in range(nr):
                g[at + 2 * i], g[at + 2 * i + 1] = along_u[i].real, along_u[i].imag
            at += 2 * nr
            for i in range(nc):
                g[at + 2 * i], g[at + 2 * i + 1] = along_v[i].real, along_v[i].imag
            at += 2 * nc
        else:
            effect = weight * np.vdot(q[r : r + nr], x[c : c + nc])
            g[at] = effect.real if kind == REAL else (1j * delta[r, c] * effect).real
            at += 1
    return g


@compiled
def bounded_parameters(table, count):  # type: ignore[no-untyped-def]
    """Mark the parameters of real blocks, which are bounded by -1 and 1."""
    bounded = np.zeros(count, np.bool_)
    at = 0
    for kind, _, nr, _, nc in table:
        bounded[at] = kind == REAL
        at += 2 * (nr + nc) if kind == FULL else 1
    return bounded
