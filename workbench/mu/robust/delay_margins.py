"""Uncertain delays that a loop bears, in seconds: how long they may be, and what is too long."""

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
"""Delays that are tried, as shares of the longest one of the set."""
BISECTIONS = 40
"""Most delays that are tried for one bound."""
GROWS = 1e-6
"""Least growth in the time of a delay that counts as one: a pole at 0 is found to either side."""
PROOF_TOLERANCE = 1e-3
"""Tolerance of the peaks of mu that prove a delay."""
STEP = 1.05
"""Factor from one delay to the next in the search for one that is too long."""
BESIDE = 1e-6
"""Share by which a delay is told beside the one that puts a pole on the axis."""


def delay_margins(found: UncertainSystem, tolerance: float) -> dict[str, tuple[float, float]]:
    """Delays [s] by name: stable for all up to the first, unstable for the second.

    The first is proven with all other uncertainty at its full size, by the cover of all delays up
    to it; it is 0 where nothing is proven. Where nothing else is uncertain it is that of the delay
    itself, exact but for a share of 1e-6, and infinite where every delay is borne. With the second,
    all else nominal, the loop is unstable; it is infinite where none was found.
    """
    return {
        name: (_borne(found, element, tolerance), _lost(found, element))
        for name, element in found.elements.items()
        if isinstance(element, DelayElement)
    }


def delay_is_borne(found: UncertainSystem, name: str, high: float) -> bool:
    """Whether stability is proven for all delays up to one, whatever the other elements are."""
    if len(found.elements) == 1 and (first := _first(found, name)) is not None:
        return high < first or math.isinf(first)
    return peak(*_up_to(found, name, high), tolerance=PROOF_TOLERANCE).upper < 1.0


def delay_is_lost(found: UncertainSystem, name: str, tau: float) -> bool:
    """Whether the loop of the nominals is proven to be unstable with a delay."""
    exact = loop_about(found, name)
    late = None if exact is None else with_delay_of(exact, tau)
    if late is not None:
        return (late.unstable_poles() or 0) > 0
    loop = found.at(**{name: tau})
    growth = np.asarray(loop.poles()).real.max(initial=-math.inf)
    # Poles of times far apart come from doubles with the error of the fastest.
    return bool(growth * tau > GROWS) and is_proven_unstable(np.asarray(loop.A), False)


def _first(found: UncertainSystem, name: str) -> float | None:
    """The delay that first puts a pole on the axis, all else nominal; None where it is not seen."""
    loop = loop_about(found, name)
    return None if loop is None else first_delay(loop)


def _borne(found: UncertainSystem, element: DelayElement, tolerance: float) -> float:
    """The longest delay up to which stability is proven."""
    if (first := _first(found, element.name)) is not None and len(found.elements) == 1:
        return (1 - BESIDE) * first
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


def _up_to(found: UncertainSystem, name: str, high: float) -> tuple[StableSystem, Structure]:
    """The system that Delta closes, where the set has this delay's values up to `high` only."""
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


def _lost(found: UncertainSystem, element: DelayElement) -> float:
    """A delay with which the loop of all else nominal is unstable, near the shortest one."""
    if (first := _first(found, element.name)) is not None:
        if math.isinf(first):
            return first
        if delay_is_lost(found, element.name, (1 + BESIDE) * first):
            return (1 + BESIDE) * first
    low = high = SHORTEST * element.high
    while not delay_is_lost(found, element.name, high):
        low, high = high, high * STEP
        if high > LONGEST * element.high:
            return math.inf
    for _ in range(BISECTIONS):
        middle = math.sqrt(low * high)
        lost = delay_is_lost(found, element.name, middle)
        low, high = (low, middle) if lost else (middle, high)
    return high
