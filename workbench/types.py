"""Types of arrays, systems, datasets and figures, for annotations; no heavy library is imported.

`RealArray` and `ComplexArray` are NumPy arrays of doubles and of complex doubles; an `Array` may
have entries of any type. `StateSpace` and `TransferFunction` are python-control's, `DataArray` and
`Dataset` are xarray's, and `Axes` and `Figure` are Matplotlib's.
"""

from typing import TYPE_CHECKING

from workbench._core.arrays import Array, ComplexArray, RealArray
from workbench._core.heavy_types import (
    Axes,
    DataArray,
    Dataset,
    Figure,
    StateSpace,
    TransferFunction,
)
from workbench._core.on_demand import no_more_names

if not TYPE_CHECKING:
    __getattr__ = no_more_names(__name__)

__all__ = [
    "Array",
    "Axes",
    "ComplexArray",
    "DataArray",
    "Dataset",
    "Figure",
    "RealArray",
    "StateSpace",
    "TransferFunction",
]
