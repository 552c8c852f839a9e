"""Local ascent of a mixed-mu lower bound: the real eigenvalue of M Delta over the unit set.

The eigenvalue is kept real by the unknown that `turned` solves for, which leaves the ends of the
real blocks as the only constraints; projected BFGS. Where complex blocks are weakly coupled their
phase does too little for that, and a real block is the unknown.
"""

from __future__ import annotations

import numpy as np

from workbench.compiled import compiled
from workbench.mu.lower.attain import (
    REAL,
    attained,
    eigenvectors,
    sensitivity,
    split,
    turned,
)
from workbench.mu.lower.parameters import (
    bounded_parameters,
    gradient,
    parameters,
    perturbation,
)
from workbench.mu.lower.power import innermost, power_batch

STEPS = 60
"""BFGS steps."""
HALVINGS = 12
"""Step lengths tried."""
WEAK = 3.0
"""How many times more than the phase a real block must do to be the unknown in its place."""
FLAT = 1e-9
"""Relative gain of a step at which an ascent ends."""


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
        if small:
            break
    return value


@compiled
def _unknown(M, table, delta, value):  # type: ignore[no-untyped-def]
    """The real block that can do most for a real eigenvalue; -1: the phase of the complex ones."""
    if not np.any(table[:, 0] != REAL):
        return innermost(table, delta)
    values = np.linalg.eigvals(M @ delta)
    near = values[np.argmin(np.abs(values - value))]
    x, y = eigenvectors(M @ delta, near)
    q = sensitivity(M, delta, x, y)
    _, other = split(delta, table)
    place, most = -1, WEAK * abs(np.vdot(q, other @ x).real)
    for k in range(len(table)):
        kind, r, n, c, _ = table[k]
        if kind == REAL:
            room = 1.0 - abs(delta[r, c].real)
            effect = room * abs(np.vdot(q[r : r + n], x[c : c + n]).imag)
            if effect > most:
                place, most = k, effect
    return place


@compiled
def _ascend_once(M, table, delta, value):  # type: ignore[no-untyped-def]
    """One ascent, the same unknown throughout."""
    rows, columns = delta.shape
    p = parameters(delta, table)
    bounded = bounded_parameters(table, len(p))
    here = perturbation(p, 0.0, table, rows, columns)
    free = _unknown(M, table, here, value)
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
