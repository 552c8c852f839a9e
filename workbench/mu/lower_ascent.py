"""Local ascent of a mixed-mu lower bound: the real eigenvalue of M Delta over the unit set.

Real blocks move in [-1, 1], complex scalars on the unit circle, full blocks as dyads u v* (at a
maximum of mu a full block may be a dyad). The eigenvalue is kept real by the unknown that
`turned` solves for, which leaves bounds on the real blocks as the only constraints; projected BFGS.
"""

from __future__ import annotations

import numpy as np

from workbench.compiled import compiled
from workbench.mu.lower_attain import FULL, REAL, attained, turned
from workbench.mu.power import innermost, power_batch

STEPS = 60
"""BFGS steps."""
HALVINGS = 12
"""Step lengths tried."""
FLAT = 1e-9
"""Relative gain of a step at which an ascent ends."""


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
    """The unit vector of n complex entries stored at a place, and its size before."""
    v = np.empty(n, np.complex128)
    for i in range(n):
        v[i] = p[at + 2 * i] + 1j * p[at + 2 * i + 1]
    size = np.sqrt(np.sum(v.real**2 + v.imag**2))
    return v / size, size


@compiled
def perturbation(p, phase, table, rows, columns):  # type: ignore[no-untyped-def]
    """Delta (rows, columns) of parameters, its complex blocks turned by a common phase."""
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
def gradient(p, delta, table, x, q, weight):  # type: ignore[no-untyped-def]
    """d lambda / dp with the eigenvalue kept real: d lambda = Re(weight q* d(Delta) x)."""
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
def _bounded(table, count):  # type: ignore[no-untyped-def]
    """Whether each parameter is a real block's."""
    bounded = np.zeros(count, np.bool_)
    at = 0
    for kind, _, nr, _, nc in table:
        bounded[at] = kind == REAL
        at += 2 * (nr + nc) if kind == FULL else 1
    return bounded


@compiled
def ascend(M, table, delta, value):  # type: ignore[no-untyped-def]
    """A local maximum of the real eigenvalue of M Delta from a start that has the real one `value`.

    Returns the value; ``delta`` (rows, columns) is changed in place. Where a real block is the
    unknown that keeps the eigenvalue real, an ascent stops as the block comes to its end; another
    one takes over.
    """
    for _ in range(len(table)):
        reached = _ascend_once(M, table, delta, value)
        small = reached <= value * (1 + 1e-6)
        value = reached
        if small or np.any(table[:, 0] != REAL):
            break
    return value


@compiled
def _ascend_once(M, table, delta, value):  # type: ignore[no-untyped-def]
    """One ascent, the same unknown throughout."""
    rows, columns = delta.shape
    p = parameters(delta, table)
    bounded = _bounded(table, len(p))
    some_complex = np.any(table[:, 0] != REAL)
    here = perturbation(p, 0.0, table, rows, columns)
    free = -1 if some_complex else innermost(table, here)
    found, phase, x, q, weight = turned(M, table, here, value + 0j, free)
    if not found > 0 or (found < value * (1 - 1e-6)):
        return value  # a full block lost to its dyad; the start stands
    best = found
    g = gradient(p, here, table, x, q, weight)
    inverse = np.eye(len(p))
    held = np.zeros(len(p), np.bool_)
    fresh = True
    for _ in range(STEPS):
        now_held = bounded & (((p >= 1) & (g > 0)) | ((p <= -1) & (g < 0)))
        if np.any(now_held != held):
            held, inverse, fresh = now_held, np.eye(len(p)), True
        climb = np.where(held, 0.0, g)
        d = np.where(held, 0.0, inverse @ climb)
        slope = d @ climb
        if not slope > 0:
            d, slope, inverse, fresh = climb, climb @ climb, np.eye(len(p)), True
        if not slope > (1e-13 * best) ** 2:
            break
        length = 1.0
        if fresh:
            length = min(1.0, 0.3 / np.sqrt(np.max(d * d)))
        gained = False
        for _ in range(HALVINGS):
            trial = p + length * d
            trial = np.where(bounded, np.minimum(np.maximum(trial, -1.0), 1.0), trial)
            moved = trial - p
            there = perturbation(trial, phase, table, rows, columns)
            expected = best + moved @ g
            found, shift, x, q, weight = turned(M, table, there, expected + 0j, free)
            if found > best + 1e-4 * max(moved @ g, 0.0) and found > best:
                gained = True
                break
            length *= 0.3
        if not gained:
            if fresh:
                break
            inverse, fresh = np.eye(len(p)), True
            continue
        phase += shift
        here = there
        if free >= 0:
            trial = parameters(here, table)
            moved = trial - p
        new = gradient(trial, here, table, x, q, weight)
        y = g - new  # of -lambda, which is what BFGS minimises
        s = np.where(held, 0.0, moved)
        sy = s @ y
        if sy > 1e-14 * np.sqrt((s @ s) * (y @ y)):
            if fresh:
                inverse *= sy / (y @ y)
            hy = inverse @ y
            inverse += (1 + (y @ hy) / sy) / sy * np.outer(s, s)
            inverse -= (np.outer(hy, s) + np.outer(s, hy)) / sy
            fresh = False
        small = found - best <= FLAT * best
        p, g, best = trial, new, found
        if small:
            break
    if best > value:
        delta[:] = here
        return best
    return value


@compiled
def search_batch(Ms, table, starts, start_reals, agree):  # type: ignore[no-untyped-def]
    """The best of local ascents from the ends of power iterations, per matrix.

    Arguments as `power_batch`; an ascent whose value another one found before ends the search of
    a matrix once ``agree`` of them have met at its best value.

    Returns values (B,) and Deltas (B, rows, columns).
    """
    batch = len(Ms)
    rows, columns = Ms.shape[2], Ms.shape[1]
    found, ends = power_batch(Ms, table, starts, start_reals, True)
    values = np.zeros(batch)
    deltas = np.zeros((batch, rows, columns), np.complex128)
    some_complex = np.any(table[:, 0] != REAL)
    for m in range(batch):
        met = 0
        for s in np.argsort(-found[:, m]):
            if not found[s, m] > 0:
                break
            if abs(found[s, m] - values[m]) <= 1e-7 * values[m]:
                met += 1
            else:
                delta = ends[s, m].copy()
                value = ascend(Ms[m], table, delta, found[s, m])
                if some_complex and abs(value - values[m]) > 1e-7 * value:
                    # A larger eigenvalue of the same direction may have been overlooked.
                    again = delta.copy()
                    larger = attained(Ms[m], table, again)
                    if larger > value * (1 + 1e-9):
                        value = ascend(Ms[m], table, again, larger)
                        delta = again
                if abs(value - values[m]) <= 1e-6 * value:
                    met += 1
                elif value > values[m]:
                    met = 1
                if value > values[m]:
                    values[m], deltas[m] = value, delta
            if met >= agree:
                break
    return values, deltas
