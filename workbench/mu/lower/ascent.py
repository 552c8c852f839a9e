"""Local ascent of a mixed-mu lower bound: the largest real eigenvalue of M Delta, |Delta| <= 1.

The unknown that `realise` solves for keeps the eigenvalue real. The only remaining constraints are
the intervals of the real blocks, and projected BFGS climbs within them. The unknown is the common
phase of the complex blocks; where these are weakly coupled, their phase has too little effect, and
the value of a real block is the unknown instead.
"""

from __future__ import annotations

import numpy as np

from workbench.compiled import compiled, unchecked_kernel
from workbench.mu.lower.attain import FULL, eigenvectors
from workbench.mu.lower.parameters import set_delta, set_gradient, set_parameters
from workbench.mu.lower.rayleigh import copy
from workbench.mu.lower.realise import (
    FINAL_TOLERANCE,
    SEARCH_TOLERANCE,
    best_unknown,
    realise,
    set_sensitivity,
    workspace,
)

BFGS_STEPS = 60
"""Most BFGS steps of one ascent."""
STEP_LENGTHS = 8
"""Step lengths tried in one BFGS step, each 0.3 times the one before."""
SETTLED_GAIN = 1e-9
"""An ascent ends when a step raises the eigenvalue by less than this share."""
UNKNOWN_GAIN = 1e-6
"""Another ascent with a new unknown follows one that raised the eigenvalue by this share."""


@compiled
def ascend(M, table, delta, value):  # type: ignore[no-untyped-def]
    """Climb to a local maximum of the real eigenvalue of M Delta, and return it.

    The start ``delta`` (rows, columns) must have the real eigenvalue ``value``, and dyads as its
    full blocks; it is changed in place.
    """
    w = workspace(table, delta.shape[0], delta.shape[1])
    w.x[:], w.y[:] = eigenvectors(M @ delta, value + 0j)
    return polished(M, table, delta, climb(M, table, delta, value, w), w)


@unchecked_kernel
def polished(M, table, delta, value, w):  # type: ignore[no-untyped-def]
    """Make a real eigenvalue real to rounding; Delta is kept where that does not succeed."""
    set_sensitivity(M, w)
    _copy_matrix(delta, w.there)
    free = best_unknown(table, delta, w)
    near = complex(value, 0.0)
    reached = realise(M, table, w.there, near, free, FINAL_TOLERANCE, w)[0]
    if reached > value * (1 - UNKNOWN_GAIN):
        _copy_matrix(w.there, delta)
        return reached
    return value


@unchecked_kernel
def climb(M, table, delta, value, w):  # type: ignore[no-untyped-def]
    """Climb from a Delta whose real eigenvalue and vectors x, y (in the workspace) are known.

    An ascent stops when a real block that is the unknown reaches an end of its interval; another
    ascent with a new unknown follows.
    """
    for _ in range(len(table)):
        reached = _climb_once(M, table, delta, value, w)
        small = reached <= value * (1 + UNKNOWN_GAIN)
        value = reached
        if small:
            break
    return value


@unchecked_kernel
def _climb_once(M, table, delta, value, w):  # type: ignore[no-untyped-def]
    """One ascent with the same unknown throughout; arguments and result as `climb`."""
    p, g, trial, new = w.vectors[0], w.vectors[1], w.vectors[2], w.vectors[3]
    d, moved = w.vectors[4], w.vectors[5]
    set_sensitivity(M, w)
    free, own = best_unknown(table, delta, w), 0
    for k in range(free):
        own += 2 * (table[k, 2] + table[k, 4]) if table[k, 0] == FULL else 1
    set_parameters(delta, table, p)
    best, phase, expected, length, weight = value, 0.0, 0.0, 0.0, 1.0 + 0j
    tries, fresh, started = 0, True, False
    for _ in range(BFGS_STEPS * STEP_LENGTHS):
        # The first pass evaluates the start, a later one a point of the line.
        for i in range(len(p)):
            trial[i] = p[i] + length * d[i] if started else p[i]
            if w.bounded[i]:
                trial[i] = min(max(trial[i], -1.0), 1.0)
            moved[i] = trial[i] - p[i]
        expected = 0.0
        if started:
            for i in range(len(p)):
                expected += moved[i] * g[i]
        copy(w.x, w.kept[0])
        copy(w.y, w.kept[1])
        set_delta(trial, phase, table, w.there)
        near = complex(best + expected, 0.0)
        found, shift, weight = realise(M, table, w.there, near, free, SEARCH_TOLERANCE, w)
        if not started:
            if not found > value * (1 - UNKNOWN_GAIN):
                copy(w.kept[0], w.x)
                copy(w.kept[1], w.y)
                break
        elif not (found > best and found > best + 1e-4 * expected):
            copy(w.kept[0], w.x)
            copy(w.kept[1], w.y)
            length *= 0.3
            tries += 1
            if tries < STEP_LENGTHS:
                continue
            if fresh:
                break
            fresh, tries = True, 0
            length = _set_direction(p, g, d, best, True, w)
            if not length > 0:
                break
            continue
        phase += shift
        if free >= 0:
            trial[own] = w.there[table[free, 1], table[free, 3]].real
            moved[own] = trial[own] - p[own]
        set_gradient(trial, phase, w.there, table, weight, w, new)
        small = False
        if started:
            fresh = not _updated(g, new, moved, fresh, w) and fresh
            small = found - best <= SETTLED_GAIN * best
        best, started, tries = found, True, 0
        copy(trial, p)
        copy(new, g)
        _copy_matrix(w.there, delta)
        if small:
            break
        for i in range(len(p)):
            now = w.bounded[i] and ((p[i] >= 1 and g[i] > 0) or (p[i] <= -1 and g[i] < 0))
            fresh = fresh or now != w.held[i]
            w.held[i] = now
        length = _set_direction(p, g, d, best, fresh, w)
        if length < 0:  # no ascent direction: the Hessian is spoilt
            fresh, length = True, _set_direction(p, g, d, best, True, w)
        if not length > 0:
            break
    return best


@unchecked_kernel
def _copy_matrix(source, target):  # type: ignore[no-untyped-def]
    """Copy a matrix."""
    for i in range(source.shape[0]):
        copy(source[i], target[i])


@unchecked_kernel
def _set_direction(p, g, d, best, fresh, w):  # type: ignore[no-untyped-def]
    """Set the direction of the next step, and return its first length.

    0 where the gradient vanishes, -1 where the direction does not ascend. A fresh start forgets
    the Hessian.
    """
    slope, largest = 0.0, 0.0
    for i in range(len(p)):
        total = 0.0 if w.held[i] else g[i]
        if fresh:
            for j in range(len(p)):
                w.inverse[i, j] = 0.0
            w.inverse[i, i] = 1.0
        elif not w.held[i]:
            total = 0.0
            for j in range(len(p)):
                total += 0.0 if w.held[j] else w.inverse[i, j] * g[j]
        d[i] = total
        slope += total * g[i]
        largest = max(largest, abs(total))
    if not slope > (1e-13 * best) ** 2:
        return 0.0 if fresh else -1.0
    return min(1.0 / best, 0.3 / largest) if fresh else min(1.0, 1.0 / largest)


@unchecked_kernel
def _updated(g, new, moved, first, w):  # type: ignore[no-untyped-def]
    """Update the inverse Hessian of -lambda from a step; False where it has no curvature."""
    change, hy = w.vectors[6], w.vectors[7]
    sy, yy, ss = 0.0, 0.0, 0.0
    for i in range(len(g)):
        change[i] = 0.0 if w.held[i] else g[i] - new[i]
        step = 0.0 if w.held[i] else moved[i]
        sy += step * change[i]
        yy += change[i] * change[i]
        ss += step * step
    if not (sy > 0 and sy > 1e-14 * np.sqrt(ss * yy)):
        return False
    yhy = 0.0
    if first:
        for i in range(len(g)):
            w.inverse[i, i] = sy / yy
    for i in range(len(g)):
        total = 0.0
        for j in range(len(g)):
            total += w.inverse[i, j] * change[j]
        hy[i] = total
        yhy += total * change[i]
    for i in range(len(g)):
        for j in range(len(g)):
            s, t = 0.0 if w.held[i] else moved[i], 0.0 if w.held[j] else moved[j]
            w.inverse[i, j] += ((1 + yhy / sy) * s * t - hy[i] * t - s * hy[j]) / sy
    return True
