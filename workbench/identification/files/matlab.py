"""Variables of MATLAB files up to version 7.3; fields of structs are named by their path."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from workbench.errors import InputError
from workbench.identification.files.arrays import columns_of_arrays
from workbench.identification.files.columns import Columns

OPAQUE = (
    "is an object of MATLAB, such as a timetable, a table or a timeseries, whose contents cannot "
    "be read: save plain arrays, such as t = seconds(log.Time - log.Time(1)); u = log.u; "
    "save('record.mat', 't', 'u')"
)
DEEPEST = 12
"""Largest nesting of structs that is followed."""


def read_mat(path: Path) -> Columns:
    """Numeric variables of a MAT file, by name; raises InputError for another file."""
    found: dict[str, np.ndarray] = {}
    refused: dict[str, str] = {}
    for name, value in mat_arrays(path).items():
        if value is None:
            refused[name] = OPAQUE
        else:
            found[name] = np.atleast_1d(np.squeeze(value))
    said = "variables of a MAT file"
    if refused:
        said += f"; without objects of MATLAB, whose contents cannot be read: {', '.join(refused)}"
    return columns_of_arrays(path, found, {}, refused, said)


def mat_arrays(path: Path) -> dict[str, np.ndarray | None]:
    """A field of a struct is named by its path, such as ``log.y``.

    In an array of structs ``log[0].y``, counted from 0.

    A field of a struct is named by its path, such as ``log.y``, one of an array of structs
    ``log[0].y``, from 0.

    Raises
    ------
    InputError
        The file is missing or is not a MAT file.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadWarning

    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    found: dict[str, np.ndarray | None] = {}
    try:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", MatReadWarning)  # of several objects "None"
                stored = loadmat(path, struct_as_record=False)
        except NotImplementedError:  # version 7.3 is stored as HDF5
            return dict(_of_hdf5(path))
        for name, value in stored.items():
            if not name.startswith("__"):
                found |= dict(_of_level_5(name, value, 0))
    except Exception as error:  # SciPy and h5py raise many kinds of errors for a broken file
        raise InputError(f"{path} cannot be read as a MAT file: {error}") from None
    return found


def _of_level_5(name: str, value: Any, depth: int) -> Iterator[tuple[str, np.ndarray | None]]:
    """The arrays of a variable as SciPy reads it."""
    from scipy.io.matlab import MatlabFunction, MatlabOpaque
    from scipy.sparse import issparse

    if issparse(value):
        yield name, value.toarray()
    elif isinstance(value, MatlabOpaque):  # SciPy calls each "None"; the real name is inside
        own = value["s0"].ravel()[0]
        yield own.decode(errors="replace") if isinstance(own, bytes) else name, None
    elif isinstance(value, MatlabFunction) or depth > DEEPEST:
        yield name, None
    elif hasattr(value, "_fieldnames"):
        for field in value._fieldnames:
            yield from _of_level_5(f"{name}.{field}", getattr(value, field), depth + 1)
    elif isinstance(value, np.ndarray) and value.dtype == object:
        several = value.size > 1
        for place, each in enumerate(value.ravel(order="F")):
            yield from _of_level_5(f"{name}[{place}]" if several else name, each, depth + 1)
    elif isinstance(value, np.ndarray):
        yield name, value


def _of_hdf5(path: Path) -> Iterator[tuple[str, np.ndarray | None]]:
    """The arrays of a file of version 7.3."""
    import h5py

    with h5py.File(path, "r") as stored:
        for name, item in stored.items():
            if not name.startswith("#"):  # the group that references point to
                yield from _of_item(stored, name, item, 0)


def _of_item(
    stored: Any, name: str, item: Any, depth: int
) -> Iterator[tuple[str, np.ndarray | None]]:
    """The arrays of an HDF5 group or dataset; MATLAB stores their axes in reverse order."""
    import h5py

    if "MATLAB_object_decode" in item.attrs or depth > DEEPEST:
        yield name, None
    elif isinstance(item, h5py.Group):
        if "MATLAB_sparse" in item.attrs:
            yield name, _filled(item)
            return
        for field, each in item.items():
            yield from _of_item(stored, f"{name}.{field}", each, depth + 1)
    elif item.dtype == h5py.ref_dtype:
        references = item[()].T.ravel(order="F")
        outer, _, field = name.rpartition(".")
        for place, reference in enumerate(references):
            each = f"{outer}[{place}].{field}" if outer else f"{name}[{place}]"
            own = each if len(references) > 1 else name
            yield from _of_item(stored, own, stored[reference], depth + 1)
    elif item.attrs.get("MATLAB_empty"):
        yield name, np.zeros((0, 0))
    else:
        yield name, _values(item)


def _values(item: Any) -> np.ndarray:
    """A dataset of numbers or letters, with complex numbers assembled."""
    values = np.asarray(item[()]).T
    if values.dtype.names == ("real", "imag"):
        return np.asarray(values["real"] + 1j * values["imag"])
    if item.attrs.get("MATLAB_class") == b"char":
        return np.asarray(values.astype("U"))
    return values


def _filled(group: Any) -> np.ndarray:
    """A sparse matrix as a full array."""
    from scipy.sparse import csc_matrix

    columns = np.asarray(group["jc"])
    if "data" not in group:
        return np.zeros((int(group.attrs["MATLAB_sparse"]), columns.size - 1))
    parts = np.asarray(group["data"]), np.asarray(group["ir"]), columns
    shape = int(group.attrs["MATLAB_sparse"]), columns.size - 1
    return np.asarray(csc_matrix(parts, shape).toarray())
