"""The loop with a part in plain Python: sample by sample, so that Python has its turn."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench.arrays import RealArray
from workbench.simulation.machine import machine


def plain_loop(
    turns: list[tuple[Any, ...]],
    sense: Any,
    read: Any,
    ends: tuple[RealArray, RealArray],
    row: RealArray,
    groups: tuple[Any, ...],
    signals: RealArray,
    first: int,
    last: int,
) -> int:
    """As the machine's loop, for the turns of the parts: step, state, parameters, wires, ..."""
    _, look, move = machine()
    sense_parameters, read_parameters = ends
    for k in range(first, last):
        look(k, read, read_parameters, row, *groups)
        for step, state, parameters, wires, given, told, place in turns:
            given[:] = row[wires]
            step(state, parameters, given, told)
            row[place : place + len(told)] = told
        signals[k - first] = row
        if not np.isfinite(row).all():
            return k
        move(k, sense, sense_parameters, row, *groups)
    return last
