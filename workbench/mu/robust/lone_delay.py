"""The loop around one uncertain delay, with the delay itself instead of the disk that covers it.

In a system the delay is 1 + W delta: the states of W are driven by delta alone, and their outputs
enter wherever the delayed signal does. These states are found by comparing entries, and left out.
The rest, with all other elements nominal, is a loop L exp(-s tau) of one channel, whose poles are
counted exactly (`workbench.mu.loops.delayed_loop`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.mu.loops.crossings import exact_loop
from workbench.mu.loops.delayed_loop import DelayedLoop
from workbench.systems.realisation import realisation
from workbench.uncertainty.algebra.dead_time import channels_pulled_out, closed_with
from workbench.uncertainty.algebra.delays import DelayElement
from workbench.uncertainty.algebra.lft import INTEGRATOR, LFT
from workbench.uncertainty.algebra.system import UncertainSystem, uncertain

ENTRY_ROUNDING = 1e-12
"""Relative difference allowed between products of entries and those computed again. It is 4,500
roundings, as products of a realisation have. With half of it the sharp way is used less often; with
double of it a delay seen twice, 2e-12 apart, would count as one.
"""


def loop_about(found: UncertainSystem, name: str) -> StateSpace | None:
    """L of the loop around a delay, closed with negative feedback; None if it cannot be
    isolated.
    """
    element = found.elements[name]
    names = found.value.names
    if not isinstance(element, DelayElement) or names.count(name) != 1:
        return None
    t, M = names.index(name), found.value.M
    states = [k for k, one in enumerate(names) if one == INTEGRATOR]
    W = uncertain(element.cover).value
    n = W.M.shape[0] - 1
    for first in range(len(states) - n + 1):
        own = states[first : first + n]
        rest = [k for k in states if k not in own]
        if np.array_equal(M[np.ix_([*own], [*own, t])], W.M[:n]) and not M[np.ix_(own, rest)].any():
            break
    else:
        return None
    given, direct = W.M[n, :n], W.M[n, n]
    enters, d = M[rest, t] / direct, M[t, t] / direct
    seen = np.append(enters, d)
    repeated = np.abs(M[np.ix_([*rest, t], own)] - np.outer(seen, given))
    if (repeated > ENTRY_ROUNDING * np.outer(np.abs(seen), np.abs(given))).any() or d == -1.0:
        return None
    # With the delay's output w and its input z, w - z enters where w did, in addition to z.
    c = M[t, rest]
    A = M[np.ix_(rest, rest)] - np.outer(enters, c) / (1.0 + d)
    parts = A, enters[:, None] / (1.0 + d), -c[None] / (1.0 + d), np.array([[-d / (1.0 + d)]])
    return realisation(parts, 0.0)


def loop_about_dead_time(
    found: UncertainSystem, name: str, deltas: Mapping[str, float]
) -> StateSpace | None:
    """L of the loop around a known dead time, with normalised values of real elements by name.

    None if the dead time occurs more than once, or if the system divides by zero with these values.
    """
    pulled, channels = channels_pulled_out(found.value, list(deltas))
    try:
        closed = closed_with(pulled, [LFT(np.array([[deltas[one]]])) for one in channels])
    except InputError:
        return None
    if closed.names.count(name) != 1 or {*closed.names} - {name, INTEGRATOR}:
        return None
    t, M = closed.names.index(name), closed.M
    states = [k for k, one in enumerate(closed.names) if one == INTEGRATOR]
    parts = M[np.ix_(states, states)], M[states, t][:, None], -M[t, states][None], -M[[t]][:, [t]]
    return realisation(parts, 0.0)


def with_delay_of(L: StateSpace, tau: float) -> DelayedLoop | None:
    """L exp(-s tau); None if |L| is 1 or more at infinity, so that the loop tolerates no delay."""
    return DelayedLoop(exact_loop(L, L), Fraction(tau)) if abs(L.D[0, 0]) < 1.0 else None


def first_delay(L: StateSpace) -> float | None:
    """The least delay [s] that puts a pole of a stable loop on the axis; infinite if there is none.

    None if the loop is not stable without delay, or tolerates no delay at all.
    """
    loop = with_delay_of(L, 0.0)
    if loop is None or not loop.stable():
        return None
    phases = ((one.omega, float(np.angle(-one.value))) for one in loop.unit_crossings())
    return min((math.fmod(p + 2 * math.pi, 2 * math.pi) / w for w, p in phases), default=math.inf)
