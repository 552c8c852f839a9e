"""The first sheet of an Excel workbook, read as the text that its cells show."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from workbench.errors import InputError
from workbench.identification.files.columns import Columns
from workbench.identification.files.text_table import columns_of_text


def read_xlsx(path: Path) -> Columns:
    """Columns of the first sheet of a workbook; messages name its rows as lines.

    Raises
    ------
    InputError
        openpyxl is not installed; the file is not a workbook, or its first sheet not a table.
    """
    import pandas

    try:
        with pandas.ExcelFile(path, engine="openpyxl") as book:
            names = [str(name) for name in book.sheet_names]
            sheet = pandas.read_excel(book, header=None, dtype=object, na_filter=False)
    except ImportError:
        raise InputError(
            f'{path} needs openpyxl: pip install "robust-workbench[excel]", or save it as .csv'
        ) from None
    except Exception as error:  # openpyxl raises many kinds of errors for a broken file
        raise InputError(f"{path} cannot be read as an Excel workbook: {error}") from None
    text = "\n".join("\t".join(map(_cell_text, row)) for row in sheet.itertuples(index=False))
    found = columns_of_text(path, text)
    others = f", the first of {len(names)}" if len(names) > 1 else ""
    return replace(found, said=f"sheet {names[0]!r}{others}; {found.said}")


def _cell_text(cell: Any) -> str:
    """A cell as text: numbers with all digits, dates in ISO 8601."""
    shown = cell.isoformat() if hasattr(cell, "isoformat") else str(cell)
    return " ".join(shown.split())
