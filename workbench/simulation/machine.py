"""The compiled loop of `SampledLoop`, for any cascade of parts, any sensor and any reading.

A sample consists of `look`, which measures the plant, a call of every part, and `move`, which
advances to the next sample. They are inlined in the loop, which makes it about twice as fast: a
call hands over seven numbers for each array. Inputs and outputs of the parts are pieces of one row
of signals, so that few of them are copied. The sums are plain: with four side by side in a vector
the loop was slower.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from workbench.arrays import IntegerArray, RealArray
from workbench.compiled import inlined, kernel
from workbench.simulation.converters import convert

SLOTS = 8
"""Largest number of parts of a cascade."""


@cache
def pointer(arguments: int) -> Any:
    """Numba's type of a pointer to a compiled function of so many float arrays."""
    from numba import types

    array = types.Array(types.float64, 1, "C")
    return types.FunctionType(types.void(*[array] * arguments))


@cache
def as_pointer(function: Any, arguments: int) -> Any:
    """The compiled function itself, ready to be passed as a `pointer`.

    Numba looks long for what it has compiled, so a function is asked only once.
    """
    function.compile(pointer(arguments).signature)
    return function


@cache
def machine() -> tuple[Any, Any, Any]:
    """The compiled loop, and the first and last part of a sample, `look` and `move`.

    Controllers are passed as pointers: with another signature each controller would need its own
    compiled loop. The compilation takes place at the first run.
    """
    from numba import types as numba_types

    types: Any = numba_types  # has no annotations
    vector, matrix, cube = (types.Array(types.float64, n, "C") for n in (1, 2, 3))
    counts = types.Array(types.int64, 1, "C")
    each = types.UniTuple(vector, SLOTS)
    parts = types.Tuple((each, each, types.UniTuple(counts, SLOTS), each, each))
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
            *[pointer(4)] * (SLOTS + 1),
            *(pointer(3), parts, ends, vector, vector, *groups),
            *(matrix, types.int64, types.int64),
        ),
        look: types.void(types.int64, pointer(3), vector, vector, vector, *groups),
        move: types.void(types.int64, pointer(4), vector, vector, *groups),
    }
    made = []
    for function, signature in signatures.items():
        function.compile(signature)
        function.disable_compile()
        made.append(function)
    return made[0], made[1], made[2]


@inlined
def _turn(
    step: Any,
    state: RealArray,
    parameters: RealArray,
    wires: IntegerArray,
    given: RealArray,
    told: RealArray,
    row: RealArray,
) -> None:
    """Call one part, unless the slot is empty; it writes its outputs into the row."""
    if len(told) > 0:
        for i in range(len(wires)):
            given[i] = row[wires[i]]
        step(state, parameters, given, told)


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
    read: Any,
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
    read(converted, read_parameters, measured)
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
def _outside(k: int, fraction: float, exogenous: RealArray, outside: RealArray) -> None:
    """Set the exogenous signals at a fraction of sample k."""
    for i in range(len(outside)):
        old = exogenous[k, i]
        outside[i] = old + fraction * (exogenous[k + 1, i] - old)


@inlined
def move(
    k: int,
    sense: Any,
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
        _outside(k, fraction[2 * w], exogenous, outside)
        sense(at, outside, sense_parameters, middle)
        _product(w, len(at), held, x, plant, output, at)
        _outside(k, fraction[2 * w + 1], exogenous, outside)
        sense(at, outside, sense_parameters, end)
        _product(w, 2 * len(at), held, x, plant, output, after)
        for i in range(len(x)):
            x[i] = after[i]
        for i in range(len(filtered)):
            inside = weights[w, 1] * start[i] + weights[w, 2] * middle[i]
            filtered[i] = weights[w, 0] * filtered[i] + inside + weights[w, 3] * end[i]
            start[i] = end[i]


@kernel
def _loop(
    step0: Any,
    step1: Any,
    step2: Any,
    step3: Any,
    step4: Any,
    step5: Any,
    step6: Any,
    step7: Any,
    sense: Any,
    read: Any,
    parts: Any,
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

    ``parts`` are the states, parameters, wires, inputs and outputs of every slot; ``ends`` the
    parameters of the sensor and of the reading. The steps come one by one: Numba has no tuples of
    pointers to functions.
    """
    states, parameters, wires, given, told = parts
    s0, s1, s2, s3, s4, s5, s6, s7 = states
    p0, p1, p2, p3, p4, p5, p6, p7 = parameters
    w0, w1, w2, w3, w4, w5, w6, w7 = wires
    g0, g1, g2, g3, g4, g5, g6, g7 = given
    t0, t1, t2, t3, t4, t5, t6, t7 = told
    sense_parameters, read_parameters = ends
    for k in range(first, last):
        look(k, read, read_parameters, measured, row, memory, desk, plant, levels, played, record)
        _turn(step0, s0, p0, w0, g0, t0, row)
        _turn(step1, s1, p1, w1, g1, t1, row)
        _turn(step2, s2, p2, w2, g2, t2, row)
        _turn(step3, s3, p3, w3, g3, t3, row)
        _turn(step4, s4, p4, w4, g4, t4, row)
        _turn(step5, s5, p5, w5, g5, t5, row)
        _turn(step6, s6, p6, w6, g6, t6, row)
        _turn(step7, s7, p7, w7, g7, t7, row)
        finite = True
        for i in range(len(row)):
            signals[k - first, i] = row[i]
            finite = finite and np.isfinite(row[i])
        if not finite:
            return k
        move(k, sense, sense_parameters, row, memory, desk, plant, levels, played, record)
    return last
