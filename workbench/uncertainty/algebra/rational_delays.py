"""Rational systems for systems with known dead time: exact if it is in series, else approximate."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

from workbench.input_checks import need_count
from workbench.uncertainty.algebra import dead_time
from workbench.uncertainty.algebra.lft import LFT
from workbench.uncertainty.algebra.system import UncertainSystem, uncertain
from workbench.uncertainty.algebra.uncertain_elements import dynamics


def dead_time_approximation(system: Any, *, order: int = 6) -> UncertainSystem:
    """The system with known dead time replaced by a Pade approximation and an uncertain error.

    exp(-s T) = P (1 + W delta), where P is the diagonal Pade approximation. The dynamics delta have
    a gain of at most 1 and the name of the dead time. |W| is at least the relative error of P at
    every frequency; at low frequencies it is 2 sqrt(2) (omega T / a)^order, with a = 10.1 for order
    6. So everything proven for the whole set also holds for the dead time itself. A factor on the
    size of the uncertainty also scales this error.

    Parameters
    ----------
    system
        An `UncertainSystem` with known dead time; a system without it is returned unchanged.
    order
        Order of P and of W; with a higher order P is accurate up to higher frequencies.

    Raises
    ------
    InputError
        The order is not a positive integer, or the loop is singular because of its direct terms.

    Examples
    --------
    >>> from workbench.mu import robust_stability
    >>> from workbench.uncertainty import delay, feedback, tf, dead_time_approximation
    >>> closed = feedback(tf([1], [1, 1]) * delay("tau", 1.0, 1.0), 1)
    >>> robust_stability(dead_time_approximation(closed)).lower > 1
    True

    Source: G. A. Baker, P. Graves-Morris, Pade Approximants, 1996; the bound is derived in
    `workbench.uncertainty.algebra.dead_time`.
    """
    need_count("order", order)
    given = uncertain(system, "system")
    late = dead_time.dead_times(given.elements)
    if not late:
        return given
    pulled, names = dead_time.channels_pulled_out(given.value, list(late))
    parts = {name: _covered(one, order) for name, one in late.items()}
    value = dead_time.closed_with(pulled, [parts[name].value for name in names])
    known = {name: part.elements[name] for name, part in parts.items()}
    return UncertainSystem(value, {**given.elements, **known}, dt=given.dt)


def rational_part(system: UncertainSystem) -> tuple[Fraction | None, UncertainSystem]:
    """T and R if the nominal system is R exp(-s T); T is None if it is no such product."""
    late = dead_time.dead_times(system.elements)
    nominal = nominal_but_late(system).value
    total = dead_time.total_delay(nominal, {name: one.delay for name, one in late.items()})
    pulled, names = dead_time.channels_pulled_out(nominal, list(late))
    value = dead_time.closed_with(pulled, [LFT(np.eye(1))] * len(names))
    return total, UncertainSystem(value, {}, dt=system.dt)


def nominal_but_late(system: UncertainSystem) -> UncertainSystem:
    """The system with its known dead time, and all uncertain elements at their nominal."""
    late = dead_time.dead_times(system.elements)
    others = [name for name in system.elements if name not in late]
    channels = [one for name in others for one in system.elements[name].channels]
    certain, names = dead_time.channels_pulled_out(system.value, channels)
    first, d = len(certain.names), len(names)
    M = np.delete(certain.M, np.s_[first : first + d], axis=0)
    M = np.delete(M, np.s_[first : first + d], axis=1)
    return UncertainSystem(LFT(M, certain.names), late, dt=system.dt)


def _covered(one: dead_time.DeadTime, order: int) -> UncertainSystem:
    """The element of a dead time, replaced by P (1 + W delta)."""
    error = dynamics(one.name, 1, 1, bound=dead_time.pade_error(one.delay, order))
    whole: UncertainSystem = uncertain(dead_time.pade(one.delay, order)) * (1.0 + error)
    return whole
