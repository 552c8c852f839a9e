"""Contents of a file: columns that are read as numbers when they are used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.files.cells import as_complex, as_numbers, mostly_numbers
from workbench.identification.files.clocks import as_seconds
from workbench.identification.files.names import A_COLUMN, Role, split_name
from workbench.identification.files.units import converted, plain_unit

LATEST_SECOND = 1e11
"""Largest number of seconds since 1970 (year 5138); larger instants must be in another unit."""


@dataclass(frozen=True, eq=False)
class Columns:
    """Contents of a file.

    ``variables`` are the numeric columns by name, with NaN for blank cells; ``texts`` are the cells
    of other columns, NaN if blank, until they are read as numbers; ``refused`` says why further
    columns cannot be read. ``units`` are those stated by a row of units or an attribute. ``said``
    describes how the file was interpreted. ``lines`` are the line numbers of the rows, from 0, in a
    text file; ``named`` is false if no line names the columns.
    """

    path: Path
    variables: dict[str, np.ndarray]
    units: dict[str, str] = field(default_factory=dict)
    texts: dict[str, np.ndarray] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    said: str = ""
    lines: Sequence[int] = ()
    named: bool = True
    decimal: str = "."

    def place(self, row: int) -> str:
        """Place of a row: its line in a text file, otherwise its index."""
        return f"line {self.lines[row] + 1}" if self.lines else f"index {row}"

    @property
    def names(self) -> list[str]:
        """Names of all columns."""
        return [*self.variables, *self.texts, *self.refused]

    def own_name(self, name: str, role: Role = "signal") -> str:
        """The name of a column as in the file, which may contain its unit.

        Raises InputError if several columns have the name.
        """
        if name in self.names:
            return name
        numbered = [own for own in self.texts | self.variables if A_COLUMN.sub("", own) == name]
        bare = split_name(name, role)[0]
        found = numbered or [own for own in self.names if split_name(own, role)[0] == bare]
        if len(found) > 1:
            raise InputError(
                f"{self.path}: {len(found)} columns are called {name!r}: name one of them, "
                f"{', '.join(map(repr, found))}"
            )
        return found[0] if found else name

    def unit(self, name: str, role: Role = "signal") -> str | None:
        """The unit of a column, from a row of units or its name; None if neither states it."""
        return self.units.get(name) or split_name(name, role)[1]

    def numbers(self, name: str) -> np.ndarray:
        """A column as numbers.

        Raises InputError if there is no such column or a cell is not a number; the message names
        it.
        """
        if name in self.variables:
            return self.variables[name]
        found = as_numbers(self._cells(name), self.decimal)
        if isinstance(found, int):
            raise self._wrong(name, found, "a number")
        self.variables[name], unit = found
        del self.texts[name]
        if unit:
            self.units.setdefault(name, unit)
        return self.variables[name]

    def real_numbers(self, name: str) -> RealArray:
        """A column as real numbers; raises InputError as `numbers`, and for complex ones."""
        values = self.numbers(name)
        if np.iscomplexobj(values):
            raise InputError(f"{self.path}: {name!r} holds complex numbers; real ones are needed")
        return values

    def is_mostly_numbers(self, name: str) -> bool:
        """Whether at least half of a text column's cells that are not blank are numbers."""
        return mostly_numbers(self._cells(name), self.decimal)

    def complex_numbers(self, name: str) -> np.ndarray:
        """A column as complex numbers; raises InputError as `numbers`."""
        if name in self.variables:
            return self.variables[name]
        found = as_complex(self._cells(name), self.decimal)
        if isinstance(found, int):
            raise self._wrong(name, found, "a complex number")
        return found

    def seconds(self, name: str) -> tuple[RealArray, str]:
        """A column as instants [s], and how they were interpreted.

        Raises InputError as `numbers`; if the unit is not one of time; and if it is unknown and
        cannot be seconds.
        """
        if name in self.texts:
            cells = self._cells(name)
            wrong = as_numbers(cells, self.decimal)
            if isinstance(wrong, int):
                return self._stamps(name, cells, wrong)
        values = self.real_numbers(name)
        unit = self.unit(name, "time")
        if unit is not None:
            return self.converted(values, name, unit, "s"), ""
        if values.size and np.nanmax(np.abs(values), initial=0.0) > LATEST_SECOND:
            raise InputError(
                f"{self.path}: column {name!r} has no unit, and {values.ravel()[0]:.6g} is no "
                f"number of seconds: rename the column, such as {name}_ms or {name}_us"
            )
        return values, f"unit of {name!r} unknown, taken as s"

    def _stamps(self, name: str, cells: Sequence[str], no_number: int) -> tuple[RealArray, str]:
        """Dates and clock times of a text column [s]; NaN for a blank cell.

        If the column does not hold dates, the error names the first cell that is neither a number
        nor a date.
        """
        rows = [row for row, cell in enumerate(cells) if cell]
        try:
            found = as_seconds([cells[row] for row in rows])
        except InputError as error:
            raise InputError(f"{self.path}, column {name!r}: {error}") from None
        if isinstance(found, int):
            row = max(rows[found], no_number)
            raise self._wrong(name, row, "a number, date or clock")
        seconds = np.full(len(cells), np.nan)
        seconds[rows] = found[0]
        return seconds, f"{name!r} holds {found[1]}"

    def hertz(self, name: str) -> tuple[RealArray, str]:
        """A column as frequencies [Hz], and how they were read; raises InputError as `seconds`."""
        values = self.real_numbers(name)
        unit = self.unit(name, "frequency")
        if unit is not None:
            return self.converted(values, name, unit, "Hz"), ""
        if name.lower() in ("omega", "w", "ω"):
            said = f"unit of {name!r} unknown, taken as rad/s"
            return self.converted(values, name, "rad/s", "Hz"), said
        return values, f"unit of {name!r} unknown, taken as Hz"

    def converted(self, values: np.ndarray, name: str, unit: str, to: str) -> RealArray:
        """A column's values in another unit; raises InputError if they cannot be converted."""
        try:
            return converted(values, plain_unit(unit), to)
        except InputError as error:
            raise InputError(f"{self.path}: {name!r} is in {unit!r}: {error}") from None

    def _cells(self, name: str) -> Sequence[str]:
        """The cells of a text column; InputError if there is none."""
        if name in self.texts:
            return ["" if cell != cell else str(cell).strip() for cell in self.texts[name]]
        if name in self.refused:
            raise InputError(f"{self.path}: {name!r} {self.refused[name]}")
        raise InputError(
            f"{self.path} has no variable {name!r}; it has {', '.join(self.names) or 'none'}"
            f" ({self.said})"
        )

    def _wrong(self, name: str, row: int, what: str) -> InputError:
        return InputError(
            f"{self.path}, {self.place(row)}: {self._cells(name)[row]!r} is not {what} (column "
            f"{name!r}): correct that cell, or name another column"
        )
