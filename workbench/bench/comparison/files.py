"""Export of a comparison's cells as a table for other programs: CSV or Parquet."""

from __future__ import annotations

import csv
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from workbench._core.heavy_types import Dataset
from workbench.bench.comparison.layout import COORDINATES, DIMS, asked_cells, command
from workbench.bench.comparison.verdicts import judged_cells
from workbench.errors import InputError

FORMATS = (".csv", ".parquet")


def write_cells(data: Dataset, path: str | Path) -> Path:
    """Write every cell of a comparison as a row: labels, all variables, and the command.

    A column's name carries its unit, such as ``solve [s]``. An unknown number is an empty field in
    CSV, and null in Parquet.

    Parameters
    ----------
    data
        Dataset of a comparison.
    path
        File to write; its suffix, ``.csv`` or ``.parquet``, selects the format.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        Another suffix, a folder that does not exist, or Parquet without the package pyarrow.
    ResultError
        The dataset is not that of a comparison.
    """
    path = need_table_file(path)
    columns = cell_columns(data)
    if path.suffix == ".csv":
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(columns)
            rows = zip(*columns.values(), strict=True)
            writer.writerows([["" if value is None else value for value in row] for row in rows])
    else:
        _write_parquet(columns, path)
    return path


def need_table_file(path: str | Path) -> Path:
    """The path of a file that can hold cells. Raises `InputError` as `write_cells` does."""
    path = Path(path)
    if path.suffix not in FORMATS:
        raise InputError(f"cells are written to {' or '.join(FORMATS)}, not to {path.name!r}")
    if not path.parent.is_dir():
        raise InputError(f"the folder {path.parent} of {path.name!r} does not exist; make it first")
    if path.suffix == ".parquet" and find_spec("pyarrow") is None:
        raise InputError(
            "Parquet needs the package pyarrow: pip install 'robust-workbench[parquet]'; "
            "or write to a .csv file"
        )
    return path


def cell_columns(data: Dataset) -> dict[str, list[Any]]:
    """The cells as columns, by name with unit; None for unknown numbers."""
    data = judged_cells(data)
    places = np.argwhere(asked_cells(data))
    found: dict[str, list[Any]] = {}
    for name in COORDINATES:
        values = data[name].values
        # Every coordinate belongs to one dimension.
        along = DIMS.index(str(data[name].dims[0]))
        found[_named(data, name)] = [_plain(values[place[along]]) for place in places]
    index = tuple(places.T)
    for name in map(str, data.data_vars):
        found[_named(data, name)] = [_plain(value) for value in data[name].values[index]]
    found["command"] = [command(data, tuple(place)) for place in places.tolist()]
    return found


def _write_parquet(columns: dict[str, list[Any]], path: Path) -> None:
    import pyarrow
    from pyarrow import parquet

    parquet.write_table(pyarrow.table(columns), path)


def _named(data: Dataset, name: str) -> str:
    """Name of a column, with its unit if it has one."""
    column = "method" if name == DIMS[1] else name
    unit = str(data[name].attrs.get("units", "1"))
    return column if unit == "1" else f"{column} [{unit}]"


def _plain(value: Any) -> Any:
    """A value of an array as a plain Python value; None for NaN."""
    plain = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(plain, float) and np.isnan(plain) else plain
