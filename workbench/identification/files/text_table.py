"""Text tables of loggers and spreadsheets: their layout is detected, read, and reported.

Separator, decimal mark, line of names, row of units and text columns are detected from the lines;
`Columns.said` reports them.
"""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from workbench.errors import InputError
from workbench.identification.files.columns import Columns
from workbench.identification.files.encodings import decoded
from workbench.identification.files.heads import NO_NAMES, Head, read_head
from workbench.identification.files.layouts import BLANKS, COMMENT_MARKS, Layout, found_layout

CONTENT = re.compile(rf"\s*[^\s{COMMENT_MARKS}]")
"""A line that is neither blank nor a comment."""
RULE = re.compile(r"[-=+|\s]*(---|===)[-=+|\s]*")
"""A ruled line below the names."""
MOST_COLUMNS = 10_000
"""Most columns of a table; a file with more is a transposed matrix, or no table."""
SAMPLE = 50
"""Number of lines from the middle, and from the end of a file, by which its layout is detected."""


def read_columns(path: Path) -> Columns:
    """The columns of a text file.

    Raises
    ------
    InputError
        It is not text, holds no numbers, or a line has a wrong number of cells; the message names
        the line.
    """
    return columns_of_text(path, decoded(path))


def columns_of_text(path: Path, text: str) -> Columns:
    """The columns of a text; messages name ``path`` and are those of `read_columns`."""
    lines = text.splitlines()
    kept = _lines_with_content(text, lines)
    sample = kept if len(kept) <= 2 * SAMPLE else _sample(kept)
    layout, split = found_layout([lines[i] for i in sample])
    rows = [cells for cells in split if any(map(layout.is_number, cells))]
    if not rows:
        raise InputError(
            f"{path} holds no numbers in columns: separate columns by commas, semicolons, tabs or "
            "blanks"
        )
    width = Counter(map(len, rows)).most_common(1)[0][0]
    if width > MOST_COLUMNS:
        raise InputError(
            f"{path} has {width} columns; at most {MOST_COLUMNS} are read: exchange rows and "
            "columns"
        )
    rows = [row for row in rows if len(row) == width]
    used = width
    while used > 1 and not any(row[used - 1] for row in rows):
        used -= 1  # every line ends with separators
    numeric = [_are_mostly_numbers(layout, [row[j] for row in rows]) for j in range(used)]
    if not any(numeric):
        raise InputError(f"{path} has no column whose cells are mostly numbers")
    start = _start(layout, lines, kept, numeric, (used, width))
    head = read_head(path, layout, lines, kept[:start], kept[start], used)
    kept, end = _without_end(layout, lines, kept[start:], numeric, text[-1:] in "\r\n")
    table = _columns(path, layout, lines, kept, (used, width), head)
    variables: dict[str, np.ndarray] = {}
    texts: dict[str, np.ndarray] = {}
    for name, values in zip(head.names, table, strict=True):
        if values.dtype.kind in "biuf":
            variables[name] = values.astype(float)
        else:
            texts[name] = values
    left_out = f"; without numbers: {', '.join(texts)}" if texts else ""
    return Columns(
        path,
        variables,
        {name: unit for name, unit in head.units.items() if unit},
        texts,
        said=f"columns {layout.words}, {head.said}{left_out}{end}",
        lines=kept,
        named=head.said != NO_NAMES,
        decimal=layout.decimal,
    )


def _lines_with_content(text: str, lines: Sequence[str]) -> Sequence[int]:
    """Numbers of the lines that are not blank, comments or rules."""
    kept: Sequence[int] = range(len(lines))
    if any(mark in text for mark in COMMENT_MARKS) or "" in lines or any(map(str.isspace, lines)):
        kept = [i for i in kept if CONTENT.match(lines[i])]
    if "---" in text or "===" in text:
        kept = [i for i in kept if not RULE.fullmatch(lines[i])]
    if kept and re.fullmatch(r"sep=.?", lines[kept[0]].strip()):  # for Excel
        kept = kept[1:]
    return kept


def _sample(kept: Sequence[int]) -> list[int]:
    """Lines from the later half, which has no head, and the last ones."""
    half = np.linspace(len(kept) // 2, len(kept) - SAMPLE - 1, SAMPLE).astype(int)
    return [kept[k] for k in half] + list(kept[-SAMPLE:])


def _are_mostly_numbers(layout: Layout, cells: Sequence[str]) -> bool:
    """Whether at least half of the cells that are not blank are numbers."""
    told = list(filter(layout.is_told, cells))
    return bool(told) and 2 * sum(map(layout.is_number, told)) >= len(told)


def _start(
    layout: Layout,
    lines: Sequence[str],
    kept: Sequence[int],
    numeric: Sequence[bool],
    widths: tuple[int, int],
) -> int:
    """Index of the first line of numbers.

    In this line all cells of numeric columns are numbers; or most of them are, if it follows a line
    of names and precedes another line of numbers.
    """

    def share(place: int) -> float:
        """Share of numbers among the cells of numeric columns; -1 if the line has other columns."""
        cells = layout.cells(lines[kept[place]])
        if not widths[0] <= len(cells) <= widths[1]:
            return -1.0
        found = [cell for cell, number in zip(cells, numeric, strict=False) if number]
        told = list(filter(layout.is_told, found))
        return sum(map(layout.is_number, told)) / len(told) if told else -1.0

    before = -1.0
    for place in range(len(kept)):
        now = share(place)
        if now == 1.0:
            return place
        if before == 0.0 and now > 0.5 and place + 1 < len(kept) and share(place + 1) == 1.0:
            return place
        before = now
    return 0


def _without_end(
    layout: Layout, lines: Sequence[str], kept: Sequence[int], numeric: Sequence[bool], whole: bool
) -> tuple[Sequence[int], str]:
    """Lines without words below the numbers and without an incomplete last line; and a report.

    A line is incomplete if cells are missing, a quotation is open, or the file ends in the middle
    of a number (not ``whole``).
    """

    def is_footer(i: int) -> bool:
        cells = layout.cells(lines[i])
        return len(cells) < len(numeric) and not any(map(layout.is_number, cells))

    end = len(kept)
    while end > 1 and is_footer(kept[end - 1]):
        end -= 1
    if end < len(kept):
        told = f"; words below the numbers left out, from line {kept[end] + 1} on"
        return kept[:end], told
    cells = layout.cells(lines[kept[-1]])
    last = cells[-1] if cells else ""
    broken = numeric[len(cells) - 1 :][:1] == [True] and not layout.is_number(last)
    torn = len(cells) < len(numeric) or lines[kept[-1]].count('"') % 2
    if len(kept) > 1 and (torn or (broken and not whole)):
        return kept[:-1], f"; the last line, {kept[-1] + 1}, is torn and left out"
    return kept, ""


def _columns(
    path: Path,
    layout: Layout,
    lines: Sequence[str],
    rows: Sequence[int],
    widths: tuple[int, int],
    head: Head,
) -> list[np.ndarray]:
    """The columns of the lines with numbers; columns that also hold words become objects."""
    import pandas

    used, width = widths
    chosen = [lines[i] for i in rows]
    text = "\n".join(chosen)
    mark = layout.separator
    count: Callable[[str], int] = (
        (lambda line: len(layout.cells(line)))
        if '"' in text or mark == BLANKS
        else (lambda line: line.count(mark) + 1)
    )
    unclosed = [k for k, line in enumerate(chosen) if line.count('"') % 2] if '"' in text else []
    if unclosed:
        raise InputError(
            f"{path}, line {rows[unclosed[0]] + 1}: a quotation is open at its end: close it"
        )
    counts = list(map(count, chosen))
    if min(counts) < used or max(counts) > width:
        k = next(k for k, count in enumerate(counts) if not used <= count <= width)
        raise InputError(
            f"{path}, line {rows[k] + 1}: {counts[k]} columns, {used} are needed: complete that "
            "line, or cut the record there"
        )
    frame = pandas.read_csv(
        io.StringIO(text),
        header=None,
        names=list(range(width)),
        index_col=False,
        sep=mark,
        decimal=layout.decimal,
        skipinitialspace=True,
        skip_blank_lines=False,
        low_memory=False,
    )
    return [frame[j].to_numpy() for j in range(used)]
