"""Local ascent of a mixed-mu lower bound: the largest real eigenvalue of M Delta, |Delta| <= 1.

The unknown that `realise` solves for keeps the eigenvalue real. The only remaining constraints are
the intervals of the real blocks, and projected BFGS climbs within them. The unknown is the common
phase of the complex blocks; where these are weakly coupled, their phase has too little effect, and
the value of a real block is the unknown instead.
"""

from __future__ import annotations

import numpy as np

from workbench._core.compiled import compiled, inlined, unchecked_kernel
from workbench.mu.lower.attain import FULL, REAL, eigenvectors
from workbench.mu.lower.parameters import set_delta, set_gradient, set_parameters
from workbench.mu.lower.rayleigh import KEPT, LOOP, X, Y, copy_pair, squared_size
from workbench.mu.lower.realise import (
    FINAL_TOLERANCE,
    SEARCH_TOLERANCE,
    best_unknown,
    realise,
    set_sensitivity,
    workspace,
)

BFGS_STEPS = 60
"""Largest number of BFGS steps in one ascent. An ascent ends earlier by `SETTLED_GAIN`. With half
of them those along narrow ridges stop early, at a lower bound; double costs time only there.
"""
STEP_LENGTHS = 8
"""Step lengths tried in one BFGS step, each 0.3 times the one before. The last is 2e-4 of the
first. With half of them an ascent stops where the eigenvalue bends; double costs time at its end.
"""
BLOCKED_LENGTHS = 3
"""Step lengths tried before a real block that cannot keep the eigenvalue real is given up. The
eigenvalue then meets another one, at any length. With half of them a block is given up too soon;
double costs time.
"""
SETTLED_GAIN = 1e-9
"""An ascent ends when a step raises the eigenvalue by less than this share. Newton's method
continues from there. With half or double of it, an ascent takes a step more or less.
"""
SAME_DELTA = 0.03
"""Two Deltas count as the same if no entries differ by more than this; an ascent ends at a known
Delta. Entries have size 1 at most, and different maxima differ by far more. With half of it ascents
to a known maximum go on longer; with double of it an ascent may end at a lower neighbour.
"""
P, G, TRIAL, NEW, D, MOVED, CHANGE, HY, HELD, BOUNDED = range(10)
"""Rows of the workspace: parameters, gradient, both of the trial point, direction, last move,
change of the gradient, inverse Hessian times that change, and two rows of marks. A mark is 1 for a
parameter that is held at its bound, and for one that has bounds, as those of real blocks do.
"""
INVERSE = BOUNDED + 1
"""First row of the inverse Hessian of -lambda: the one after the named rows."""
FRESH: bool = np.bool_(True)  # type: ignore[assignment]
"""The ascent starts without its Hessian. A NumPy bool, because Numba would compile once more for a
Python constant.
"""
UNKNOWN_GAIN = 1e-6
"""A further ascent with a new unknown follows an ascent that raised the eigenvalue by at least this
share. That is far more than the rounding of an eigenvalue, and too little to be seen. Half or
double: an ascent more or less.
"""


@compiled
def ascend(M, table, delta, value):  # type: ignore[no-untyped-def]
    """Climb to a local maximum of the real eigenvalue of M Delta, and return it.

    The start ``delta`` (rows, columns) must have the real eigenvalue ``value``, and dyads as its
    full blocks; it is changed in place.
    """
    w, v = workspace(table, delta.shape[0], delta.shape[1])
    none = np.zeros(0), np.zeros((0, 0, 0), np.complex128)
    x, y = eigenvectors(M @ delta, value + 0j)
    w[X, : len(M)], w[Y, : len(M)] = x, y
    return polished_perturbation(M, table, delta, climb(M, table, delta, value, none, w, v), w)


@unchecked_kernel
def copy_delta(source, target):  # type: ignore[no-untyped-def]
    """Copy a Delta to an array that is as large or larger, or back from there."""
    for i in range(min(source.shape[0], target.shape[0])):
        for j in range(min(source.shape[1], target.shape[1])):
            target[i, j] = source[i, j]


@unchecked_kernel
def _distance(first, second):  # type: ignore[no-untyped-def]
    """Largest difference between entries of two Deltas."""
    largest = 0.0
    for i in range(first.shape[0]):
        for j in range(first.shape[1]):
            largest = max(largest, squared_size(first[i, j] - second[i, j]))
    return np.sqrt(largest)


@inlined
def polished_perturbation(M, table, delta, value, w):  # type: ignore[no-untyped-def]
    """Move Delta so that a nearly real eigenvalue is real to rounding; Delta is kept if that
    fails.
    """
    set_sensitivity(M, w)
    there = w[LOOP + 2 * w.shape[1] :]
    copy_delta(delta, there)
    free = best_unknown(table, delta, w)
    near = complex(value, 0.0)
    reached = realise(M, table, there, near, free, FINAL_TOLERANCE, w)[0]
    if reached > value * (1 - UNKNOWN_GAIN):
        copy_delta(there, delta)
        return reached
    return value


@unchecked_kernel
def climb(M, table, delta, value, known, w, v):  # type: ignore[no-untyped-def]
    """Climb from a Delta whose real eigenvalue and vectors x, y (in the workspace) are known.

    An ascent stops when a real block that is the unknown reaches an end of its interval; another
    ascent with a new unknown follows. ``known`` are the values (K,) and Deltas (K, rows, columns)
    at which ascents ended before. An ascent that comes near such a Delta from below ends with its
    value.
    """
    last = len(table)
    for _ in range(len(table)):
        set_sensitivity(M, w)
        free = best_unknown(table, delta, w)
        if free == last:
            break
        last, before = free, value
        value, met = _climb_once(M, table, delta, value, free, known, w, v)
        if met or value <= before * (1 + UNKNOWN_GAIN):
            break
    return value


@unchecked_kernel
def _value_near(delta, best, known):  # type: ignore[no-untyped-def]
    """The known value at a Delta near this one, if it is no less than the best so far; 0: none."""
    values, deltas = known
    for k in range(len(values)):
        if best <= values[k] and _distance(delta, deltas[k]) < SAME_DELTA:
            return values[k]
    return 0.0


@unchecked_kernel
def _climb_once(M, table, delta, value, free, known, w, v):  # type: ignore[no-untyped-def]
    """One ascent with the same unknown throughout, and whether it came to a known Delta."""
    there, count = w[LOOP + 2 * w.shape[1] :], v.shape[1]
    own, at = 0, 0
    for k in range(len(table)):
        v[BOUNDED, at] = 1.0 if table[k, 0] == REAL else 0.0
        own = at if k == free else own
        at += 2 * (table[k, 2] + table[k, 4]) if table[k, 0] == FULL else 1
    set_parameters(delta, table, v, P)
    best, phase, expected, length, weight = value, 0.0, 0.0, 0.0, 1.0 + 0j
    tries, fresh, started = 0, FRESH, False
    for _ in range(BFGS_STEPS * STEP_LENGTHS):
        # The first pass evaluates the start, a later one a point of the line.
        for i in range(count):
            v[TRIAL, i] = v[P, i] + length * v[D, i] if started else v[P, i]
            if v[BOUNDED, i] > 0:
                v[TRIAL, i] = min(max(v[TRIAL, i], -1.0), 1.0)
            v[MOVED, i] = v[TRIAL, i] - v[P, i]
        expected = 0.0
        if started:
            for i in range(count):
                expected += v[MOVED, i] * v[G, i]
        copy_pair(w, X, KEPT)
        set_delta(v, TRIAL, phase, table, there)
        near = complex(best + expected, 0.0)
        found, shift, weight = realise(M, table, there, near, free, SEARCH_TOLERANCE, w)
        if not started:
            if not found > value * (1 - UNKNOWN_GAIN):
                copy_pair(w, KEPT, X)
                break
        elif not (found > best and found > best + 1e-4 * expected):
            copy_pair(w, KEPT, X)
            length *= 0.3
            tries += 1
            blocked = free >= 0 and not found > 0
            if tries < (BLOCKED_LENGTHS if blocked else STEP_LENGTHS):
                continue
            if fresh or blocked:
                break
            fresh, tries = FRESH, 0
            length = _set_direction(v, best, FRESH)
            if not length > 0:
                break
            continue
        phase += shift
        if free >= 0:
            v[TRIAL, own] = there[table[free, 1], table[free, 3]].real
            v[MOVED, own] = v[TRIAL, own] - v[P, own]
        set_gradient(v, TRIAL, NEW, phase, there, table, weight, w)
        small = False
        if started:
            fresh = not _updated(v, fresh) and fresh
            small = found - best <= SETTLED_GAIN * best
        best, started, tries = found, True, 0
        for i in range(count):
            v[P, i], v[G, i] = v[TRIAL, i], v[NEW, i]
        copy_delta(there, delta)
        near_known = _value_near(delta, best, known)
        if near_known > 0:
            return near_known, True
        if small:
            break
        for i in range(count):
            now = v[BOUNDED, i] > 0 and (
                (v[P, i] >= 1 and v[G, i] > 0) or (v[P, i] <= -1 and v[G, i] < 0)
            )
            fresh = fresh or now != (v[HELD, i] > 0)
            v[HELD, i] = 1.0 if now else 0.0
        length = _set_direction(v, best, fresh)
        if length < 0:  # no ascent direction: the Hessian is spoilt
            fresh, length = FRESH, _set_direction(v, best, FRESH)
        if not length > 0:
            break
    return best, False


@unchecked_kernel
def _set_direction(v, best, fresh):  # type: ignore[no-untyped-def]
    """Set the direction of the next step, and return its first length.

    The length is 0 where the gradient vanishes, and -1 where the direction does not ascend.
    ``fresh`` resets the Hessian.
    """
    count, slope, largest = v.shape[1], 0.0, 0.0
    for i in range(count):
        total = 0.0 if v[HELD, i] > 0 else v[G, i]
        if fresh:
            for j in range(count):
                v[INVERSE + i, j] = 0.0
            v[INVERSE + i, i] = 1.0
        elif not v[HELD, i] > 0:
            total = 0.0
            for j in range(count):
                total += 0.0 if v[HELD, j] > 0 else v[INVERSE + i, j] * v[G, j]
        v[D, i] = total
        slope += total * v[G, i]
        largest = max(largest, abs(total))
    if not slope > (1e-13 * best) ** 2:
        return 0.0 if fresh else -1.0
    return min(1.0 / best, 0.3 / largest) if fresh else min(1.0, 1.0 / largest)


@unchecked_kernel
def _updated(v, first):  # type: ignore[no-untyped-def]
    """Update the inverse Hessian of -lambda from a step; False where it has no curvature."""
    count, sy, yy, ss = v.shape[1], 0.0, 0.0, 0.0
    for i in range(count):
        v[CHANGE, i] = 0.0 if v[HELD, i] > 0 else v[G, i] - v[NEW, i]
        step = 0.0 if v[HELD, i] > 0 else v[MOVED, i]
        sy += step * v[CHANGE, i]
        yy += v[CHANGE, i] * v[CHANGE, i]
        ss += step * step
    if not (sy > 0 and sy > 1e-14 * np.sqrt(ss * yy)):
        return False
    yhy = 0.0
    if first:
        for i in range(count):
            v[INVERSE + i, i] = sy / yy
    for i in range(count):
        total = 0.0
        for j in range(count):
            total += v[INVERSE + i, j] * v[CHANGE, j]
        v[HY, i] = total
        yhy += total * v[CHANGE, i]
    for i in range(count):
        for j in range(count):
            s, t = 0.0 if v[HELD, i] > 0 else v[MOVED, i], 0.0 if v[HELD, j] > 0 else v[MOVED, j]
            v[INVERSE + i, j] += ((1 + yhy / sy) * s * t - v[HY, i] * t - s * v[HY, j]) / sy
    return True
