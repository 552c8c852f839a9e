"""Cells that are not plain numbers; they are read as numbers when their column is used."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from workbench.identification.files.units import is_unit

BLANK = frozenset(("", "-", "--", "---", "#n/a", "n/a", "na", "n.a.", "nan", "null", "none", "nil"))
"""Contents of blank cells, in lower case."""
SWITCHES = {"true": 1.0, "false": 0.0, "on": 1.0, "off": 0.0, "yes": 1.0, "no": 0.0}
FORTRAN = str.maketrans("Dd", "Ee")
"""Replaces the exponent letter D of double precision in Fortran by E."""
QUANTITY = re.compile(r"([-+]?[\d.,][\d.,]*(?:[eEdD][-+]?\d+)?)\s*([^\W\d_][^\s;,]*|[°%][^\s;,]*)?")
"""A number, perhaps followed by its unit."""
UNIT_FIRST = re.compile(r"[ij]\*?(?=[\d.])")
"""The imaginary unit before its number."""
BETWEEN_GROUPS = re.compile(r"(?<=\d)[' ](?=\d{3}(?!\d))|^'")
"""Apostrophes and blanks between thousands, and the apostrophe with which Excel marks a text."""
GROUPS = {
    ".": re.compile(r"[-+]?\d{1,3}(,\d{3})+(\.\d*)?"),
    ",": re.compile(r"[-+]?\d{1,3}(\.\d{3})+(,\d*)?"),
}
"""Numbers with separated thousands, by their decimal mark."""


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell is a plain number."""
    if "_" in cell or (decimal == "," and "." in cell):
        return False
    try:
        float(cell.replace(decimal, ".").translate(FORTRAN))
    except ValueError:
        return False
    return True


def is_quantity(cell: str, decimal: str) -> bool:
    """Whether a cell is a number followed by its unit."""
    found = QUANTITY.fullmatch(cell)
    return bool(found and found[2] and is_number(found[1], decimal) and is_unit(found[2]))


def mostly_numbers(cells: Sequence[str], decimal: str) -> bool:
    """Whether at least half of the cells that are not blank are numbers."""
    told = [cell for cell in cells if cell.lower() not in BLANK]
    return bool(told) and 2 * sum(is_number(cell, decimal) for cell in told) >= len(told)


def as_numbers(cells: Sequence[str], decimal: str) -> tuple[np.ndarray, str] | int:
    """The numbers of a column, and the unit that all its cells name ("" if none).

    If some cell is not a number, the index of the first such cell is returned instead.
    """
    first = next((k for k, cell in enumerate(cells) if cell.lower() not in BLANK), None)
    if first is not None and not _may_be_number(cells[first]):
        return first
    told = [BETWEEN_GROUPS.sub("", cell.strip()) for cell in cells]
    low = [cell.lower() for cell in told]
    if all(cell in SWITCHES or cell in BLANK for cell in low):
        return np.array([SWITCHES.get(cell, np.nan) for cell in low]), ""
    marks = [cell for cell in told if GROUPS[decimal].fullmatch(cell)]
    apart = "." if decimal == "," else ","
    grouped = any(apart in cell and decimal in cell for cell in marks)
    values, units = np.full(len(told), np.nan), set()
    for place, cell in enumerate(told):
        if low[place] in BLANK:
            continue
        if grouped and GROUPS[decimal].fullmatch(cell):
            cell = cell.replace(apart, "")
        found = QUANTITY.fullmatch(cell)
        number = found[1] if found else cell
        if not is_number(number, decimal) or (found and apart in found[1]):
            return place
        unit = (found and found[2]) or ""
        units.add(unit)
        if len(units) > 1 or (unit and not is_unit(unit)):
            return place
        values[place] = float(number.replace(decimal, ".").translate(FORTRAN))
    return values, units.pop() if units else ""


def _may_be_number(cell: str) -> bool:
    """Whether a cell looks like a number or a switch state; dates and words do not."""
    plain = BETWEEN_GROUPS.sub("", cell.strip())
    return plain.lower() in SWITCHES or bool(QUANTITY.fullmatch(plain)) or is_number(plain, ".")


def as_complex(cells: Sequence[str], decimal: str) -> np.ndarray | int:
    """The complex numbers of a column, or the index of the first cell that is none."""
    values = np.full(len(cells), np.nan, dtype=complex)
    for place, cell in enumerate(cells):
        text = re.sub(r"\s+", "", cell).strip("()").lower().replace(decimal, ".")
        if text in BLANK:
            continue
        if UNIT_FIRST.search(text):  # 1+i*2
            text = UNIT_FIRST.sub("", text) + "j"
        try:
            values[place] = complex(re.sub(r"\*?[ij]$", "j", text))
        except ValueError:
            return place
    return values
