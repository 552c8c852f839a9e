"""Nyquist points of the twelve drives, which circles and stadiums contain."""

from __future__ import annotations

from workbench.types import DataArray

from ..drive.plants import Gain, responses
from ..drive.shared_parameters import grid
from ..drive.tables import Axis, Values, drives


def nyquist_points(
    axis: Axis, frequencies: int, lowest: float, highest: float, gain: Gain, values: Values
) -> DataArray:
    """Responses of the twelve drives, dims (frequency, drive) [units/V]."""
    import xarray as xr

    frequency = grid(frequencies, lowest, highest)
    return xr.DataArray(
        responses(axis, frequency, gain, values).T,
        dims=("frequency", "drive"),
        coords={
            "frequency": ("frequency", frequency, {"units": "Hz", "long_name": "frequency"}),
            "drive": [drive.name for drive in drives(axis, values)],
        },
        attrs={"units": "units/V", "long_name": f"{axis} response"},
    )
