"""Uncertain elements: parameters, complex numbers, dynamics and delays."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from workbench.errors import InputError
from workbench.input_checks import is_real, need_count, need_numbers, need_positive
from workbench.uncertainty.algebra.connections import append
from workbench.uncertainty.algebra.dead_time import DeadTime
from workbench.uncertainty.algebra.delays import LONGEST_DELAY, SHORTEST_DELAY, DelayElement
from workbench.uncertainty.algebra.elements import ComplexElement, DynamicElement, RealElement
from workbench.uncertainty.algebra.lft import LFT
from workbench.uncertainty.algebra.system import UncertainSystem, uncertain


def real(
    name: str,
    nominal: float,
    *,
    percent: float | None = None,
    plus_minus: float | None = None,
    low: float | None = None,
    high: float | None = None,
) -> UncertainSystem:
    """An uncertain real parameter.

    Parameters
    ----------
    name
        A name such as "k"; elements with the same name are the same parameter.
    nominal
        The nominal value, which may be 0.
    percent, plus_minus
        The range on each side of the nominal: a percentage of it, or an amount.
    low, high
        Alternatively the ends of the range. The nominal lies between them, not necessarily in the
        middle.

    Raises
    ------
    InputError
        No range is given, or more than one; or the nominal is not inside the range.
    """
    need_numbers(nominal=nominal)
    if not math.isfinite(nominal):
        raise InputError(f"nominal is {nominal!r}; it must be finite")
    ways = [percent is not None, plus_minus is not None, low is not None or high is not None]
    if sum(ways) != 1:
        raise InputError(f"{name}: give one of percent=, plus_minus=, or low= with high=")
    if percent is not None:
        need_positive(percent, "percent")
        plus_minus = abs(nominal) * percent / 100.0
        if not plus_minus:
            raise InputError(
                f"{name} has nominal 0, for which a percentage gives no range: give low, high"
            )
    if plus_minus is not None:
        need_positive(plus_minus, "plus_minus")
        low, high = nominal - plus_minus, nominal + plus_minus
    if low is None or high is None:
        raise InputError(f"{name}: low and high belong together, one of them is missing")
    need_numbers(low=low, high=high)
    if not (math.isfinite(low) and math.isfinite(high) and low < nominal < high):
        raise InputError(f"{name}: nominal {nominal:g} must lie between low {low} and high {high}")
    element = RealElement(name, float(nominal), float(low), float(high))
    M = np.array([[element.bend, 1.0], [element.slope, element.nominal]])
    return UncertainSystem(LFT(M, (name,)), {name: element})


def complex_scalar(name: str, nominal: float, radius: float) -> UncertainSystem:
    """An uncertain complex number within a radius of a real nominal.

    Examples
    --------
    >>> from workbench.uncertainty import complex_scalar, tf
    >>> G = complex_scalar("g", 2.0, radius=0.3) * tf([1], [1, 1])
    >>> float(G.nominal.dcgain()), len(G.structure)
    (2.0, 1)
    """
    need_numbers(nominal=nominal)
    if not math.isfinite(nominal):
        raise InputError(f"nominal is {nominal!r}; it must be finite")
    need_positive(radius, "radius")
    element = ComplexElement(name, float(nominal), float(radius))
    M = np.array([[0.0, 1.0], [element.radius, element.nominal]])
    return UncertainSystem(LFT(M, (name,)), {name: element})


def dynamics(name: str, inputs: int, outputs: int, *, bound: Any = 1.0) -> UncertainSystem:
    """Unknown stable linear dynamics with a known bound on the gain.

    Parameters
    ----------
    inputs, outputs
        Numbers of inputs and outputs.
    bound
        Bound on the largest singular value at every frequency: a number, or the magnitude of a
        stable system W with one input and one output.
    """
    need_count("inputs", inputs)
    need_count("outputs", outputs)
    element = DynamicElement(name, int(outputs), int(inputs))
    size = len(element.channels)
    # Channel k reads input k and drives output k, if these exist.
    M = np.zeros((size + outputs, size + inputs))
    M[:inputs, size:] = np.eye(inputs)
    M[size:, :outputs] = np.eye(outputs)
    found = UncertainSystem(LFT(M, element.channels), {name: element})
    if is_real(bound):
        need_positive(bound, "bound")
        return found if bound == 1.0 else bound * found
    weight = uncertain(bound, "bound")
    if (weight.noutputs, weight.ninputs) != (1, 1):
        raise InputError(
            f"bound has {weight.noutputs} outputs and {weight.ninputs} inputs; one of each is "
            "needed"
        )
    if weight.nominal.poles().real.max(initial=-math.inf) >= 0 and not weight.dt:
        raise InputError(f"bound is unstable, its poles are {weight.nominal.poles()}")
    if outputs <= inputs:
        return append(*[weight] * outputs) @ found
    return found @ append(*[weight] * inputs)


def delay(name: str, low: float, high: float) -> UncertainSystem:
    """A delay exp(-s tau), tau from low to high [s], in continuous time.

    If low equals high, it is known dead time. `workbench.mu.loop_margins`,
    `workbench.mu.robust_stability` and ``response`` use it exactly. Functions that need states
    refuse it with an error that has its name. `dead_time_approximation` replaces it by a Pade
    approximation and a bound on the error.

    An uncertain delay is not a rational function. Analysis replaces it by 1 + W delta, where W
    covers |exp(-j omega tau) - 1| up to `high`, and delta is any dynamics with gain at most 1. This
    set contains every delay from 0 to high, and more, since delta may have any phase. A margin
    below 1 is a factor on delta, not on the delay. `workbench.mu.robust_stability` gives in seconds
    the delays that the loop tolerates, exactly if nothing else is uncertain. ``at(tau=...)`` and
    ``sample`` use the delays themselves, by Pade approximations.

    Raises
    ------
    InputError
        The delays are negative, or not in order.

    Examples
    --------
    >>> from workbench.uncertainty import delay, tf
    >>> late = tf([1], [1, 1]) * delay("tau", 0.0, 0.1)
    >>> [block.name for block in late.structure]
    ['tau']
    >>> known = tf([1], [1, 1]) * delay("tau", 0.1, 0.1)
    >>> known.response([0.0]).item()
    (1+0j)
    """
    need_numbers(low=low, high=high)
    if not 0.0 <= low <= high < math.inf or not high > 0.0:
        raise InputError(
            f"{name}: delays from {low!r} to {high!r} s; 0 <= low <= high and high > 0 are needed"
        )
    if low == high:
        known = DeadTime(name, float(high))
        return UncertainSystem(
            LFT(np.array([[0.0, 1.0], [1.0, 0.0]]), (name,)), {name: known}, dt=0.0
        )
    if not SHORTEST_DELAY <= high <= LONGEST_DELAY:
        raise InputError(
            f"{name}: a delay of {high!r} s has no cover in doubles; delays from {SHORTEST_DELAY} "
            f"to {LONGEST_DELAY} s have one: take another unit of time"
        )
    element = DelayElement(name, float(low), float(high))
    delta = UncertainSystem(LFT(np.array([[0.0, 1.0], [1.0, 0.0]]), (name,)), {name: element})
    return 1.0 + element.cover * delta
