"""Connection of uncertain systems by the names of their signals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError, UnknownNameError
from workbench.input_checks import as_list
from workbench.systems.balancing import singular
from workbench.systems.interconnection import names_of, sum_of
from workbench.uncertainty.algebra.lft import LFT, diagonal, linked
from workbench.uncertainty.algebra.signals import (
    need_naming,
    python_controls_errors,
    signals_of,
    stand_in,
)
from workbench.uncertainty.algebra.system import (
    SignalNames,
    UncertainSystem,
    combined_elements,
    common_time,
    uncertain,
)

LEFT_OPEN = {
    **dict.fromkeys(("inplist", "outlist", "params", "ignore_inputs", "ignore_outputs")),
    **{"check_unused": True, "add_unused": False, "warn_duplicate": None, "debug": False},
}
"""Default values of the settings of python-control's wiring."""


def interconnect(
    syslist: Sequence[Any],
    connections: Any = None,
    inplist: Any = None,
    outlist: Any = None,
    params: Any = None,
    check_unused: bool = True,
    add_unused: bool = False,
    ignore_inputs: Any = None,
    ignore_outputs: Any = None,
    warn_duplicate: bool | None = None,
    debug: bool = False,
    **kwargs: Any,
) -> UncertainSystem:
    """Connect uncertain systems, as `control.interconnect` connects certain ones.

    With names only, each signal has one source: a system's output, a sum or an input of the whole.
    It may be read in any number of places. A signal that is read but has no source is an error. An
    element that occurs in several systems is one and the same element.

    Parameters
    ----------
    syslist
        Systems whose signals have names, such as ``tf(..., inputs="u", outputs="y")`` or systems of
        python-control; or tuples (system, input names, output names), where the system may be
        anything that can be converted to one.
    connections
        Summing junctions by name, such as {"e": "r - y"}; or python-control's list of connections.
        With None, signals with the same name are connected.
    inplist, outlist, params, check_unused, add_unused, ignore_inputs, ignore_outputs, \
warn_duplicate, debug
        As in `control.interconnect`. If any of them, or a list of connections, is given,
        python-control does the wiring, with its own rules and warnings.
    **kwargs
        ``inputs`` and ``outputs``, the names of the external signals; ``name``; and the other
        keywords of `control.interconnect`.

    Raises
    ------
    UnknownNameError
        A signal is read but has no source.
    InputError
        A signal has two sources; nothing reads an input; names do not fit their system; a loop
        without dynamics is singular; or python-control raises an error.

    Examples
    --------
    >>> from workbench.uncertainty import interconnect, real, tf
    >>> G = tf([1], [1, real("a", 1, percent=20)], inputs="u", outputs="y")
    >>> S = interconnect([G], {"e": "r - y", "u": "e"}, inputs="r", outputs=["e", "y"])
    >>> S.noutputs, [block.name for block in S.structure]
    (2, ['a'])
    """
    rules = {
        "inplist": inplist,
        "outlist": outlist,
        "params": params,
        "check_unused": check_unused,
        "add_unused": add_unused,
        "ignore_inputs": ignore_inputs,
        "ignore_outputs": ignore_outputs,
        "warn_duplicate": warn_duplicate,
        "debug": debug,
    }
    sums = connections if isinstance(connections, Mapping) else {}
    given = as_list(syslist, "syslist")
    wires = None if connections is sums else connections
    by_names = wires is None and rules == LEFT_OPEN
    parts = [_labelled(one, f"system {k}", by_names) for k, one in enumerate(given, start=1)]
    parts += _junctions(sums)
    if by_names:
        return _by_names(parts, **kwargs)
    return _by_python_control(parts, wires, rules, kwargs)


def _labelled(given: Any, name: str, needed: bool) -> UncertainSystem:
    """A system with the names of its signals; raises InputError if `needed` names are missing."""
    labels: SignalNames | None
    if isinstance(given, tuple):
        if len(given) != 3:
            raise InputError(f"{name} is {given!r}; (system, inputs, outputs) are needed")
        system, into, out = given
        part = uncertain(system, name)
        labels = SignalNames("", names_of(into), names_of(out))
    else:
        part = uncertain(given, name)
        labels = part.signals
        if not isinstance(given, UncertainSystem) and hasattr(given, "input_labels"):
            labels = signals_of(given)
    if labels is None:
        if needed:
            raise InputError(
                f"{name} has no names of signals; make it with inputs= and outputs=, or give "
                "(system, inputs, outputs)"
            )
        return part
    if (len(labels.inputs), len(labels.outputs)) != (part.ninputs, part.noutputs):
        raise InputError(
            f"{name} has {part.ninputs} inputs and {part.noutputs} outputs, but was given the "
            f"names {list(labels.inputs)} and {list(labels.outputs)}"
        )
    return part.with_signals(labels)


def _junctions(sums: Mapping[str, str]) -> list[UncertainSystem]:
    """Summing junctions as systems."""
    found = []
    for item in sums.items():
        junction = sum_of(*item)
        labels = SignalNames("", tuple(junction.inputs), tuple(junction.outputs))
        found.append(uncertain(np.asarray(junction.M)).with_signals(labels))
    return found


def _by_names(
    parts: list[UncertainSystem], *, inputs: Any = None, outputs: Any = None, **naming: Any
) -> UncertainSystem:
    """Connect all signals with the same name."""
    if inputs is None or outputs is None:
        raise InputError(
            "interconnect needs inputs= and outputs=, the names of the external signals"
        )
    if not parts:
        raise InputError("there is nothing to connect: give systems or sums")
    read = [name for part in parts for name in part.input_labels]
    driven = [name for part in parts for name in part.output_labels]
    enter, leave = names_of(inputs), names_of(outputs)
    signals = [*driven, *enter]
    for name in dict.fromkeys(signals):
        if signals.count(name) > 1:
            raise InputError(f"signal {name!r} is driven {signals.count(name)} times; add in a sum")
    for name in (*read, *leave):
        if name not in signals:
            raise UnknownNameError("signal", name, signals)
    for name in enter:
        if name not in (*read, *leave):
            raise InputError(f"nothing reads the input {name!r}; connect it or leave it out")
    which = np.eye(len(signals))
    reads, leaves = (
        which[[signals.index(name) for name in names]].reshape(-1, len(signals))
        for names in (read, leave)
    )
    split = len(driven)
    maps = reads[:, :split], reads[:, split:], leaves[:, :split], leaves[:, split:]
    need_naming("interconnect", naming)
    return _connected(parts, *maps).with_signals(SignalNames(naming.get("name", ""), enter, leave))


def _by_python_control(
    parts: list[UncertainSystem], connections: Any, rules: Mapping[str, Any], kwargs: Any
) -> UncertainSystem:
    """Let python-control connect systems with the same signals, and read the connections from its
    result.
    """
    import control

    systems = [stand_in(part, **_naming(part)) for part in parts]
    with python_controls_errors():
        wired = control.interconnect(systems, connections, **rules, **kwargs)
    outputs = sum(part.noutputs for part in parts)
    links, enters = np.asarray(wired.connect_map), np.asarray(wired.input_map)
    outgoing, incoming = wired.output_map[:, :outputs], wired.output_map[:, outputs:]
    found = _connected(parts, links, enters, outgoing + incoming @ links, incoming @ enters)
    return found.with_signals(signals_of(wired))


def _naming(part: UncertainSystem) -> dict[str, Any]:
    """Keywords of python-control for the names of a system and its signals."""
    if part.signals is None:
        return {}
    named = {"name": part.signals.name} if part.signals.name else {}
    return {"inputs": part.input_labels, "outputs": part.output_labels, **named}


def _connected(
    parts: list[UncertainSystem],
    links: RealArray,
    enters: RealArray,
    leaves: RealArray,
    through: RealArray,
) -> UncertainSystem:
    """All inputs are links y + enters w, where y are all outputs. The external outputs are leaves y
    + through w.

    Raises InputError if a loop without dynamics is singular.
    """
    whole = diagonal(*(part.value for part in parts))
    if singular(np.eye(len(links)) - links @ whole.blocks[3]):
        raise InputError("a loop without dynamics is singular; check signs and direct terms")
    value = linked(whole, links, enters, leaves)
    passing = np.zeros(value.M.shape)
    passing[len(value.names) :, len(value.names) :] = through
    found = LFT(value.M + passing, value.names)
    return UncertainSystem(found, combined_elements(parts), dt=common_time(parts))
