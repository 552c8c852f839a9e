"""Types from libraries that are slow to import, for annotations only; none is imported."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from control import FrequencyResponseData, StateSpace, TransferFunction
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from xarray import DataArray, Dataset
else:
    FrequencyResponseData = StateSpace = TransferFunction = Any
    Axes = Figure = Any
    DataArray = Dataset = Any

__all__ = [
    "Axes",
    "DataArray",
    "Dataset",
    "Figure",
    "FrequencyResponseData",
    "StateSpace",
    "TransferFunction",
]
