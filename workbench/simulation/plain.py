"""The loop of `SampledLoop` in Python, which calls parts, sensor and reading as Python does.

It serves cascades with a part in plain Python, and installations where the compiled loop does not
work.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.simulation.samples import convert_command, finish_step, half_step, measure, recall


def plain_loop(
    turns: Sequence[tuple[Any, ...]],
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
    """Run samples first to last - 1; return the first with a signal that is not finite, or last.

    It does the same as the compiled loop. ``turns`` holds for each part step, state, parameters,
    wires, inputs and outputs.
    """
    sense_parameters, read_parameters = ends
    memory, desk, plant, levels, played, record = groups
    x, at, _, _ = memory
    converted, after, outside, middle, end = desk
    exogenous, output = played[1], record[1]
    for k in range(first, last):
        measure(k, memory, desk, plant, levels, played, record)
        read(converted, read_parameters, measured)
        recall(k, len(measured), output, row)
        for step, state, parameters, wires, given, told in turns:
            if len(wires):
                given[:] = row[wires]
            step(state, parameters, given, told)
        signals[k - first] = row
        if not np.isfinite(row).all():
            return k
        convert_command(k, row, levels, played, record)
        for w in range(len(plant[4])):
            half_step(k, w, 0, x, plant, output, exogenous, at, outside)
            sense(at, outside, sense_parameters, middle)
            half_step(k, w, 1, x, plant, output, exogenous, at, outside)
            sense(at, outside, sense_parameters, end)
            finish_step(k, w, memory, plant, output, middle, end, after)
    return last
