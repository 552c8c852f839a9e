"""Variables of NetCDF files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from workbench.errors import InputError
from workbench.identification.files.arrays import columns_of_arrays
from workbench.identification.files.columns import Columns
from workbench.identification.files.units import plain_unit


def read_netcdf(path: Path) -> Columns:
    """Variables of a NetCDF file by name, with their units; raises InputError for another file."""
    import xarray as xr

    try:
        with xr.open_dataset(path, decode_times=False) as stored:
            found = {str(name): np.atleast_1d(v.values) for name, v in stored.variables.items()}
            units = {
                str(name): plain_unit(str(v.attrs.get("units", "")))
                for name, v in stored.variables.items()
            }
    except Exception as error:  # its engines raise many kinds of errors for a broken file
        raise InputError(f"{path} cannot be read as NetCDF: {error}") from None
    return columns_of_arrays(path, found, units, {}, "variables of a NetCDF file")
