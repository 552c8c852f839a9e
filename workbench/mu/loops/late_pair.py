"""The channels of a nominal plant and a nominal controller with known dead time."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from workbench.mu.loops.characteristic import LateChannels
from workbench.mu.loops.coupled_loop import CoupledLoops
from workbench.mu.loops.encirclements import need_decaying
from workbench.uncertainty.algebra.dead_time import dead_times
from workbench.uncertainty.algebra.lft import INTEGRATOR, diagonal
from workbench.uncertainty.algebra.rational_delays import nominal_but_late
from workbench.uncertainty.algebra.system import UncertainSystem


def late_pair(G: UncertainSystem, K: UncertainSystem) -> CoupledLoops:
    """The loops of u = -K y, y = G u; the channels are the plant's inputs and then its outputs.

    Raises InputError if the loop is not well posed or has too many dead times, or if the gains that
    return with dead time are too large at infinite frequency.
    """
    late = dead_times({**G.elements, **K.elements})
    whole = diagonal(*(nominal_but_late(one).value for one in (G, K)))
    r, (p, m) = len(whole.names), G.value.shape
    states = [k for k, name in enumerate(whole.names) if name == INTEGRATOR]
    delayed = [k for k, name in enumerate(whole.names) if name in late]
    outputs, inputs = r + np.arange(p + m), r + np.arange(m + p)
    # The outputs are y = G u and K y. They are fed back to the inputs y and u = -K y.
    rows = [*states, *delayed, *outputs[p:], *outputs[:p]]
    Q = whole.M[np.ix_(rows, [*states, *delayed, *inputs])].copy()
    Q[len(Q) - m - p : len(Q) - p] *= -1.0
    delays = tuple(Fraction(late[whole.names[k]].delay) for k in delayed)
    found = CoupledLoops(LateChannels(Q, len(states), delays))
    need_decaying(found.channels.closed)
    return found
