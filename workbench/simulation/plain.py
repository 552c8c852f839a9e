"""The loop of `SampledLoop` in Python, for cascades with a part in plain Python."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench.arrays import RealArray
from workbench.simulation.machine import machine


def plain_loop(
    turns: list[tuple[Any, ...]],
    sense: Any,
    read: Any,
    sense_parameters: RealArray,
    read_parameters: RealArray,
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

    It does the same as the compiled loop. ``turns`` holds for each part the entries of `Slots`:
    step, state, parameters, wires, inputs, outputs and place.
    """
    _, look, move = machine()
    x, filtered, start = memory
    converted, measured, *room = desk
    excitation, exogenous, noise = played
    command, output, channels, measurement, position, over_out, over_in = record
    seen = (x, filtered, converted, measured, plant[-1], levels[0], noise)
    noted = (output, channels, measurement, position, over_in)
    moved = (x, filtered, start, *room, *plant, levels[1], excitation, exogenous)
    for k in range(first, last):
        look(k, read, read_parameters, row, *seen, *noted)
        for step, state, parameters, wires, given, told, place in turns:
            given[:] = row[wires]
            step(state, parameters, given, told)
            row[place : place + len(told)] = told
        signals[k - first] = row
        if not np.isfinite(row).all():
            return k
        move(k, sense, sense_parameters, row, *moved, command, output, over_out)
    return last
