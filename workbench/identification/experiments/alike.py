"""Records from several files, converted to the same units."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from workbench._core.heavy_types import Dataset
from workbench.errors import InputError
from workbench.identification.experiments.records import read_record
from workbench.identification.files.units import converted

UNKNOWN = "1"
"""Unit of a channel for which no unit is stated."""


def read_alike(
    paths: Sequence[Path], input: str, output: str, dt: float | None, time: str | None
) -> tuple[list[Dataset], list[str]]:
    """Records of one input and one output, in the units of the first file that states them.

    Returns
    -------
    records, said
        As `read_record` returns them; and sentences on conversions and assumptions.

    Raises
    ------
    InputError
        As `read_record`; or two files have units that cannot be converted; the message names both.
    """
    records = [read_record(path, [input], [output], dt=dt, time=time) for path in paths]
    said = []
    for variable, name in (("u", input), ("y", output)):
        units = [str(record[variable].attrs["units"]) for record in records]
        first = next((k for k, unit in enumerate(units) if unit != UNKNOWN), None)
        if first is None:
            continue
        for path, record, unit in zip(paths, records, units, strict=True):
            if unit == units[first]:
                continue
            if unit == UNKNOWN:
                said.append(f"{path.name}: unit of {name!r} unknown, taken as {units[first]}")
            else:
                try:
                    values = converted(record[variable].values, unit, units[first])
                except InputError as error:
                    raise InputError(
                        f"{path}: {name!r} is in {unit!r}, and in {units[first]!r} in "
                        f"{paths[first]}: {error}"
                    ) from None
                record[variable].values[:] = values
                said.append(f"{path.name}: {name!r} converted from {unit} to {units[first]}")
            record[variable].attrs["units"] = units[first]
    return records, said
