"""Reading of numeric variables from CSV, MAT and NetCDF files."""

from __future__ import annotations

import re
from collections.abc import Callable
from os import PathLike
from pathlib import Path

import numpy as np

from workbench.errors import InputError

File = str | PathLike[str]


def read_variables(file: File) -> dict[str, np.ndarray]:
    """Every numeric variable of a file, by name.

    A file named ``.mat`` has MATLAB's format up to version 7, one named ``.nc`` is NetCDF; all
    others are text with columns separated by commas, semicolons, tabs or spaces. The first line of
    a text may name the columns; otherwise they are called "1", "2" and so on. Lines that start with
    # or % are comments.

    Raises
    ------
    InputError
        The file is missing, or does not have the format that its name says.
    """
    path = Path(file)
    reader = _READERS.get(path.suffix.lower(), _read_text)
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    return reader(path)


def _read_text(path: Path) -> dict[str, np.ndarray]:
    """Columns of a text file, by name."""
    names: list[str] | None = None
    rows: list[list[float]] = []
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise InputError(f"{path} is no text; .mat and .nc files must be named so") from None
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        if not text or text[0] in "#%":
            continue
        cells = [cell.strip().strip('"') for cell in re.split(_splitter(text), text)]
        try:
            row = [float(cell) for cell in cells]
        except ValueError:
            if rows or names:
                wrong = next(cell for cell in cells if not _is_number(cell))
                raise InputError(f"{path}, line {number}: {wrong!r} is not a number") from None
            names = cells
            continue
        width = len(names) if names else len(rows[0]) if rows else len(row)
        if len(row) != width:
            raise InputError(f"{path}, line {number}: {len(row)} columns, {width} are needed")
        if not np.all(np.isfinite(row)):
            raise InputError(f"{path}, line {number}: {text!r} is not finite everywhere")
        rows.append(row)
    if not rows:
        raise InputError(f"{path} holds no numbers")
    names = names or [str(i + 1) for i in range(len(rows[0]))]
    if len(set(names)) < len(names):
        raise InputError(f"{path}: two columns have one name: {', '.join(names)}")
    return dict(zip(names, np.array(rows).T, strict=True))


def _splitter(text: str) -> str:
    """Regular expression of the separator between the cells of a line."""
    return next((mark for mark in ";,\t" if mark in text), r"\s+")


def _is_number(cell: str) -> bool:
    """Whether a cell can be read as a number."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _read_mat(path: Path) -> dict[str, np.ndarray]:
    """Numeric variables of a MAT file, by name."""
    from scipy.io import loadmat

    try:
        stored = loadmat(path, squeeze_me=True)
    except NotImplementedError:
        raise InputError(f"{path} is of MATLAB's version 7.3: save it with -v7") from None
    except Exception as error:  # SciPy raises many kinds of errors for a broken file
        raise InputError(f"{path} cannot be read as a MAT file: {error}") from None
    found = {name: np.atleast_1d(v) for name, v in stored.items() if not name.startswith("__")}
    return {name: v for name, v in found.items() if v.dtype.kind in "biufc"}


def _read_netcdf(path: Path) -> dict[str, np.ndarray]:
    """Numeric variables of a NetCDF file, by name."""
    import xarray as xr

    try:
        with xr.open_dataset(path, decode_times=False) as stored:
            found = {str(name): np.atleast_1d(v.values) for name, v in stored.variables.items()}
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        raise InputError(f"{path} cannot be read as NetCDF: {error}") from None
    return {name: v for name, v in found.items() if v.dtype.kind in "biufc"}


_READERS: dict[str, Callable[[Path], dict[str, np.ndarray]]] = {
    ".mat": _read_mat,
    ".nc": _read_netcdf,
}
"""Reader for each ending of a file's name."""
