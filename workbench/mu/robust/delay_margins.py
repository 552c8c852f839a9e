"""Delays [s] that a loop with uncertain delays tolerates, and delays that are too long."""

from __future__ import annotations

import math

import numpy as np

from workbench.certify.stability import is_proven_unstable
from workbench.certify.stable_system import StableSystem
from workbench.mu.frequency.channels import even_channels
from workbench.mu.frequency.peak import peak
from workbench.mu.robust.lone_delay import first_delay, loop_about, with_delay_of
from workbench.structure import Structure
from workbench.uncertainty.algebra.delays import DelayElement
from workbench.uncertainty.algebra.system import UncertainSystem

SHORTEST, LONGEST = 1e-6, 1e6
"""Least and largest delay that is tried, as a multiple of the longest delay of the set. Delays
beyond have no meaning for a set stated so. Half or double only changes what is called 0 or
infinite.
"""
BISECTIONS = 40
"""Largest number of delays tried for one bound: 20 doublings reach `LONGEST`, and ten bisections
leave `PROOF_TOLERANCE`. With half of them bounds may stay apart; more are hardly made.
"""
LEAST_GROWTH = 1e-6
"""Least growth during one delay that counts as unstable: in doubles, a pole at 0 is found on either
side. Half or double moves that border of what counts as growth.
"""
PROOF_TOLERANCE = 1e-3
"""Tolerance of the peaks of mu that prove a delay. A delay is then known to about that share. Half
takes longer for the same two or three digits; double loosens a third digit.
"""
DELAY_RATIO = 1.05
"""Ratio of one delay to the previous one in the search for a delay that is too long. The delay
found is bisected later, so the ratio only matters where a loop is lost and kept again in between.
With half of the distance from 1 the search takes twice as long; with double of it such delays are
missed more often, and the upper bound is looser.
"""
LOST_EXCESS = 1e-6
"""The reported delay exceeds the delay that puts a pole on the axis by this share. The pole then is
right of the axis by more than its rounding. With half of it fewer are proven unstable at once;
double loosens the sixth digit.
"""


def delay_margins(found: UncertainSystem, tolerance: float) -> dict[str, tuple[float, float]]:
    """Two delays [s] by name: stable for all delays up to the first, unstable for the second.

    The first bound is proven with all other uncertainty at full size, by a cover of all delays up
    to it; it is 0 if nothing is proven. If nothing else is uncertain, it is exact but for a share
    of 1e-6, and infinite if the loop tolerates every delay. The second bound is a delay with which
    the loop is unstable for nominal values of all other elements; it is infinite if none was found.
    """
    return {
        name: (_longest_proven(found, element, tolerance), _shortest_unstable(found, element))
        for name, element in found.elements.items()
        if isinstance(element, DelayElement)
    }


def delay_is_borne(found: UncertainSystem, name: str, high: float) -> bool:
    """Whether stability is proven for delays up to ``high`` [s], whatever the other elements
    are.
    """
    if len(found.elements) == 1 and (first := _first_on_axis(found, name)) is not None:
        return high < first or math.isinf(first)
    return peak(*_with_delays_up_to(found, name, high), tolerance=PROOF_TOLERANCE).upper < 1.0


def delay_is_lost(found: UncertainSystem, name: str, tau: float) -> bool:
    """Whether the loop with this delay, all other elements nominal, is proven to be unstable."""
    exact = loop_about(found, name)
    late = None if exact is None else with_delay_of(exact, tau)
    if late is not None:
        return (late.unstable_poles() or 0) > 0
    loop = found.at(**{name: tau})
    growth = np.asarray(loop.poles()).real.max(initial=-math.inf)
    # Doubles give poles of very different speeds with the absolute error of the fastest one.
    return bool(growth * tau > LEAST_GROWTH) and is_proven_unstable(np.asarray(loop.A), False)


def _first_on_axis(found: UncertainSystem, name: str) -> float | None:
    """The least delay that puts a pole on the axis, all other elements nominal; None if it cannot
    be computed.
    """
    loop = loop_about(found, name)
    return None if loop is None else first_delay(loop)


def _longest_proven(found: UncertainSystem, element: DelayElement, tolerance: float) -> float:
    """The longest delay up to which stability is proven."""
    if (first := _first_on_axis(found, element.name)) is not None and len(found.elements) == 1:
        return (1 - LOST_EXCESS) * first
    low, high = 0.0, math.inf
    tried = element.high
    for _ in range(BISECTIONS):
        if delay_is_borne(found, element.name, tried):
            low = tried
        else:
            high = tried
        if high <= low * (1.0 + max(tolerance, PROOF_TOLERANCE)):
            break
        if not SHORTEST <= tried / element.high <= LONGEST:
            break
        if math.isinf(high):
            tried = 2.0 * low
        else:
            tried = high / 2.0 if low == 0.0 else math.sqrt(low * high)
    return low


def _with_delays_up_to(
    found: UncertainSystem, name: str, high: float
) -> tuple[StableSystem, Structure]:
    """The system that Delta closes, with the set's delay limited to `high`."""
    import control

    structure = found.structure
    into = structure.column_slices[list(found.elements).index(name)]
    element = found.elements[name]
    assert isinstance(element, DelayElement)
    factor, one = element.shortened(high), control.ss([], [], [], [[1.0]])
    seen = found.system[: structure.columns, : structure.rows]
    parts = [factor if into.start <= at < into.stop else one for at in range(seen.noutputs)]
    filtered = control.append(*parts) * seen
    return even_channels(filtered, structure)[0], structure


def _shortest_unstable(found: UncertainSystem, element: DelayElement) -> float:
    """A delay near the shortest one with which the loop, all other elements nominal, is
    unstable.
    """
    if (first := _first_on_axis(found, element.name)) is not None:
        if math.isinf(first):
            return first
        if delay_is_lost(found, element.name, (1 + LOST_EXCESS) * first):
            return (1 + LOST_EXCESS) * first
    low = high = SHORTEST * element.high
    while not delay_is_lost(found, element.name, high):
        low, high = high, high * DELAY_RATIO
        if high > LONGEST * element.high:
            return math.inf
    for _ in range(BISECTIONS):
        middle = math.sqrt(low * high)
        lost = delay_is_lost(found, element.name, middle)
        low, high = (low, middle) if lost else (middle, high)
    return high
