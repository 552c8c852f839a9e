"""Uncertain elements, systems with uncertain coefficients, and their connections."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag as block_diagonal

from workbench.errors import InputError
from workbench.input_checks import as_list, is_real, need_count, need_numbers, need_positive
from workbench.systems.balancing import singular
from workbench.uncertainty.algebra.dead_time import DeadTime
from workbench.uncertainty.algebra.delays import DelayElement
from workbench.uncertainty.algebra.elements import (
    ComplexElement,
    DynamicElement,
    Element,
    RealElement,
)
from workbench.uncertainty.algebra.lft import INTEGRATOR, LFT, diagonal, lift, linked, matrix
from workbench.uncertainty.algebra.system import (
    UncertainSystem,
    combined_elements,
    common_time,
    uncertain,
)

# --- elements -------------------------------------------------------------------------------------


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


def dynamics(name: str, inputs: int, outputs: int, bound: Any = 1.0) -> UncertainSystem:
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

    With low equal to high it is known dead time: `workbench.mu.loop_margins` and ``response`` take
    it exactly as it is, whatever needs states refuses it by name, and `without_dead_time` replaces
    it by a Pade approximation and a bound of its error.

    An uncertain delay is no fraction of polynomials. In analysis it is 1 + W delta with a W that
    covers |exp(-j omega tau) - 1| up to `high`, and any delta of gain at most 1: the set has every
    delay from 0 to high and more, as any phase of delta counts. A margin below 1 is a factor of
    that delta and no factor of the delay; `workbench.mu.robust_stability` tells in seconds which
    delays are borne. ``at(tau=...)`` and ``sample`` have the delays themselves, by Pade
    approximations.

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
        return UncertainSystem(LFT(np.array([[0.0, 1.0], [1.0, 0.0]]), (name,)), {name: known}, 0.0)
    element = DelayElement(name, float(low), float(high))
    delta = UncertainSystem(LFT(np.array([[0.0, 1.0], [1.0, 0.0]]), (name,)), {name: element})
    return 1.0 + element.cover * delta


# --- systems with uncertain coefficients ----------------------------------------------------------


def ss(A: Any, B: Any, C: Any, D: Any, dt: float | None = 0.0) -> UncertainSystem:
    """A state-space system whose matrices have uncertain entries.

    Each is an array of numbers, an uncertain matrix, or a list of rows of numbers and uncertain
    numbers. Repetitions of elements are reduced as far as `UncertainSystem.reduced` does.

    Examples
    --------
    >>> from workbench.uncertainty import real, ss
    >>> k = real("k", 4, percent=25)
    >>> G = ss([[0, 1], [-k, -0.5]], [[0], [1]], [[1, 0]], [[0]])
    >>> float(G.at(k=5.0).dcgain())
    0.2
    """
    if all(isinstance(part, list | tuple) and not any(part) for part in (A, B, C)):
        direct = _matrix(D, "D")  # as python-control's ss([], [], [], D): a static system
        return replace(direct, dt=dt or direct.dt)
    parts = [_matrix(given, name) for given, name in ((A, "A"), (B, "B"), (C, "C"), (D, "D"))]
    states = parts[0].noutputs
    if parts[0].ninputs != states:
        raise InputError(f"A has shape {parts[0].value.shape}; it must be square")
    if parts[3].value.shape == (1, 1) and _is_zero(parts[3]):  # as of python-control, for no D
        parts[3] = uncertain(np.zeros((parts[2].noutputs, parts[1].ninputs)))
    whole = matrix([[parts[0].value, parts[1].value], [parts[2].value, parts[3].value]])
    return _with_states(lift(whole), states, combined_elements(parts), dt)


def tf(num: Any, den: Any, dt: float | None = 0.0) -> UncertainSystem:
    """A transfer function whose coefficients, the highest power first, may be uncertain.

    Each coefficient enters the realisation once, so that bounds of what it does are tight.
    """
    above = [_number(one, "num") for one in _coefficients(num, "num")]
    below = [_number(one, "den") for one in _coefficients(den, "den")]
    while below and _is_zero(below[0]):
        below = below[1:]
    while above and _is_zero(above[0]):
        above = above[1:]
    if not below:
        raise InputError("den is zero; a coefficient other than 0 is needed")
    order = len(below) - 1
    if len(above) - 1 > order:
        raise InputError(
            f"num has degree {len(above) - 1}, above that of den, {order}: the system is improper"
        )
    if singular(below[0].nominal.D):
        raise InputError("the highest coefficient of den is 0 at the nominal")
    b = [uncertain(0.0)] * (order + 1 - len(above)) + above
    if not order:
        return b[0] / below[0]
    # a_n y = x_1 + b_n u and x_i' = x_(i+1) + b_(n-i) u - a_(n-i) y: each coefficient stands once.
    first = [*np.eye(order)[0], b[0].value]
    chain = [[*row, one.value] for row, one in zip(np.eye(order, k=1), b[1:], strict=True)]
    output = lift(matrix([first])) / below[0].value
    back = matrix([*([-one.value] for one in below[1:]), [1.0]])
    whole = lift(matrix([*chain, [0.0] * (order + 1)])) + lift(back) @ output
    return _with_states(whole, order, combined_elements([*b, *below]), dt)


def _with_states(
    whole: LFT, states: int, elements: dict[str, Element], dt: float | None
) -> UncertainSystem:
    """The system of [A B; C D] with so many states, its repetitions of elements reduced."""
    value = LFT(whole.M, whole.names + (INTEGRATOR,) * states)
    return UncertainSystem(value, elements, dt)._used().reduced()


def _matrix(given: Any, name: str) -> UncertainSystem:
    """An uncertain matrix from what people write for one."""
    if isinstance(given, UncertainSystem):
        return _constant(given, name)
    if not isinstance(given, list | tuple):
        try:
            whole = np.atleast_2d(given) if np.ndim(given) else given
        except (RuntimeError, TypeError, ValueError) as error:
            raise InputError(f"{name} is no matrix: {error}") from None
        return _constant(uncertain(whole, name), name)
    rows = [as_list(row, f"a row of {name}") for row in given]
    parts = [[_number(entry, name) for entry in row] for row in rows]
    if len({len(row) for row in parts}) != 1:
        raise InputError(f"{name} has rows of lengths {[len(row) for row in parts]}; one is needed")
    value = matrix([[entry.value for entry in row] for row in parts])
    flat = [entry for row in parts for entry in row]
    return UncertainSystem(value, combined_elements(flat))


def _coefficients(given: Any, name: str) -> list[Any]:
    """The coefficients of a polynomial, from a list or from one number."""
    one = is_real(given) or isinstance(given, UncertainSystem)
    return [given] if one else as_list(given, name)


def _number(given: Any, name: str) -> UncertainSystem:
    found = _constant(uncertain(given, f"an entry of {name}"), name)
    if found.value.shape != (1, 1):
        raise InputError(f"an entry of {name} has shape {found.value.shape}; a number is needed")
    return found


def _constant(found: UncertainSystem, name: str) -> UncertainSystem:
    """An uncertain constant; raises InputError where it has states."""
    if found.nstates:
        raise InputError(f"{name} holds a system with {found.nstates} states; constants are needed")
    return found


def _is_zero(found: UncertainSystem) -> bool:
    return not found.elements and not found.value.M.any()


# --- connections ----------------------------------------------------------------------------------


def append(*systems: Any) -> UncertainSystem:
    """Systems beside each other: the inputs and outputs of the first, then of the second, ...

    Examples
    --------
    >>> from workbench.uncertainty import append, real, tf
    >>> two = append(tf([1], [1, real("a", 1, percent=20)]), 3.0)
    >>> two.noutputs, two.ninputs
    (2, 2)
    """
    if not systems:
        raise InputError("append needs at least one system")
    parts = [uncertain(one, f"system {k}") for k, one in enumerate(systems, start=1)]
    value = diagonal(*(part.value for part in parts))
    return UncertainSystem(value, combined_elements(parts), common_time(parts))


def block(rows: Sequence[Sequence[Any]]) -> UncertainSystem:
    """A system of blocks as `numpy.block` puts arrays together: [[a, b], [c, d]].

    Blocks of a row have the same outputs, those of a column the same inputs. Each is a system or a
    model of any kind, a number or an array; no element occurs more often than in the blocks.

    Raises InputError for rows of different lengths, sizes or sampling times that do not fit.

    Examples
    --------
    >>> from workbench.uncertainty import block, real, tf
    >>> G = tf([1], [1, real("a", 1, percent=20)])
    >>> block([[G, 1.0], [0.0, G]]).noutputs
    2
    """
    given = [as_list(row, f"row {i}") for i, row in enumerate(as_list(rows, "rows"), start=1)]
    lengths = {len(row) for row in given}
    if len(lengths) != 1 or not lengths.pop():
        raise InputError(f"rows have {[len(row) for row in given]} blocks; they need the same")
    parts = [
        [uncertain(one, f"block {i}, {j}") for j, one in enumerate(row, start=1)]
        for i, row in enumerate(given, start=1)
    ]
    heights, widths = [row[0].noutputs for row in parts], [one.ninputs for one in parts[0]]
    for i, row in enumerate(parts, start=1):
        for j, one in enumerate(row, start=1):
            if (one.noutputs, one.ninputs) != (heights[i - 1], widths[j - 1]):
                raise InputError(
                    f"block {i}, {j} has {one.noutputs} outputs and {one.ninputs} inputs; its row "
                    f"has {heights[i - 1]} outputs, its column {widths[j - 1]} inputs"
                )
    flat = [one for row in parts for one in row]
    whole = diagonal(*(one.value for one in flat))
    outputs, inputs = whole.shape
    enters = np.vstack([block_diagonal(*(np.eye(width) for width in widths))] * len(parts))
    leaves = block_diagonal(*(np.hstack([np.eye(height)] * len(widths)) for height in heights))
    value = linked(whole, np.zeros((inputs, outputs)), enters, leaves)
    return UncertainSystem(value, combined_elements(flat), common_time(flat))


def feedback(first: Any, second: Any = 1.0, sign: int = -1) -> UncertainSystem:
    """The loop y = first (u + sign second y); no element occurs more often than before.

    Raises
    ------
    InputError
        Sizes or sampling times do not fit; the sign is not -1 or 1; or the loop is singular through
        the direct terms at the nominal.
    """
    a, b = uncertain(first, "first"), uncertain(second, "second")
    if b.value.shape == (1, 1) and not b.nstates and not b.elements and a.noutputs > 1:
        b = uncertain(float(b.value.M[0, 0]) * np.eye(a.noutputs))
    if (b.noutputs, b.ninputs) != (a.ninputs, a.noutputs):
        raise InputError(
            f"first has {a.ninputs} inputs and {a.noutputs} outputs, second {b.ninputs} and "
            f"{b.noutputs}; they must fit each other"
        )
    if isinstance(sign, bool) or sign not in (-1, 1):
        raise InputError(f"sign is {sign!r}; it must be -1 or 1")
    whole = diagonal(a.value, b.value)
    p, m = a.value.shape
    # v = [u; 0] + [0, sign I; I, 0] [y; x], x = second y
    links = np.block([[np.zeros((m, p)), sign * np.eye(m)], [np.eye(p), np.zeros((p, m))]])
    if singular(np.eye(m + p) - links @ whole.blocks[3]):
        raise InputError("the loop is singular through the direct terms of its parts")
    value = linked(whole, links, np.eye(m + p, m), np.eye(p, p + m))
    parts = [a, b]
    return UncertainSystem(value, combined_elements(parts), common_time(parts))
