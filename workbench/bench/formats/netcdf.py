"""Writing labelled arrays to NetCDF files, and reading them.

NetCDF has no complex numbers that every reader knows, so a complex array is stored as two real
variables, ``name_real`` and ``name_imag``, and joined again on reading.
"""

from __future__ import annotations

import io
from collections.abc import Hashable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from workbench.bench.trust.untrusted import need_bounded_arrays
from workbench.errors import ResultError
from workbench.executor import WALL_TIME

WHOLE, PART = "complex_of", "complex_part"
WORTH_PACKING = 512
"""Size [bytes] from which compressing an array saves more than its index costs."""


def write(data: xr.Dataset, file: Path) -> None:
    """Write a dataset to a file, with lossless compression.

    The file format is that of HDF5 1.10: its headers take a third of the space of version 1.8, and
    headers are half of a file with many small arrays.
    """
    import h5netcdf
    from xarray.backends import H5NetCDFStore

    split = _with_fixed_length_words(_split(data))
    encoding = {name: _packing(array) for name, array in split.variables.items()}
    # The file is built in memory: on a full disk HDF5 leaves files open and prints its own
    # messages.
    content = io.BytesIO()
    with closing(H5NetCDFStore(h5netcdf.File(content, "w", libver="v110"))) as store:
        split.dump_to_store(store, encoding=encoding)
    file.write_bytes(content.getbuffer())


def read(file: Path) -> xr.Dataset:
    """Read a dataset into memory, with every number exactly as it was written.

    Raises
    ------
    ResultError
        The file is missing, a link, truncated or not NetCDF; or it would unpack to far more than
        its size.
    """
    need_bounded_arrays(file)
    try:
        with xr.open_dataset(
            file, engine="h5netcdf", mask_and_scale=False, decode_times=False
        ) as stored:
            return _join(stored.load())
    except Exception as error:  # a malicious file can break any part of its readers
        reason = f"{type(error).__name__}: {error}"
        raise ResultError(f"{file.name} cannot be read: {reason}") from None


def _split(data: xr.Dataset) -> xr.Dataset:
    parts: dict[Hashable, Any] = {}
    coordinates: list[Hashable] = []
    for name, array in data.variables.items():
        # Texts of variable length would be stored one by one, uncompressed.
        halves: dict[Hashable, Any] = {name: array.astype(str) if array.dtype == object else array}
        if np.iscomplexobj(array.values):
            halves = {
                _unused_name(f"{name}_{part}", data): (
                    array.dims,
                    getattr(array.values, part),
                    array.attrs | {WHOLE: str(name), PART: part},
                )
                for part in ("real", "imag")
            }
        parts |= halves
        if name in data.coords:
            coordinates += halves
    return xr.Dataset(parts, attrs=data.attrs).set_coords(coordinates)


def _packing(array: xr.Variable) -> dict[str, Any]:
    """Encoding of an array: numbers and texts compressed as one piece, texts as characters."""
    # a fill value would turn some number into a missing one
    plain: dict[str, Any] = {"_FillValue": None}
    packed = {"zlib": True, "complevel": 9, "shuffle": True}
    if array.nbytes < WORTH_PACKING or array.dtype.kind not in "iufU":
        return plain
    if array.dtype.kind == "U":
        return packed | {"dtype": "S1"}
    # small pieces, the library's choice, compress worse
    return packed | plain | {"chunksizes": array.shape}


def _with_fixed_length_words(data: xr.Dataset) -> xr.Dataset:
    """The dataset with fixed-length character attributes, as NetCDF's own library writes them.

    HDF5 stores variable-length texts separately, which takes a tenth of a file with many small
    arrays.
    """

    def fixed(attrs: dict[Any, Any]) -> dict[Any, Any]:
        return {
            key: np.bytes_(value.encode()) if isinstance(value, str) and _plain(value) else value
            for key, value in attrs.items()
        }

    lean = data.copy()
    lean.attrs = fixed(data.attrs)
    for name, array in data.variables.items():
        lean[name].attrs = fixed(array.attrs)
    return lean


def _plain(text: str) -> bool:
    return bool(text) and text.isascii()


def _unused_name(name: str, data: xr.Dataset) -> str:
    """A name that the dataset does not use yet."""
    while name in data.variables:
        name += "_"
    return name


def _join(data: xr.Dataset) -> xr.Dataset:
    parts = {
        (array.attrs[WHOLE], array.attrs[PART]): array
        for array in data.variables.values()
        if WHOLE in array.attrs
    }
    joined: dict[Hashable, Any] = {}
    coordinates: list[Hashable] = []
    for name, array in data.variables.items():
        whole = array.attrs.get(WHOLE, name)
        if name in data.coords:
            coordinates.append(whole)
        if WHOLE not in array.attrs:
            joined[name] = array.astype(str) if array.dtype.kind == "O" else array
        elif whole not in joined:
            if (whole, "imag") not in parts or (whole, "real") not in parts:
                raise KeyError(f"{whole} has only one of its parts {whole}_real, {whole}_imag")
            # 1j * inf would make the real part NaN
            real, imag = (parts[whole, p].values for p in ("real", "imag"))
            values = np.empty(array.shape, dtype=np.result_type(real, imag, np.complex64))
            values.real, values.imag = real, imag
            attrs = {key: v for key, v in array.attrs.items() if key not in (WHOLE, PART)}
            joined[whole] = (array.dims, values, attrs)
    return xr.Dataset(joined, attrs=data.attrs).set_coords(coordinates)


def differences(old: xr.Dataset, new: xr.Dataset, tolerance: float) -> list[str]:
    """Differences above a tolerance, relative to each array's largest entry, as sentences.

    Single-precision arrays may also differ by their rounding.
    """
    found = [f"{name} is missing" for name in new.variables if name not in old.variables]
    found += [f"{name} is unexpected" for name in old.variables if name not in new.variables]
    for name, array in new.variables.items():
        if name in old.variables and not WALL_TIME.items() <= array.attrs.items():
            found += [f"{name} {text}" for text in _array_difference(old[name], array, tolerance)]
    return found


def _array_difference(old: xr.DataArray, new: xr.Variable, tolerance: float) -> Iterator[str]:
    units = [array.attrs.get("units", "1") for array in (old, new)]
    if units[0] != units[1]:
        yield f"has units {units[0]}, not {units[1]}"
    a, b = old.values, new.values
    numbers = [np.issubdtype(array.dtype, np.number) for array in (a, b)]
    if a.shape != b.shape:
        yield f"has shape {a.shape}, not {b.shape}"
    elif not all(numbers):
        different = np.ones(a.shape, bool) if any(numbers) else np.asarray(a != b)
        if different.any():
            yield f"differs in {different.sum()} of {a.size} entries"
    else:
        off = _distance(a, b)
        if not off <= max(tolerance, *(_precision(array) for array in (a, b))):
            yield f"differs by {off:.3g} of its largest entry"


def _precision(array: np.ndarray) -> float:
    return float(np.finfo(array.dtype).eps) if array.dtype.kind in "fc" else 0.0


def _distance(a: np.ndarray, b: np.ndarray) -> float:
    a, b = (array.astype(np.result_type(array, float)) for array in (a, b))
    finite = np.isfinite(a) & np.isfinite(b)
    if not np.array_equal(a[~finite], b[~finite], equal_nan=True):
        return np.inf
    scale = np.abs(b[finite]).max(initial=0.0) or 1.0
    return float(np.abs(a[finite] / scale - b[finite] / scale).max(initial=0.0))
