"""Reading of numeric variables from CSV, MAT and NetCDF files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path

import numpy as np

from workbench.errors import InputError
from workbench.identification.experiments.text_table import Columns, read_columns

File = str | PathLike[str]


def read_variables(file: File) -> dict[str, np.ndarray]:
    r"""Every numeric variable of a file, by name.

    A file named ``.mat`` has MATLAB's format up to version 7, one named ``.nc`` is NetCDF; all
    others are text with columns separated by commas, semicolons, tabs or blanks, with decimal
    points or commas. The last line above the numbers may name the columns, a row of units may stand
    below it and anything above; otherwise they are called "1", "2" and so on. Blank cells are NaN.
    Columns of words, such as dates, are left out. Lines that start with # or % are comments.

    Raises
    ------
    InputError
        The file is missing, or does not have the format that its name says.

    Examples
    --------
    >>> from pathlib import Path
    >>> from workbench.identification import read_variables
    >>> _ = Path("log.csv").write_text("time,u,y\n0.0,1.0,0.0\n0.1,1.0,0.5\n")
    >>> {name: column.tolist() for name, column in read_variables("log.csv").items()}
    {'time': [0.0, 0.1], 'u': [1.0, 1.0], 'y': [0.0, 0.5]}
    """
    return read_table(file).variables


def read_table(file: File) -> Columns:
    """The variables of a file, and what was found out to read them; see `read_variables`."""
    path = need_path(file)
    reader = _READERS.get(path.suffix.lower(), read_columns)
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    return reader(path)


def need_path(file: File) -> Path:
    """The path of a file; raises InputError for what is no path."""
    if not isinstance(file, str | PathLike):
        raise InputError(f"the path of a file is needed, not {file!r}")
    return Path(file)


def _read_mat(path: Path) -> Columns:
    """Numeric variables of a MAT file, by name."""
    from scipy.io import loadmat

    try:
        stored = loadmat(path, squeeze_me=True)
    except NotImplementedError:
        raise InputError(f"{path} is of MATLAB's version 7.3: save it with -v7") from None
    except Exception as error:  # SciPy raises many kinds of errors for a broken file
        raise InputError(f"{path} cannot be read as a MAT file: {error}") from None
    found = {name: np.atleast_1d(v) for name, v in stored.items() if not name.startswith("__")}
    return _numbers(found, {}, "variables of a MAT file")


def _read_netcdf(path: Path) -> Columns:
    """Numeric variables of a NetCDF file, by name."""
    import xarray as xr

    try:
        with xr.open_dataset(path, decode_times=False) as stored:
            found = {str(name): np.atleast_1d(v.values) for name, v in stored.variables.items()}
            units = {str(name): str(v.attrs.get("units", "")) for name, v in stored.items()}
            units |= {str(name): str(v.attrs.get("units", "")) for name, v in stored.coords.items()}
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        raise InputError(f"{path} cannot be read as NetCDF: {error}") from None
    return _numbers(found, units, "variables of a NetCDF file")


def _numbers(found: Mapping[str, np.ndarray], units: Mapping[str, str], said: str) -> Columns:
    """Variables that are numbers; columns of the only matrix are named by number too."""
    numbers = {name: v for name, v in found.items() if v.dtype.kind in "biufc"}
    texts = {name: f"it holds {v.dtype}" for name, v in found.items() if name not in numbers}
    if len(numbers) == 1:
        (name, matrix) = next(iter(numbers.items()))
        if matrix.ndim == 2:
            columns = matrix.T if len(matrix) >= matrix.shape[1] else matrix
            numbers |= {str(j + 1): column for j, column in enumerate(columns)}
            said += f", columns of {name} by number"
    known = {name: unit for name, unit in units.items() if unit and name in numbers}
    return Columns(numbers, known, texts, said)


_READERS: dict[str, Callable[[Path], Columns]] = {
    ".mat": _read_mat,
    ".nc": _read_netcdf,
}
"""Reader for each ending of a file's name."""
