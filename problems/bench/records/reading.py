"""Halves of public records, read from the user's folder of copies."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workbench.errors import InputError
from workbench.identification import StateSpaceFit
from workbench.types import RealArray

from .catalogue import Columns, PublicRecord, Section

HIGHER_ORDERS = (10, 12, 16)
"""Orders that are tried beyond the usual ones, if the record has enough samples for them."""


@dataclass(frozen=True, eq=False)
class Half:
    """Inputs u (N, nu) and outputs y (N, ny) of one half of a record."""

    u: RealArray
    y: RealArray

    def halved(self) -> tuple[Half, Half]:
        """The first and the second half of this half."""
        middle = len(self.u) // 2
        return Half(self.u[:middle], self.y[:middle]), Half(self.u[middle:], self.y[middle:])


def read_halves(record: PublicRecord, folder: Path) -> tuple[Half, Half]:
    """First and second half of a record whose files are in a folder.

    Raises InputError if a file is missing or has other columns.
    """
    parts = [_read(record, section, folder) for section in record.sections]
    if len(parts) == 1:
        return parts[0].halved()
    first, second = parts
    return first, second


def question(first: Half, second: Half, title: str, sample_time: float | None) -> StateSpaceFit:
    """The fit that is asked of us: models estimated on the first half and judged on the second."""

    def asked(orders: tuple[int, ...] | None) -> StateSpaceFit:
        return StateSpaceFit(
            [first.u, second.u],
            [first.y, second.y],
            estimation=len(first.u),
            orders=orders,
            title=title,
            dt=sample_time or 1.0,
            samples="rows",
        )

    program = asked(None)
    for order in HIGHER_ORDERS:
        try:
            program = asked((*(program.orders or ()), order))
        except InputError:  # the record has too few samples for it
            break
    return program


def _read(record: PublicRecord, section: Section, folder: Path) -> Half:
    path = folder / section.file
    if not path.is_file():
        raise InputError(f"{record.name} needs your copy of {section.file} in {folder}")
    table = _TABLES.get(path.suffix, _text)(path)
    signals = [_columns(table, columns, path) for columns in (section.inputs, section.outputs)]
    u, y = (signal[: record.longest] for signal in signals)
    return Half(u, y)


def _columns(table: Any, columns: Columns, path: Path) -> RealArray:
    try:
        parts = [
            table[column] if isinstance(column, str) else table[:, column] for column in columns
        ]
    except (IndexError, KeyError, ValueError) as error:
        raise InputError(f"{path.name} has no column {error}; {columns} are needed") from None
    found = np.column_stack([np.ravel(part) for part in parts]).astype(float)
    return found[np.isfinite(found).all(axis=1)]


def _text(path: Path) -> RealArray:
    first = path.read_text(encoding="utf-8").lstrip().splitlines()[0]
    return np.loadtxt(path, delimiter="," if "," in first else None)


def _named(path: Path) -> Any:
    import pandas as pd

    table = pd.read_csv(path)
    return {name.strip(): table[name].to_numpy() for name in table}


def _matlab(path: Path) -> Any:
    from scipy.io import loadmat

    return loadmat(path)


_TABLES = {".csv": _named, ".mat": _matlab}
