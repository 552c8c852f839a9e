"""The records of a plant with several inputs and outputs, each of which moves one input."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.files.variables import read_table
from workbench.input_checks import as_list
from workbench.starter.columns import record_columns
from workbench.starter.first_look import FirstLook, first_look
from workbench.synthesis import WorkingPoint

MOVED = 0.05
"""An input that moves by less than this fraction of its largest movement counts as at rest."""

Columns = tuple[str, str, str | None]


@dataclass(frozen=True)
class ChannelRecords:
    """Names of the inputs and outputs; for each pair of them the columns, and a first look.

    ``files``: for each input the records that move it.
    """

    inputs: list[str]
    outputs: list[str]
    columns: dict[tuple[str, str], Columns]
    files: dict[str, list[Path]]
    looks: dict[tuple[str, str], FirstLook]

    @classmethod
    def read(
        cls,
        paths: Sequence[Path],
        inputs: Sequence[str],
        outputs: Sequence[str],
        time: str | None,
        record_dt: float | None,
    ) -> ChannelRecords:
        """Read every record.

        Raises InputError if there are more outputs than inputs, or a record moves no input or
        several; or as `record_columns` and `first_look`.
        """
        inputs, outputs = (as_list(names, "names of columns") for names in (inputs, outputs))
        if len(outputs) > len(inputs):
            raise InputError(
                f"{len(outputs)} outputs cannot follow set-points of their own by {len(inputs)} "
                f"input{'s' if len(inputs) > 1 else ''}: name as many inputs as outputs, or more"
            )
        columns = {
            (u, y): record_columns(paths[0], u, y, time, record_dt) for u in inputs for y in outputs
        }
        moving = _files_by_input(paths, [columns[u, outputs[0]][0] for u in inputs])
        files = dict(zip(inputs, moving, strict=True))
        looks = {(u, y): first_look(files[u], *columns[u, y], record_dt) for u, y in columns}
        return cls(inputs, outputs, columns, files, looks)

    @property
    def u_names(self) -> list[str]:
        """The columns of the inputs."""
        return [self.columns[u, self.outputs[0]][0] for u in self.inputs]

    @property
    def y_names(self) -> list[str]:
        """The columns of the outputs."""
        return [self.columns[self.inputs[0], y][1] for y in self.outputs]

    @property
    def time(self) -> str | None:
        """The column of the time."""
        return self.columns[self.inputs[0], self.outputs[0]][2]

    @property
    def period(self) -> float:
        """Sampling time [s] of the first record."""
        return self.looks[self.inputs[0], self.outputs[0]].period

    @property
    def point(self) -> WorkingPoint:
        """The means of all signals in their records."""
        looks, inputs, outputs = self.looks, self.inputs, self.outputs
        first, last = looks[inputs[0], outputs[0]].point, looks[inputs[-1], outputs[-1]].point
        u = [looks[name, outputs[0]].point.u[0] for name in inputs]
        y = [float(np.mean([looks[u, name].point.y[0] for u in inputs])) for name in outputs]
        units = {
            side: getattr(first, side) if getattr(first, side) == getattr(last, side) else "1"
            for side in ("u_unit", "y_unit")
        }
        return WorkingPoint(u, [float(f"{one:.5g}") for one in y], **units)

    def limits(self, given: Sequence[tuple[float, float]] | None) -> tuple[RealArray, RealArray]:
        """Lowest and highest values of the inputs: those given, or those in the records."""
        found = [self.looks[u, self.outputs[0]].limits for u in self.inputs]
        pairs = found if given is None else list(given)
        if len(pairs) != len(self.inputs):
            raise InputError(
                f"{len(pairs)} limits are given for {len(self.inputs)} inputs: one pair each"
            )
        low, high = np.array(pairs, dtype=float).T
        return low, high

    def channels(self) -> Iterator[tuple[str, str, str]]:
        """Name of each channel, such as "1-2" for output 1 and input 2; its input and output."""
        for j, u in enumerate(self.inputs):
            for i, y in enumerate(self.outputs):
                yield f"{i + 1}-{j + 1}", u, y


def _files_by_input(paths: Sequence[Path], inputs: Sequence[str]) -> list[list[Path]]:
    """The records that move each input. Raises InputError if one moves none or several."""
    moves = np.array(
        [[float(np.ptp(read_table(path).variables[name])) for name in inputs] for path in paths]
    )
    moved = moves > MOVED * moves.max(axis=0)
    for path, row in zip(paths, moved, strict=True):
        if row.sum() != 1:
            names = ", ".join(repr(name) for name, one in zip(inputs, row, strict=True) if one)
            raise InputError(
                f"{path} moves {names or 'no input'}; a record must move one of the inputs "
                f"{', '.join(map(repr, inputs))}, while the others rest"
            )
    found = [[path for path, one in zip(paths, column, strict=True) if one] for column in moved.T]
    for name, group in zip(inputs, found, strict=True):
        if len(group) < 2:
            raise InputError(
                f"{len(group)} record moves {name!r}; two plants or more are needed for every input"
            )
    return found
