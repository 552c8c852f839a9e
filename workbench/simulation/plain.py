"""The loop of `SampledLoop` in Python, for cascades with a part in plain Python."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.simulation.machine import compiled_loop


def plain_loop(
    turns: Sequence[tuple[Any, ...]],
    sense: int,
    read: int,
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
    _, look, move = compiled_loop()
    sense_parameters, read_parameters = ends
    for k in range(first, last):
        look(k, read, read_parameters, measured, row, *groups)
        for step, state, parameters, wires, given, told in turns:
            if len(wires):
                given[:] = row[wires]
            step(state, parameters, given, told)
        signals[k - first] = row
        if not np.isfinite(row).all():
            return k
        move(k, sense, sense_parameters, row, *groups)
    return last
