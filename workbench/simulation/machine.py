"""The compiled loop of `SampledLoop`, for any cascade of parts, any sensor and any reading.

Parts, sensor and reading are called by their addresses, between the functions of
`workbench.simulation.samples`. Inputs and outputs of the parts are pieces of one row of signals, so
that few of them are copied.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import chain
from typing import Any

import numpy as np

from workbench._core.arrays import IntegerArray, RealArray
from workbench._core.compiled import compiled, inlined, kernel
from workbench._core.machine_code.addresses import numbers_at, places_at, types
from workbench._core.machine_code.calls import VECTOR, address_of, call3, call4
from workbench.simulation.cascade import Turn
from workbench.simulation.samples import convert_command, finish_step, half_step, measure, recall


def fast_loop(
    turns: Sequence[Turn],
    sense: Any,
    read: Any,
    ends: tuple[RealArray, RealArray],
    measured: RealArray,
    row: RealArray,
    groups: tuple[Any, ...],
    signals: RealArray,
    first: int,
    last: int,
) -> int:
    """As `workbench.simulation.plain.plain_loop`, compiled."""
    called = _turn_table(turns), address_of(sense, 4), address_of(read, 3)
    stop: int = _compiled_loop()(*called, ends, measured, row, *groups, signals, first, last)
    return stop


def fast_play(
    step: Any, state: RealArray, parameters: RealArray, record: RealArray, output: RealArray
) -> None:
    """Call a step for each row of a record (N, r); it fills the outputs (N, p)."""
    _play(address_of(step, 4), state, parameters, record, output)


def _turn_table(turns: Sequence[Turn]) -> IntegerArray:
    """Rows of the address of the step, then address and size of each array; these must be kept."""
    rows = [
        [address_of(one.step, 4), *chain(*(_place(array) for array in one[1:]))] for one in turns
    ]
    return np.array(rows, np.int64)


def _place(array: RealArray | IntegerArray) -> tuple[int, int]:
    """Address and size of an array."""
    return array.__array_interface__["data"][0], array.size


@cache
def _compiled_loop() -> Any:
    """The loop for the types of `fast_loop`, compiled at the first call.

    That call is the self-test of the road, for which other threads wait. Controllers are passed by
    their addresses: otherwise each would need its own compiled loop.
    """
    matrix, cube = (types.Array(types.float64, n, "C") for n in (2, 3))
    counts, table = (types.Array(types.int64, n, "C") for n in (1, 2))
    signature = types.int64(
        *(table, types.int64, types.int64, types.UniTuple(VECTOR, 2), VECTOR, VECTOR),
        types.UniTuple(VECTOR, 4),
        types.UniTuple(VECTOR, 5),
        types.Tuple((cube, cube, counts, VECTOR, matrix, matrix)),
        types.UniTuple(matrix, 2),
        types.UniTuple(matrix, 3),
        types.Tuple((matrix, matrix, matrix, matrix, counts, counts)),
        *(matrix, types.int64, types.int64),
    )
    _loop.compile(signature)
    _loop.disable_compile()
    return _loop


@inlined
def _turn(part: int, parts: IntegerArray, row: RealArray) -> None:
    """Call a part; it writes its outputs into the row."""
    given = numbers_at(parts[part, 7], parts[part, 8])
    wires = places_at(parts[part, 5], parts[part, 6])
    for i in range(len(wires)):
        given[i] = row[wires[i]]
    state = numbers_at(parts[part, 1], parts[part, 2])
    parameters = numbers_at(parts[part, 3], parts[part, 4])
    call4(parts[part, 0], state, parameters, given, numbers_at(parts[part, 9], parts[part, 10]))


@kernel
def _loop(
    parts: IntegerArray,
    sense: int,
    read: int,
    ends: Any,
    measured: RealArray,
    row: RealArray,
    memory: Any,
    desk: Any,
    plant: Any,
    levels: Any,
    played: Any,
    record: Any,
    signals: RealArray,
    first: int,
    last: int,
) -> int:
    """Run samples first to last - 1; return the first with a signal that is not finite, or last.

    ``parts`` are rows of `_turn_table`, ``sense`` and ``read`` the addresses of sensor and reading,
    ``ends`` their parameters.
    """
    sense_parameters, read_parameters = ends
    x, at, _, _ = memory
    converted, after, outside, middle, end = desk
    exogenous, output = played[1], record[1]
    for k in range(first, last):
        measure(k, memory, desk, plant, levels, played, record)
        call3(read, converted, read_parameters, measured)
        recall(k, len(measured), output, row)
        for part in range(len(parts)):
            _turn(part, parts, row)
        finite = True
        for i in range(len(row)):
            signals[k - first, i] = row[i]
            finite &= np.isfinite(row[i])  # with `and` each signal would be a branch
        if not finite:
            return k
        convert_command(k, row, levels, played, record)
        for w in range(len(plant[4])):
            half_step(k, w, 0, x, plant, output, exogenous, at, outside)
            call4(sense, at, outside, sense_parameters, middle)
            half_step(k, w, 1, x, plant, output, exogenous, at, outside)
            call4(sense, at, outside, sense_parameters, end)
            finish_step(k, w, memory, plant, output, middle, end, after)
    return last


@compiled
def _play(
    step: int, state: RealArray, parameters: RealArray, record: RealArray, output: RealArray
) -> None:
    """Fill the outputs."""
    for k in range(len(record)):
        call4(step, state, parameters, record[k], output[k])
