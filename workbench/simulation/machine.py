"""The compiled loop of `SampledLoop`, for any cascade of parts, any sensor and any reading.

A sample consists of `look`, which measures the plant, a call of every part, and `move`, which
advances to the next sample. They are inlined in the loop, which makes it about twice as fast: a
call hands over seven numbers for each array. Inputs and outputs of the parts are pieces of one row
of signals, so that few of them are copied. The sums are plain: with four side by side in a vector
the loop was slower.
"""

from __future__ import annotations

from functools import cache
from threading import Lock
from typing import Any

import numpy as np

from workbench._core.addresses import numbers_at, places_at, types
from workbench._core.arrays import IntegerArray, RealArray
from workbench._core.compiled import inlined, kernel
from workbench.simulation.converters import convert
from workbench.simulation.steps import VECTOR, call3, call4

_COMPILING = Lock()
"""Held while the loop is compiled: threads that need it at the same time wait for one of them."""


def compiled_loop() -> tuple[Any, Any, Any]:
    """The compiled loop, and the first and last part of a sample, `look` and `move`.

    Controllers are passed by their addresses: otherwise each would need its own compiled loop. The
    compilation takes place at the first run.
    """
    with _COMPILING:
        return _compiled_once()


@cache
def _compiled_once() -> tuple[Any, Any, Any]:
    vector, (matrix, cube) = VECTOR, (types.Array(types.float64, n, "C") for n in (2, 3))
    counts, table = (types.Array(types.int64, n, "C") for n in (1, 2))
    groups = (
        types.UniTuple(vector, 4),
        types.UniTuple(vector, 5),
        types.Tuple((cube, cube, counts, vector, matrix, matrix)),
        types.UniTuple(matrix, 2),
        types.UniTuple(matrix, 3),
        types.Tuple((matrix, matrix, matrix, matrix, counts, counts)),
    )
    ends = types.UniTuple(vector, 2)
    signatures = {
        _loop: types.int64(
            *(table, types.int64, types.int64, ends, vector, vector, *groups),
            *(matrix, types.int64, types.int64),
        ),
        look: types.void(types.int64, types.int64, vector, vector, vector, *groups),
        move: types.void(types.int64, types.int64, vector, vector, *groups),
    }
    made = []
    for function, signature in signatures.items():
        function.compile(signature)
        function.disable_compile()
        made.append(function)
    return made[0], made[1], made[2]


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


# The groups of arguments that every sample needs, as `SampledLoop` makes them:
#   memory  state x, positions, filters' outputs, their inputs at the start of a step
#   desk    converted channels; state at the end of a step; what the sensor is given from
#           outside, and what it gives at the middle and the end of a step
#   plant   transition, drive, age, fraction, weights (see `SampledLoop._advance`), x -> outputs
#   levels  limits and step of every channel's converter, and of every output's
#   played  excitation, exogenous signals, noise
#   record  command, output, channels, position; counts of saturated samples


@inlined
def look(
    k: int,
    read: int,
    read_parameters: RealArray,
    measured: RealArray,
    row: RealArray,
    memory: Any,
    desk: Any,
    plant: Any,
    levels: Any,
    played: Any,
    record: Any,
) -> None:
    """Measure sample k: record positions, channels and measurements.

    Measurements and the outputs of the previous sample are written at the start of the row.
    """
    x, at, filtered, _ = memory
    converted, to_output, limits, noise = desk[0], plant[5], levels[0], played[2]
    _, output, channels, position, _, saturated = record
    n, q, s = len(x), len(at), len(filtered)
    for i in range(q):
        position[k, i] = at[i]
    for i in range(len(converted)):
        raw = noise[k, i]
        if i < s:
            raw += filtered[i]
        else:
            for j in range(n):
                raw += to_output[q + i - s, j] * x[j]
        converted[i], over = convert(raw, limits[i, 0], limits[i, 1], limits[i, 2])
        channels[k, i] = converted[i]
        saturated[i] += over
    call3(read, converted, read_parameters, measured)
    r = len(measured)
    for i in range(output.shape[1]):
        row[r + i] = output[k - 1, i] if k > 0 else 0.0


@inlined
def _product(
    w: int, first: int, held: int, x: RealArray, plant: Any, output: RealArray, into: RealArray
) -> None:
    """Rows of step w from ``first`` on, times state x and the output of sample ``held``."""
    transition, drive = plant[0], plant[1]
    for i in range(len(into)):
        total = 0.0
        for j in range(len(x)):
            total += transition[w, first + i, j] * x[j]
        if held >= 0:
            for j in range(output.shape[1]):
                total += drive[w, first + i, j] * output[held, j]
        into[i] = total


@inlined
def _set_exogenous(k: int, fraction: float, exogenous: RealArray, outside: RealArray) -> None:
    """Set the exogenous signals at a fraction of sample k."""
    for i in range(len(outside)):
        old = exogenous[k, i]
        outside[i] = old + fraction * (exogenous[k + 1, i] - old)


@inlined
def move(
    k: int,
    sense: int,
    sense_parameters: RealArray,
    row: RealArray,
    memory: Any,
    desk: Any,
    plant: Any,
    levels: Any,
    played: Any,
    record: Any,
) -> None:
    """Convert the command at the end of the row, and advance plant and filters by a sample."""
    x, at, filtered, start = memory
    _, after, outside, middle, end = desk
    age, fraction, weights = plant[2], plant[3], plant[4]
    limits, excitation, exogenous = levels[1], played[0], played[1]
    command, output, saturated = record[0], record[1], record[4]
    m = command.shape[1]
    for i in range(m):
        command[k, i] = row[len(row) - m + i] + excitation[k, i]
        output[k, i], over = convert(command[k, i], limits[i, 0], limits[i, 1], limits[i, 2])
        saturated[i] += over
    for w in range(len(weights)):
        held = k - age[w]
        _product(w, 0, held, x, plant, output, at)
        _set_exogenous(k, fraction[2 * w], exogenous, outside)
        call4(sense, at, outside, sense_parameters, middle)
        _product(w, len(at), held, x, plant, output, at)
        _set_exogenous(k, fraction[2 * w + 1], exogenous, outside)
        call4(sense, at, outside, sense_parameters, end)
        _product(w, 2 * len(at), held, x, plant, output, after)
        for i in range(len(x)):
            x[i] = after[i]
        for i in range(len(filtered)):
            inside = weights[w, 1] * start[i] + weights[w, 2] * middle[i]
            filtered[i] = weights[w, 0] * filtered[i] + inside + weights[w, 3] * end[i]
            start[i] = end[i]


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

    ``parts`` are rows of `turn_table`, ``sense`` and ``read`` the addresses of sensor and reading,
    ``ends`` their parameters.
    """
    sense_parameters, read_parameters = ends
    for k in range(first, last):
        look(k, read, read_parameters, measured, row, memory, desk, plant, levels, played, record)
        for part in range(len(parts)):
            _turn(part, parts, row)
        finite = True
        for i in range(len(row)):
            signals[k - first, i] = row[i]
            finite &= np.isfinite(row[i])  # with `and` each signal would be a branch
        if not finite:
            return k
        move(k, sense, sense_parameters, row, memory, desk, plant, levels, played, record)
    return last
