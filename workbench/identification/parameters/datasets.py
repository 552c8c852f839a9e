"""Labelled datasets of parameter fits."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.heavy_types import Dataset
from workbench.identification.parameters.least_squares import LeastSquares
from workbench.identification.parameters.measured import MeasuredRecord, MeasuredResponse


def fit_dataset(problem: LeastSquares, values: np.ndarray) -> Dataset:
    """Dataset of the parameters with bounds and covariance, and of all data with their models."""
    import xarray as xr

    names = list(problem.names)
    named = dict(zip(names, map(float, values), strict=True))
    one: dict[str, Any] = {"units": "1"}  # the parameters have different units
    variables: dict[str, Any] = {
        "value": ("parameter", values, one | {"long_name": "estimate"}),
        "lower": ("parameter", problem.lower, one | {"long_name": "lower bound"}),
        "upper": ("parameter", problem.upper, one | {"long_name": "upper bound"}),
        "half_width": (
            "parameter",
            problem.intervals(values),
            one | {"long_name": "half-width of the 99 % interval"},
        ),
        "covariance": (
            ("parameter", "other_parameter"),
            problem.covariance(values),
            one | {"long_name": "covariance"},
        ),
    }
    for datum in problem.data:
        label = "_".join(datum.name.split())
        if isinstance(datum, MeasuredResponse):
            data, axis = datum.response, f"{label}_frequency"
            dims: tuple[str, ...] = (axis, f"{label}_output", f"{label}_input")[: data.ndim]
            unit = {"units": "Hz", "long_name": "frequency"}
            variables[axis] = (axis, datum.frequency_hz, unit)
        elif isinstance(datum, MeasuredRecord):
            data, dims = datum.y, (f"{label}_output", f"{label}_sample")
        else:  # a kind of data that the caller defines
            continue
        model = datum.predicted(named)
        for kind, array in (("measured", data), ("model", model)):
            variables[f"{label}_{kind}"] = (
                dims,
                array,
                one | {"long_name": f"{datum.name}, {kind}"},
            )
    coords = {"parameter": names, "other_parameter": names}
    return xr.Dataset(variables, coords=coords)
