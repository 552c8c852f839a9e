"""Labelled arrays to NetCDF and back.

NetCDF has no complex numbers that every reader knows, so a complex array is stored as two real
variables, ``name_real`` and ``name_imag``, and joined again on reading.
"""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path

import numpy as np
import xarray as xr

from workbench.errors import ResultError
from workbench.executor import WALL_TIME

MARK = "complex_of"


def write(data: xr.Dataset, file: Path) -> None:
    """Write a dataset, compressed."""
    split = _split(data)
    packing = {
        name: {"zlib": True, "complevel": 4} for name, array in split.items() if array.ndim > 0
    }
    split.to_netcdf(file, engine="h5netcdf", encoding=packing)


def read(file: Path) -> xr.Dataset:
    """Read a dataset into memory.

    Raises
    ------
    ResultError
        The file is missing, truncated or no NetCDF.
    """
    try:
        with xr.open_dataset(file, engine="h5netcdf") as stored:
            return _join(stored.load())
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        raise ResultError(f"{file.name} cannot be read: {error}") from None


def _split(data: xr.Dataset) -> xr.Dataset:
    parts: dict[Hashable, xr.DataArray] = {}
    for name, array in data.data_vars.items():
        if np.iscomplexobj(array):
            for suffix, part in (("real", array.real), ("imag", array.imag)):
                parts[f"{name}_{suffix}"] = part.assign_attrs(array.attrs | {MARK: str(name)})
        else:
            parts[name] = array
    return xr.Dataset(parts, coords=data.coords, attrs=data.attrs)


def _join(data: xr.Dataset) -> xr.Dataset:
    joined: dict[Hashable, xr.DataArray] = {}
    for name, array in data.data_vars.items():
        whole = array.attrs.get(MARK)
        if whole is None:
            joined[name] = array
        elif str(name).endswith("_real"):
            # 1j * inf would make a NaN of the real part
            values = np.empty(array.shape, dtype=complex)
            values.real, values.imag = array.values, data[f"{whole}_imag"].values
            attrs = {key: value for key, value in array.attrs.items() if key != MARK}
            joined[whole] = xr.DataArray(values, dims=array.dims, attrs=attrs)
    return xr.Dataset(joined, coords=data.coords, attrs=data.attrs)


def differences(old: xr.Dataset, new: xr.Dataset, tolerance: float) -> list[str]:
    """Where datasets differ by more than a tolerance, relative to each array's largest entry."""
    found = [f"{name} is missing" for name in new.variables if name not in old.variables]
    found += [f"{name} is unexpected" for name in old.variables if name not in new.variables]
    for name in new.variables:
        if name not in old.variables or WALL_TIME.items() <= new[name].attrs.items():
            continue
        a, b = old[name].values, new[name].values
        if a.shape != b.shape:
            found.append(f"{name} has shape {a.shape}, not {b.shape}")
        elif not np.issubdtype(b.dtype, np.number):
            if not np.array_equal(a, b):
                found.append(f"{name} differs in {int(np.sum(a != b))} of {a.size} entries")
        else:
            off = _distance(a, b)
            if not off <= tolerance:
                found.append(f"{name} differs by {off:.3g} of its largest entry")
    return found


def _distance(a: np.ndarray, b: np.ndarray) -> float:
    if a.size == 0 or np.array_equal(a, b, equal_nan=True):
        return 0.0
    if not np.array_equal(np.isfinite(a), np.isfinite(b)):
        return np.inf
    finite = np.isfinite(b)
    scale = np.abs(b[finite]).max(initial=0.0) or 1.0
    return float((np.abs(a[finite] / scale - b[finite] / scale)).max(initial=0.0))
