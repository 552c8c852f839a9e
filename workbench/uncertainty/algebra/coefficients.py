"""Systems with uncertain coefficients: state-space matrices and transfer functions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from workbench.errors import InputError
from workbench.input_checks import as_list, is_real
from workbench.systems.balancing import singular
from workbench.uncertainty.algebra.connections import block
from workbench.uncertainty.algebra.elements import Element
from workbench.uncertainty.algebra.lft import INTEGRATOR, LFT, block_matrix, lift
from workbench.uncertainty.algebra.signals import Call, call_of, named, python_controls_errors
from workbench.uncertainty.algebra.system import UncertainSystem, combined_elements, uncertain


def ss(*args: Any, **kwargs: Any) -> UncertainSystem:
    """A state-space system whose matrices have uncertain entries.

    ``ss(A, B, C, D)`` may have the sampling time [s] as fifth argument or as ``dt=``. Each matrix
    is an array of numbers, an uncertain matrix, or a list of rows of numbers and uncertain numbers.
    Repetitions of elements are reduced as by `UncertainSystem.reduced`. ``ss(system)`` takes a
    system of any kind. Keywords name the system and its signals, as those of `control.ss` do.

    Examples
    --------
    >>> from workbench.uncertainty import real, ss
    >>> k = real("k", 4, percent=25)
    >>> G = ss([[0, 1], [-k, -0.5]], [[0], [1]], [[1, 0]], [[0]], inputs="force")
    >>> float(G.at(k=5.0).dcgain()), G.input_labels
    (0.2, ['force'])
    """
    call = call_of("ss", args, kwargs, before_dt=4)
    if len(call.given) == 1:
        return named(_converted(call, kwargs), call.naming)
    if len(call.given) != 4:
        raise InputError(
            f"ss was given {len(call.given)} arguments; A, B, C, D or a system is needed"
        )
    return named(_state_space(*call.given, call.dt), call.naming)


def tf(*args: Any, **kwargs: Any) -> Any:
    """A transfer function with coefficients that may be uncertain, highest power first.

    ``tf(num, den)`` may have the sampling time [s] as third argument or as ``dt=``. Each
    coefficient enters the realisation only once, so that bounds on its effect are tight. For
    several inputs and outputs, num and den are lists of rows of polynomials. ``tf(system)`` takes a
    system of any kind, and ``tf([[G, H]])`` an array of them. ``tf("s")`` and ``tf("z")`` are
    python-control's own. Keywords name the system and its signals, as those of `control.tf` do.

    Examples
    --------
    >>> from workbench.uncertainty import real, tf
    >>> a = real("a", 2, percent=20)
    >>> float(tf([1], [1, a]).at(a=1.6).dcgain())
    0.625
    >>> two = tf([[[1], [2]]], [[[1, a], [1, 1]]])
    >>> two.noutputs, two.ninputs
    (1, 2)
    """
    import control

    call = call_of("tf", args, kwargs, before_dt=2)
    if len(call.given) == 1:
        (only,) = call.given
        if isinstance(only, str):
            if only not in ("s", "z"):
                raise InputError(f'tf was given {only!r}; the texts that it takes are "s" and "z"')
            with python_controls_errors():
                return control.tf(only, **kwargs)
        return named(_converted(call, kwargs), call.naming)
    if len(call.given) != 2:
        raise InputError(f"tf was given {len(call.given)} arguments; num and den are needed")
    num, den = call.given
    if not _has_rows(num):
        return named(_fraction(num, den, call.dt), call.naming)
    if not _has_rows(den) or [len(row) for row in num] != [len(row) for row in den]:
        raise InputError("num has rows of polynomials; den needs as many rows of the same lengths")
    rows = [
        [_fraction(above, below, call.dt) for above, below in zip(*pair, strict=True)]
        for pair in zip(num, den, strict=True)
    ]
    return named(block(rows), call.naming)


def _converted(call: Call, kwargs: Mapping[str, Any]) -> UncertainSystem:
    """The system, if a call gives a whole system or an array of systems."""
    (given,) = call.given
    rows = isinstance(given, list | tuple) or (
        isinstance(given, np.ndarray) and given.dtype.hasobject
    )
    found = block(given) if rows else uncertain(given, "system")
    if "dt" in kwargs and call.dt != found.dt:
        if found.nstates:
            raise InputError(f"the system has dt = {found.dt}; it cannot be given dt = {call.dt}")
        return replace(found, dt=call.dt)
    return found


def _has_rows(given: Any) -> bool:
    """Whether `given` is a list of rows of polynomials, for several inputs and outputs."""
    for _ in range(2):
        if not isinstance(given, list | tuple | np.ndarray) or not len(given):
            return False
        given = given[0]
    return isinstance(given, list | tuple | np.ndarray)


def _state_space(A: Any, B: Any, C: Any, D: Any, dt: float | None) -> UncertainSystem:
    if all(isinstance(part, list | tuple) and not any(part) for part in (A, B, C)):
        direct = _matrix(D, "D")  # a static system, as python-control's ss([], [], [], D)
        return replace(direct, dt=dt or direct.dt)
    parts = [_matrix(given, name) for given, name in ((A, "A"), (B, "B"), (C, "C"), (D, "D"))]
    states = parts[0].noutputs
    if parts[0].ninputs != states:
        raise InputError(f"A has shape {parts[0].value.shape}; it must be square")
    if parts[3].value.shape == (1, 1) and _is_zero(
        parts[3]
    ):  # as in python-control, D is then zero
        parts[3] = uncertain(np.zeros((parts[2].noutputs, parts[1].ninputs)))
    whole = block_matrix([[parts[0].value, parts[1].value], [parts[2].value, parts[3].value]])
    return _with_states(lift(whole), states, combined_elements(parts), dt)


def _fraction(num: Any, den: Any, dt: float | None) -> UncertainSystem:
    """A transfer function with one input and one output."""
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
    # a_n y = x_1 + b_n u and x_i' = x_(i+1) + b_(n-i) u - a_(n-i) y: each coefficient occurs once.
    first = [*np.eye(order)[0], b[0].value]
    chain = [[*row, one.value] for row, one in zip(np.eye(order, k=1), b[1:], strict=True)]
    output = lift(block_matrix([first])) / below[0].value
    back = block_matrix([*([-one.value] for one in below[1:]), [1.0]])
    whole = lift(block_matrix([*chain, [0.0] * (order + 1)])) + lift(back) @ output
    return _with_states(whole, order, combined_elements([*b, *below]), dt)


def _with_states(
    whole: LFT, states: int, elements: dict[str, Element], dt: float | None
) -> UncertainSystem:
    """The system of [A B; C D] with `states` states and reduced repetitions of elements."""
    value = LFT(whole.M, whole.names + (INTEGRATOR,) * states)
    return UncertainSystem(value, elements, dt=dt)._used().reduced()


def _matrix(given: Any, name: str) -> UncertainSystem:
    """An uncertain matrix from an array, an uncertain matrix or a list of rows."""
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
        raise InputError(
            f"{name} has rows of lengths {[len(row) for row in parts]}; they must be equal"
        )
    value = block_matrix([[entry.value for entry in row] for row in parts])
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
