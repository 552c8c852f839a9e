"""Connection of uncertain systems by the names of their signals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from workbench.errors import InputError, UnknownNameError
from workbench.input_checks import as_list
from workbench.systems.balancing import singular
from workbench.systems.interconnection import Names, names_of, sum_of
from workbench.uncertainty.algebra.lft import LFT, diagonal, linked
from workbench.uncertainty.algebra.system import (
    UncertainSystem,
    combined_elements,
    common_time,
    uncertain,
)


def interconnect(
    blocks: Sequence[Any], sums: Mapping[str, str], *, inputs: Names, outputs: Names
) -> UncertainSystem:
    """Connect uncertain systems by the names of their signals, as `control.interconnect` others.

    A signal is driven in one place, a block's output, a sum or an input of the whole, and read in
    any number of places. An element that occurs in several blocks is one element.

    Parameters
    ----------
    blocks
        (System, input names, output names), the system an `UncertainSystem` or anything that stands
        for one; or a system of python-control whose signals have names.
    sums
        Summing junctions such as {"e": "r - y"}.
    inputs, outputs
        Names of the signals that come in and go out.

    Raises
    ------
    UnknownNameError
        A signal that is read but driven by nothing.
    InputError
        A signal driven twice, an input that nothing reads, names that do not fit their system, or a
        loop without dynamics that is singular.

    Examples
    --------
    >>> from workbench.uncertainty import interconnect, real, tf
    >>> G = tf([1], [1, real("a", 1, percent=20)])
    >>> S = interconnect([(G, "u", "y")], {"e": "r - y", "u": "e"}, inputs="r", outputs=["e", "y"])
    >>> S.noutputs, [block.name for block in S.structure]
    (2, ['a'])
    """
    if not isinstance(sums, Mapping):
        raise InputError(f'sums must be a mapping such as {{"e": "r - y"}}, not {sums!r}')
    parts: list[UncertainSystem] = []
    read: list[str] = []
    driven: list[str] = []
    for number, given in enumerate(as_list(blocks, "blocks"), start=1):
        part, into, out = _named(given, f"block {number}")
        parts.append(part)
        read += into
        driven += out
    for item in sums.items():
        junction = sum_of(*item)
        parts.append(uncertain(np.asarray(junction.M)))
        read += junction.inputs
        driven += junction.outputs
    if not parts:
        raise InputError("there is nothing to connect: give blocks or sums")
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
    whole = diagonal(*(part.value for part in parts))
    links = reads[:, :split]
    direct = whole.blocks[3]
    if singular(np.eye(len(read)) - links @ direct):
        raise InputError("a loop without dynamics is singular; check signs and direct terms")
    value = linked(whole, links, reads[:, split:], leaves[:, :split])
    through = np.zeros(value.M.shape)
    through[len(value.names) :, len(value.names) :] = leaves[:, split:]
    found = LFT(value.M + through, value.names)
    return UncertainSystem(found, combined_elements(parts), common_time(parts))


def _named(given: Any, name: str) -> tuple[UncertainSystem, list[str], list[str]]:
    """A block, and the names of its inputs and outputs."""
    if isinstance(given, tuple):
        if len(given) != 3:
            raise InputError(f"{name} is {given!r}; (system, inputs, outputs) are needed")
        system, into, out = given
        part, read, driven = uncertain(system, name), names_of(into), names_of(out)
    else:
        part = uncertain(given, name)
        if not hasattr(given, "input_labels"):
            raise InputError(f"{name} has no names of signals; give (system, inputs, outputs)")
        read, driven = tuple(given.input_labels), tuple(given.output_labels)
    if (len(read), len(driven)) != (part.ninputs, part.noutputs):
        raise InputError(
            f"{name} has {part.ninputs} inputs and {part.noutputs} outputs, but was given the "
            f"names {list(read)} and {list(driven)}"
        )
    return part, list(read), list(driven)
