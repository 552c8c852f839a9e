"""Local ascent of a mixed-mu lower bound: the largest real eigenvalue of M Delta, |Delta| <= 1.

The unknown that `turned` solves for keeps the eigenvalue real. The only remaining constraints are
the intervals of the real blocks, and projected BFGS climbs within them. The unknown is the common
phase of the complex blocks; where these are weakly coupled, their phase has too little effect, and
the value of a real block is the unknown instead.
"""

from __future__ import annotations

import numpy as np

from workbench.compiled import compiled
from workbench.mu.lower.attain import (
    REAL,
    attained,
    eigenvalue_sensitivity,
    eigenvectors,
    split,
    turned,
)
from workbench.mu.lower.parameters import (
    bounded_parameters,
    eigenvalue_gradient,
    parameters,
    perturbation,
)
from workbench.mu.lower.power import innermost, power_batch

BFGS_STEPS = 60
"""Most BFGS steps of one ascent."""
STEP_LENGTHS = 12
"""Step lengths tried in one BFGS step, each 0.3 times the one before."""
REAL_BLOCK_ADVANTAGE = 3.0
"""A real block replaces the phase as the unknown if its effect is larger by this factor."""
SETTLED_GAIN = 1e-9
"""An ascent ends when a step raises the eigenvalue by less than this share."""


@compiled
def ascend(M, table, delta, value):  # type: ignore[no-untyped-def]
    """Climb to a local maximum of the real eigenvalue of M Delta, and return it.

    The start ``delta`` (rows, columns) must have the real eigenvalue ``value``; it is changed in
    place. Where a real block is the unknown that keeps the eigenvalue real, an ascent stops when
    the block reaches an end of its interval, and another ascent with a new unknown follows.
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
    """The best unknown to keep the eigenvalue real: a real block's number, or -1 for the phase."""
    if not np.any(table[:, 0] != REAL):
        return innermost(table, delta)
    values = np.linalg.eigvals(M @ delta)
    near = values[np.argmin(np.abs(values - value))]
    x, y = eigenvectors(M @ delta, near)
    q = eigenvalue_sensitivity(M, delta, x, y)
    _, other = split(delta, table)
    place, most = -1, REAL_BLOCK_ADVANTAGE * abs(np.vdot(q, other @ x).real)
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
    """One ascent with the same unknown throughout; arguments and result as `ascend`."""
    rows, columns = delta.shape
    p = parameters(delta, table)
    bounded = bounded_parameters(table, len(p))
    here = perturbation(p, 0.0, table, rows, columns)
    free = _unknown(M, table, here, value)
    found, phase, x, q, weight = turned(M, table, here, value + 0j, free)
    if not found > 0 or (found < value * (1 - 1e-6)):
        return value  # the dyad of a full block does less than the block: keep the start
    best = found
    g = eigenvalue_gradient(p, here, table, x, q, weight)
    inverse = np.eye(len(p))
    held = np.zeros(len(p), np.bool_)
    fresh = True
    for _ in range(BFGS_STEPS):
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
        for _ in range(STEP_LENGTHS):
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
        new = eigenvalue_gradient(trial, here, table, x, q, weight)
        y = g - new  # change of the gradient of -lambda, which BFGS minimises
        s = np.where(held, 0.0, moved)
        sy = s @ y
        if sy > 1e-14 * np.sqrt((s @ s) * (y @ y)):
            if fresh:
                inverse *= sy / (y @ y)
            hy = inverse @ y
            inverse += (1 + (y @ hy) / sy) / sy * np.outer(s, s)
            inverse -= (np.outer(hy, s) + np.outer(s, hy)) / sy
            fresh = False
        small = found - best <= SETTLED_GAIN * best
        p, g, best = trial, new, found
        if small:
            break
    if best > value:
        delta[:] = here
        return best
    return value


@compiled
def search_batch(Ms, table, starts, start_reals, agree):  # type: ignore[no-untyped-def]
    """For each matrix the best of local ascents that start from the ends of power iterations.

    Arguments as `power_batch`. The search for a matrix ends early when ``agree`` ascents have
    reached its best value.

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
                    # The same direction may have a larger eigenvalue that was overlooked.
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
