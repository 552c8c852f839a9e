"""Markdown tables from heads and rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from workbench._core.heavy_types import DataArray

Rows = tuple[list[str], list[list[str]]]
"""A table of a Study: the heads of its columns, and its rows."""


def markdown_table(heads: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """A Markdown table with columns of even width.

    Cells are texts or numbers; a column that holds only numbers is aligned to the right. Numbers
    are written with up to five significant digits; give a text for another format.

    Examples
    --------
    >>> from workbench.study import markdown_table
    >>> print(markdown_table(["drive", "gain"], [["A", 0.5], ["B", 12.0]]), end="")
    | drive | gain |
    | ----- | ---: |
    | A     |  0.5 |
    | B     |   12 |
    """
    cells = [[_text(cell) for cell in row] for row in rows]
    columns = list(zip(heads, *cells, strict=True))
    right = [bool(cells) and all(map(_is_number, column[1:])) for column in columns]
    width = [max(3, *map(len, column)) for column in columns]

    def line(row: Sequence[str]) -> str:
        padded = (
            cell.rjust(size) if is_number else cell.ljust(size)
            for cell, size, is_number in zip(row, width, right, strict=True)
        )
        return f"| {' | '.join(padded)} |\n"

    rule = ["-" * (size - 1) + (":" if r else "-") for size, r in zip(width, right, strict=True)]
    return "".join(line(row) for row in [heads, rule, *cells])


def crossed(values: DataArray, form: str = "{}", corner: str = "") -> Rows:
    """Heads and rows of a two-dimensional array: one row for each label of its first dimension.

    The second dimension gives the columns. corner: the first head; by default the name of the first
    dimension.
    """
    rows, columns = (values[name].values.tolist() for name in values.dims)
    cells = zip(rows, values.values.tolist(), strict=True)
    heads = [corner or str(values.dims[0]), *map(str, columns)]
    return heads, [[str(label), *map(form.format, row)] for label, row in cells]


def _text(cell: Any) -> str:
    if isinstance(cell, str):
        return cell
    if isinstance(cell, bool | np.bool_):
        return "yes" if cell else "no"
    if isinstance(cell, int | np.integer):
        return str(cell)
    number = float(cell)
    return "-" if np.isnan(number) else f"{number:.5g}"


def _is_number(text: str) -> bool:
    """Whether a cell is empty or reads as a number, perhaps with a per cent sign."""
    try:
        float(text.rstrip("%").replace("-", "0") if text in ("-", "") else text.rstrip("%"))
    except ValueError:
        return not text
    return True
