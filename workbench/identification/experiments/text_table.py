"""Text tables as loggers and spreadsheets write them: found out, read, and said.

The separator, the decimal mark, the line of names, the row of units and the columns of text are
found out from the lines; what was found stands in `Columns.said`.
"""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from workbench.errors import InputError


@dataclass(frozen=True, eq=False)
class Columns:
    """What a file holds.

    ``variables`` are its numbers by name, a blank cell is NaN; ``units`` are known for some of
    them; ``texts`` says of other columns what they hold; ``said`` is what was found out.
    ``lines`` are the numbers of the rows' lines, from 0, in a file of text; ``named`` is false
    where no line names its columns.
    """

    variables: dict[str, np.ndarray]
    units: dict[str, str] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    said: str = ""
    lines: Sequence[int] = ()
    named: bool = True

    def place(self, row: int) -> str:
        """Where a row is: its line of a text, else its index."""
        return f"line {self.lines[row] + 1}" if self.lines else f"index {row}"


@dataclass(frozen=True)
class Layout:
    """How a line is divided into cells, and how a cell shows a number."""

    separator: str
    decimal: str

    @property
    def words(self) -> str:
        mark = _WORDS[self.separator]
        return f"separated by {mark}" + (", decimal comma" if self.decimal == "," else "")

    def cells(self, line: str) -> list[str]:
        """Cells of a line, without quotes and blanks around them."""
        if self.separator == _BLANKS:
            return [cell.strip('"') for cell in line.split()]
        quoted = csv.reader([line], delimiter=self.separator, skipinitialspace=True)
        return [cell.strip() for cell in next(quoted, [])]

    def is_number(self, cell: str) -> bool:
        if "_" in cell or (self.decimal == "," and "." in cell):
            return False
        try:
            float(cell.replace(self.decimal, "."))
        except ValueError:
            return False
        return True


_BLANKS = r"\s+"
_WORDS = {";": "semicolons", ",": "commas", "\t": "tabs", _BLANKS: "blanks"}
LAYOUTS = [Layout(mark, point) for point in ".," for mark in (",", ";", "\t", _BLANKS)]
LAYOUTS = [one for one in LAYOUTS if one.separator != one.decimal]
NUMBERS = re.compile(r"\s*[^\s#%]")
"""A line that is neither blank nor a comment."""
SAMPLE = 50
"""Lines of the middle, and of the end of a file, by which its layout is told."""
UNIT = re.compile(
    r"|[\[(].*[\])]|[-%1°]|[pnuµmckMG]?(s|sec|V|A|N|N\.?m|m|g|rad|Hz|W|Pa|bar|T|K|J|deg|°C|rpm)"
    r"(/(s|min|s\^?2|s²|V|A|N|rad))?"
)
"""Cells of a row of units: blank, in brackets, or a common unit."""
IN_BRACKETS = re.compile(r"(.*\S)\s*[\[(]([^\])]*)[\])]")
"""A name with its unit, such as ``torque [Nm]``."""


NO_NAMES = "no line names them"


def read_columns(path: Path) -> Columns:
    """The columns of a text file.

    Raises
    ------
    InputError
        It is no text, holds no numbers, or a line has a wrong number of cells or a word where a
        number should be; the message names the line.
    """
    text = _decoded(path)
    lines = text.splitlines()
    kept: Sequence[int] = range(len(lines))
    if any(mark in text for mark in "#%") or "" in lines or any(map(str.isspace, lines)):
        kept = [i for i in kept if NUMBERS.match(lines[i])]
    sample = kept if len(kept) <= 2 * SAMPLE else _sample(kept)
    layout, split = _layout([lines[i] for i in sample])
    rows = [cells for cells in split if any(map(layout.is_number, cells))]
    if not rows:
        raise InputError(f"{path} holds no numbers")
    width = Counter(map(len, rows)).most_common(1)[0][0]
    rows = [row for row in rows if len(row) == width]
    numeric = [_mostly(layout.is_number, [row[j] for row in rows]) for j in range(width)]
    used = width
    while used > 1 and not any(row[used - 1] for row in rows):
        used -= 1  # every line ends with separators

    def is_data(i: int) -> bool:
        cells = layout.cells(lines[i])
        told = [cell for cell, number in zip(cells, numeric, strict=False) if number and cell]
        return used <= len(cells) <= width and bool(told) and all(map(layout.is_number, told))

    start = next((place for place, i in enumerate(kept) if is_data(i)), 0)
    head = kept[:start] or [i for i in range(kept[start]) if lines[i].strip()][-1:]
    names, units, named = _names(path, layout, lines, head, used, commented=not start)
    table = _columns(path, layout, lines, kept[start:], (used, width))
    variables: dict[str, np.ndarray] = {}
    texts: dict[str, str] = {}
    for name, values, number in zip(names, table, numeric, strict=False):
        if values.dtype.kind in "if":
            variables[name] = values.astype(float)
            continue
        cells = [str(cell).strip() for cell in values]
        place = next(k for k, cell in enumerate(cells) if not layout.is_number(cell))
        wrong = f"line {kept[start + place] + 1}: {cells[place]!r} is not a number"
        if number:
            raise InputError(f"{path}, {wrong}")
        texts[name] = wrong
    left_out = f"; without numbers: {', '.join(texts)}" if texts else ""
    return Columns(
        variables,
        {name: unit for name, unit in units.items() if unit and name in variables},
        texts,
        f"columns {layout.words}, {named}{left_out}",
        kept[start:],
        named != NO_NAMES,
    )


def _decoded(path: Path) -> str:
    """Text of a file, in UTF-8, or as Windows writes it."""
    raw = path.read_bytes()
    if b"\x00" in raw:
        raise InputError(f"{path} is no text; .mat and .nc files must be named so")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("cp1252", errors="replace")


def _sample(kept: Sequence[int]) -> list[int]:
    """Lines of the later half, where no head is, and the last ones."""
    half = np.linspace(len(kept) // 2, len(kept) - SAMPLE - 1, SAMPLE).astype(int)
    return [kept[k] for k in half] + list(kept[-SAMPLE:])


def _layout(lines: Sequence[str]) -> tuple[Layout, list[list[str]]]:
    """The layout that finds most numbers, then fewest words beside them; and the lines' cells."""

    def score(split: list[list[str]], layout: Layout) -> tuple[float, float]:
        rows = [[cell for cell in cells if cell] for cells in split]
        counts = [(sum(map(layout.is_number, row)), len(row)) for row in rows]
        told = [(numbers, cells) for numbers, cells in counts if numbers]
        numbers, cells = (sum(one[k] for one in told) for k in range(2))
        return numbers, numbers / max(cells, 1)

    if not lines:
        return LAYOUTS[0], []
    tried = [(layout, [layout.cells(line) for line in lines]) for layout in LAYOUTS]
    return max(tried, key=lambda one: score(one[1], one[0]))


def _mostly(is_number: Callable[[str], bool], cells: Sequence[str]) -> bool:
    """Half of the cells that are not blank, or more, are numbers."""
    told = [cell for cell in cells if cell]
    return 2 * sum(map(is_number, told)) >= len(told)


def _names(
    path: Path,
    layout: Layout,
    lines: Sequence[str],
    head: Sequence[int],
    used: int,
    *,
    commented: bool,
) -> tuple[list[str], dict[str, str], str]:
    """Names of the columns, their units, and which lines told them.

    The names stand in the last line before the numbers, or above a row of units; a comment names
    them where it has as many cells as the numbers (``commented``).
    """

    def cells(i: int) -> list[str]:
        text = lines[i].strip().lstrip("#% ") if commented else lines[i]
        found = layout.cells(text)
        if len(found) != used and layout.separator == _BLANKS:  # names may contain blanks
            wider = re.split(r"\t+|\s{2,}|[,;]\s*", text.strip())
            found = wider if len(wider) == used else found
        while len(found) > used and not found[-1]:
            found = found[:-1]
        return [cell.strip('"') for cell in found]

    plain = [str(j + 1) for j in range(used)]
    last = cells(head[-1]) if head else []
    told = len(last) == used and any(last)
    if commented and (not told or any(map(layout.is_number, last))):
        return plain, {}, NO_NAMES
    if not told:
        if len(last) > 1:
            raise InputError(
                f"{path}, line {head[-1] + 1} names {len(last)} columns, {used} are needed"
            )
        return plain, {}, NO_NAMES
    wrong = [cell for cell in last if cell and not layout.is_number(cell)]
    if len(wrong) < len([cell for cell in last if cell]):
        raise InputError(f"{path}, line {head[-1] + 1}: {(wrong or last)[0]!r} is not a number")
    above = cells(head[-2]) if len(head) > 1 else []
    if len(above) == used and all(above) and all(map(UNIT.fullmatch, last)):
        units = dict(zip(above, (cell.strip("[]()") for cell in last), strict=True))
        return _unlike(path, above), units, f"names in line {head[-2] + 1}, units below"
    names = [cell or plain[j] for j, cell in enumerate(last)]
    brackets = {name: found[2] for name in names if (found := IN_BRACKETS.fullmatch(name))}
    return _unlike(path, names), brackets, f"names in line {head[-1] + 1}"


def _unlike(path: Path, names: list[str]) -> list[str]:
    if len(set(names)) < len(names):
        raise InputError(f"{path}: two columns have one name: {', '.join(names)}")
    return names


def _columns(
    path: Path,
    layout: Layout,
    lines: Sequence[str],
    rows: Sequence[int],
    widths: tuple[int, int],
) -> list[np.ndarray]:
    """The columns of the lines with numbers; those that hold words too are objects."""
    import pandas

    used, width = widths
    chosen = lines[rows.start :] if isinstance(rows, range) else [lines[i] for i in rows]
    text = "\n".join(chosen)
    plain = '"' not in text and layout.separator != _BLANKS
    mark = layout.separator
    counts = [line.count(mark) + 1 if plain else len(layout.cells(line)) for line in chosen]
    if min(counts) < used or max(counts) > width:
        k = next(k for k, count in enumerate(counts) if not used <= count <= width)
        raise InputError(f"{path}, line {rows[k] + 1}: {counts[k]} columns, {used} are needed")
    frame = pandas.read_csv(
        io.StringIO(text),
        header=None,
        names=list(range(width)),
        index_col=False,
        sep=layout.separator,
        decimal=layout.decimal,
        skipinitialspace=True,
    )
    return [frame[j].to_numpy() for j in range(used)]
