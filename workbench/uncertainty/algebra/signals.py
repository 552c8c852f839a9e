"""Names of a system and of its signals from keywords of python-control."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.uncertainty.algebra.system import SignalNames, UncertainSystem

NAMING = ("name", "inputs", "outputs", "input_prefix", "output_prefix")
"""Keywords of python-control that name a system and its signals."""


@dataclass(frozen=True)
class Call:
    """Arguments of a function that has python-control's signature (*args, **kwargs).

    ``given`` are the arguments before the sampling time ``dt`` [s], which is 0 by default.
    ``naming`` are the keywords that name the system and its signals.
    """

    given: tuple[Any, ...]
    dt: float | None
    naming: Mapping[str, Any]


def call_of(
    function: str, args: tuple[Any, ...], kwargs: Mapping[str, Any], *, before_dt: int
) -> Call:
    """The arguments of a call; raises InputError for keywords that are not used here.

    The states of an uncertain system result from its reduction, so they have no names.
    """
    dt = kwargs.get("dt", 0.0)
    if len(args) == before_dt + 1:
        if "dt" in kwargs:
            raise InputError(f"{function} was given dt twice, by position and as dt=")
        args, dt = args[:-1], args[-1]
    need_naming(function, {name: value for name, value in kwargs.items() if name != "dt"})
    return Call(args, dt, {name: value for name, value in kwargs.items() if name in NAMING})


def need_naming(function: str, kwargs: Mapping[str, Any]) -> None:
    """Raise InputError for keywords that do not name a system or its inputs and outputs."""
    for name in kwargs:
        if name not in NAMING:
            raise InputError(
                f"{function} has no use for {name}=; the keywords it takes are {', '.join(NAMING)}"
            )


def named(system: UncertainSystem, naming: Mapping[str, Any]) -> UncertainSystem:
    """The system with names from keywords of python-control; unchanged without keywords."""
    if not naming:
        return system
    return system.with_signals(signals_of(stand_in(system, **naming)))


def signals_of(system: Any) -> SignalNames:
    """The names that a python-control system has; automatic names such as sys[3] do not count."""
    name = "" if system.name.startswith("sys[") else system.name
    return SignalNames(name, tuple(system.input_labels), tuple(system.output_labels))


def stand_in(system: UncertainSystem, **naming: Any) -> StateSpace:
    """A python-control system with the same signals and names, whose gains are all zero."""
    import control

    for kind, count in (("inputs", system.ninputs), ("outputs", system.noutputs)):
        names = naming.get(kind)
        size = 1 if isinstance(names, str) else names if isinstance(names, int) else None
        size = len(names) if size is None and names is not None else size
        if size not in (None, count):
            raise InputError(f"{kind} is {names!r}; the system has {count} {kind}")
    gains = np.zeros((system.noutputs, system.ninputs))
    with python_controls_errors():
        return control.ss([], [], [], gains, **naming)


@contextmanager
def python_controls_errors() -> Iterator[None]:
    """Context in which errors of python-control become InputError with its text."""
    try:
        yield
    except InputError:
        raise
    except (ValueError, TypeError, NameError, LookupError) as error:
        raise InputError(f"python-control says: {error}") from None
