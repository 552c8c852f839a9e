"""Records of a stranger's units, written as loggers write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .rig import Rig
from .stranger import Array, Channel, Stranger

HIGHEST = 0.1
"""Highest excited frequency, divided by the sampling frequency."""
LONGER = 0.4
"""Largest fraction of a period that a unit's record has beyond whole periods."""


def multisine(plant: Stranger) -> Array:
    """One period of a multisine with nearly logarithmically spaced lines, at most 1 in size.

    Phases: M. R. Schroeder, IEEE Transactions on Information Theory 16 (1970) 85-89.
    """
    test = plant.test
    lines = np.unique(
        np.geomspace(test.lowest, HIGHEST * test.samples, test.lines).round().astype(int)
    )
    phase = -np.pi * np.arange(lines.size) ** 2 / lines.size
    angle = 2 * np.pi * np.outer(np.arange(test.samples), lines) / test.samples
    wave = np.cos(angle + phase).sum(axis=1)
    period: Array = wave / np.abs(wave).max()
    return period


def measured(plant: Stranger, excited: int = 0) -> tuple[Array, Array]:
    """Inputs and outputs (T, m, N) of all units with one input excited, after a first period of
    settling.
    """
    rig, rng = Rig(plant, plant.drawn()), np.random.default_rng(plant.seed + 1 + excited)
    test, wave = plant.test, multisine(plant)
    periods = test.periods + 1 + (1 if LONGER else 0)
    inputs, outputs, before = [], [], rig.y[0]
    for k in range(test.samples * periods):
        u = rig.u_rest.copy()
        u[excited] += test.amplitude[excited] * wave[k % test.samples]
        if test.hold is not None:
            gain, rate = test.hold
            away = rig.y[0] - rig.y_rest[0]
            u[0] += gain * away + rate * (rig.y[0] - before) / plant.period
            before = rig.y[0]
        shown = np.stack([one.converted(v) for one, v in zip(plant.inputs, u, strict=True)])
        inputs.append(shown)
        outputs.append(rig.read(rng))
        rig.advance(shown)
    return np.array(inputs)[test.samples :], np.array(outputs)[test.samples :]


def write_records(plant: Stranger, folder: Path) -> list[Path]:
    """Write the records of all units, and return their files.

    The units differ in the length of their records and in the time at which they begin.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rng, files = np.random.default_rng(plant.seed + 100), []
    for excited in range(len(plant.inputs)):
        u, y = measured(plant, excited)
        for unit in range(plant.units):
            longer = int(LONGER * rng.random() * plant.test.samples)
            count = plant.test.samples * plant.test.periods + longer
            time = rng.uniform(0, 100) + plant.period * np.arange(count)
            columns = np.column_stack([time, u[:count, :, unit], y[:count, :, unit]])
            end = (
                f"_{plant.inputs[excited].name.replace(' ', '_')}" if len(plant.inputs) > 1 else ""
            )
            files.append(folder / f"unit{unit + 1}{end}.csv")
            _write(files[-1], columns, (*plant.inputs, *plant.outputs), plant.test.delimiter)
    return files


def _write(file: Path, columns: Array, channels: tuple[Channel, ...], delimiter: str) -> None:
    """Write a file with names and units in its first line. With semicolons, numbers have decimal
    commas.
    """
    head = delimiter.join(["time [s]", *(f"{one.name} [{one.unit}]" for one in channels)])
    lines = [delimiter.join(f"{value:.9g}" for value in row) for row in columns]
    text = "\n".join(
        [head, *(line.replace(".", ",") for line in lines)] if delimiter == ";" else [head, *lines]
    )
    file.write_text(text + "\n", encoding="utf-8")
