"""The layout of a text table: how lines are divided into cells, and how numbers are written."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, replace

from workbench.identification.files.cells import BLANK, is_number, is_quantity

COMMENT_MARKS = "#%"
"""Characters with which a line of comment begins, perhaps after blanks."""
BLANKS = r"\s+"
"""The separator of columns that are separated by blanks, as a regular expression."""
WORDS = {";": "semicolons", ",": "commas", "\t": "tabs", BLANKS: "blanks"}


@dataclass(frozen=True)
class Layout:
    """How a line is divided into cells, and how a cell shows a number, perhaps with its unit."""

    separator: str
    decimal: str
    with_units: bool = False

    @property
    def words(self) -> str:
        """The layout in words."""
        mark = WORDS[self.separator]
        return f"separated by {mark}" + (", decimal comma" if self.decimal == "," else "")

    def cells(self, line: str) -> list[str]:
        """Cells of a line, without quotes and surrounding blanks."""
        if self.separator == BLANKS:
            return [cell.strip('"') for cell in line.split()]
        if '"' not in line:
            return [cell.strip() for cell in line.split(self.separator)]
        quoted = csv.reader([line], delimiter=self.separator, skipinitialspace=True)
        try:
            return [cell.strip() for cell in next(quoted, [])]
        except csv.Error:  # a quotation with more than 131,072 characters
            return [line]

    def is_number(self, cell: str) -> bool:
        """Whether a cell is a number."""
        plain = is_number(cell, self.decimal)
        return plain or (self.with_units and is_quantity(cell, self.decimal))

    def is_told(self, cell: str) -> bool:
        """Whether a cell is not blank."""
        return cell.lower() not in BLANK


LAYOUTS = [Layout(mark, point) for point in ".," for mark in (",", ";", "\t", BLANKS)]
QUOTED = [one for one in LAYOUTS if one.separator == one.decimal]
"""Layouts that need quotes around numbers."""
LAYOUTS = [one for one in LAYOUTS if one not in QUOTED]


def found_layout(lines: Sequence[str]) -> tuple[Layout, list[list[str]]]:
    """The layout with the most numbers and then the least of other text; and the lines' cells.

    If words remain, numbers followed by units count too.
    """

    def score(split: list[list[str]], layout: Layout) -> tuple[float, float]:
        count, inside, written = 0, 0, 0
        for row in split:
            if numbers := list(filter(layout.is_number, row)):
                count += len(numbers)
                inside += sum(map(len, numbers))
                written += sum(map(len, row))
        return count, inside / max(written, 1)

    best, most = (LAYOUTS[0], [LAYOUTS[0].cells(line) for line in lines]), (0.0, 0.0)
    for with_units in (False, True):
        for plain in LAYOUTS + QUOTED * any('"' in line for line in lines):
            layout = replace(plain, with_units=with_units)
            split = [layout.cells(line) for line in lines]
            if (found := score(split, layout)) > most:
                best, most = (layout, split), found
        if most[1] == 1.0:  # no words are left
            break
    return best
