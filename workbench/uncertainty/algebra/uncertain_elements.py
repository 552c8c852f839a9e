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
        A name such as "k"; whatever has the same name is the same parameter.
    nominal
        Its nominal value, which may be 0.
    percent, plus_minus
        Its range: so many percent of the nominal, or so much, to either side.
    low, high
        Or its ends, the nominal between them and not necessarily in the middle.

    Raises
    ------
    InputError
        No range or more than one; or the nominal is not inside.
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
                f"{name} has nominal 0, of which no percent is a range: give low, high"
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
    """Unknown stable linear dynamics, of which only a bound of the gain is known.

    Parameters
    ----------
    inputs, outputs
        Its numbers of channels.
    bound
        Its largest singular value over frequency: a number, or a stable system W of one input and
        one output, whose magnitude it is.
    """
    need_count("inputs", inputs)
    need_count("outputs", outputs)
    element = DynamicElement(name, int(outputs), int(inputs))
    size = len(element.channels)
    # Channel k reads input k and drives output k, as far as there are so many.
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

    With low equal to high it is known dead time: `workbench.mu.loop_margins`,
    `workbench.mu.robust_stability` and ``response`` take it as it is, whatever needs states refuses
    it by name, and `without_dead_time` replaces it by a Pade approximation and a bound of its
    error.

    An uncertain delay is no fraction of polynomials. In analysis it is 1 + W delta with a W that
    covers |exp(-j omega tau) - 1| up to `high`, and any delta of gain at most 1: the set has every
    delay from 0 to high and more, as any phase of delta counts. A margin below 1 is a factor of
    that delta and no factor of the delay; `workbench.mu.robust_stability` tells in seconds which
    delays are borne, exactly where nothing else is uncertain. ``at(tau=...)`` and ``sample`` have
    the delays themselves, by Pade approximations.

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
            f"{name}: a delay of {high!r} s, whose cover is beyond doubles; from {SHORTEST_DELAY} "
            f"to {LONGEST_DELAY} s are covered: take another unit of time"
        )
    element = DelayElement(name, float(low), float(high))
    delta = UncertainSystem(LFT(np.array([[0.0, 1.0], [1.0, 0.0]]), (name,)), {name: element})
    return 1.0 + element.cover * delta
