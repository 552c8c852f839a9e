"""Reading of numeric variables from files; the format follows from the ending of the name."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path

import numpy as np

from workbench.errors import InputError
from workbench.identification.files.columns import Columns
from workbench.identification.files.excel import read_xlsx
from workbench.identification.files.matlab import read_mat
from workbench.identification.files.netcdf import read_netcdf
from workbench.identification.files.text_table import read_columns
from workbench.identification.files.touchstone import TOUCHSTONE, read_touchstone

File = str | PathLike[str]


def read_variables(file: File) -> dict[str, np.ndarray]:
    r"""Every numeric variable of a file, by name.

    A file named ``.mat`` is MATLAB's, up to version 7.3, one named ``.nc`` NetCDF, ``.xlsx`` an
    Excel workbook (with the extra ``excel``), ``.s1p``, ``.s2p`` and so on Touchstone; all others
    are text with columns separated by commas, semicolons, tabs or blanks, with decimal points or
    commas, in UTF-8, UTF-16 or as Windows writes it. The last line above the numbers may name the
    columns, a row of units may stand below it and anything above; otherwise they are called "1",
    "2" and so on. Columns that share a name are ``"y[0]"``, ``"y[1]"``; fields of structs are
    ``"log.y"``. Blank cells and ``#N/A`` are NaN, TRUE and FALSE are 1 and 0. Columns of words,
    such as dates, are left out. Lines that start with # or % are comments.

    Raises
    ------
    InputError
        The file is missing, does not have the format of its ending, or has a word in a column of
        numbers.

    Examples
    --------
    >>> from pathlib import Path
    >>> from workbench.identification import read_variables
    >>> _ = Path("log.csv").write_text("time,u,y\n0.0,1.0,0.0\n0.1,1.0,0.5\n")
    >>> {name: column.tolist() for name, column in read_variables("log.csv").items()}
    {'time': [0.0, 0.1], 'u': [1.0, 1.0], 'y': [0.0, 0.5]}
    """
    table = read_table(file)
    for name in list(table.texts):
        if table.is_mostly_numbers(name):
            table.numbers(name)
    return {name: table.variables[name] for name in table.names if name in table.variables}


def read_table(file: File) -> Columns:
    """The variables of a file, and how it was interpreted; see `read_variables`."""
    path = need_path(file)
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    ending = path.suffix.lower()
    if TOUCHSTONE.fullmatch(ending):
        return read_touchstone(path)
    return _READERS.get(ending, read_columns)(path)


def need_path(file: File) -> Path:
    """The path of a file; raises InputError for anything else."""
    if not isinstance(file, str | PathLike):
        raise InputError(f"the path of a file is needed, not {file!r}")
    return Path(file)


_READERS: dict[str, Callable[[Path], Columns]] = {
    ".mat": read_mat,
    ".nc": read_netcdf,
    ".xlsx": read_xlsx,
    ".xlsm": read_xlsx,
}
"""Reader for each ending of a file's name."""
