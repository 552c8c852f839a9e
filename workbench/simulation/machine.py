"""The compiled loop of `SampledLoop`, for any controller, sensor and reading."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.compiled import compiled
from workbench.simulation.converters import convert

Real = NDArray[np.float64]
Whole = NDArray[np.int64]


@cache
def pointer(arguments: int) -> Any:
    """Type of a pointer to a compiled function that takes so many float arrays."""
    from numba import types

    array = types.Array(types.float64, 1, "C")
    return types.FunctionType(types.void(*[array] * arguments))


@cache
def machine() -> Any:
    """The compiled loop, for pointers: with any other signature each controller would need its own.

    Compiled at the first run.
    """
    from numba import types

    vector, matrix, cube = (types.Array(types.float64, n, "C") for n in (1, 2, 3))
    counts = types.Array(types.int64, 1, "C")
    signature = types.int64(
        *(pointer(arguments) for arguments in (4, 4, 3)),
        *[vector] * 4,
        *(cube, cube, counts, vector, matrix, matrix),
        *[matrix] * 5,
        *[matrix] * 5,
        *(counts, counts),
    )
    loop = compiled(_loop)
    loop.compile(signature)
    loop.disable_compile()
    return loop


@compiled
def _convert_row(row: Real, levels: Real, converted: Real, saturated: Whole) -> None:
    for j in range(len(row)):
        converted[j], over = convert(row[j], levels[j])
        saturated[j] += over


def _loop(
    step: Any,
    sense: Any,
    read: Any,
    state: Real,
    parameters: Real,
    sense_parameters: Real,
    read_parameters: Real,
    transition: Real,
    drive: Real,
    age: Whole,
    fraction: Real,
    weights: Real,
    to_output: Real,
    channel_levels: Real,
    output_levels: Real,
    excitation: Real,
    exogenous: Real,
    noise: Real,
    command: Real,
    output: Real,
    channels: Real,
    measurement: Real,
    position: Real,
    saturated_outputs: Whole,
    saturated_channels: Whole,
) -> int:
    """Fill the recorded arrays; the number of samples done."""
    samples, m = excitation.shape
    halves, n = transition.shape[:2]
    c, q = channels.shape[1], position.shape[1]
    s = c - (len(to_output) - q)
    x, after, raw, outside = np.zeros(n), np.zeros(n), np.zeros(c), exogenous[0].copy()
    at, start, middle, end = np.zeros(q), np.zeros(s), np.zeros(s), np.zeros(s)
    sense(at, outside, sense_parameters, start)
    filtered = start.copy()
    for k in range(samples):
        for i in range(q):
            position[k, i] = 0.0
            for j in range(n):
                position[k, i] += to_output[i, j] * x[j]
        for i in range(s):
            raw[i] = filtered[i] + noise[k, i]
        for i in range(s, c):
            raw[i] = noise[k, i]
            for j in range(n):
                raw[i] += to_output[q + i - s, j] * x[j]
        _convert_row(raw, channel_levels, channels[k], saturated_channels)
        read(channels[k], read_parameters, measurement[k])
        step(state, parameters, measurement[k], command[k])
        for i in range(m):
            command[k, i] += excitation[k, i]
            if not np.isfinite(command[k, i]):
                return k
        _convert_row(command[k], output_levels, output[k], saturated_outputs)
        for h in range(halves):
            held = k - age[h]
            for i in range(n):
                total = 0.0
                for j in range(n):
                    total += transition[h, i, j] * x[j]
                if held >= 0:
                    for j in range(m):
                        total += drive[h, i, j] * output[held, j]
                after[i] = total
            x, after = after, x
            for i in range(q):
                at[i] = 0.0
                for j in range(n):
                    at[i] += to_output[i, j] * x[j]
            for i in range(len(outside)):
                old = exogenous[k, i]
                outside[i] = old + fraction[h] * (exogenous[k + 1, i] - old)
            if h % 2 == 0:
                sense(at, outside, sense_parameters, middle)
            else:
                sense(at, outside, sense_parameters, end)
                w = weights[h // 2]
                for i in range(s):
                    inside = w[1] * start[i] + w[2] * middle[i] + w[3] * end[i]
                    filtered[i] = w[0] * filtered[i] + inside
                    start[i] = end[i]
    return samples
