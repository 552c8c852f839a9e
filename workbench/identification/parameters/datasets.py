"""Labelled datasets of fits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.identification.parameters.measured import MeasuredRecord, MeasuredResponse

if TYPE_CHECKING:
    import xarray as xr

    from workbench.identification.parameters.program import ParameterFit


def fit_dataset(program: ParameterFit, values: np.ndarray) -> xr.Dataset:
    """Parameters with bounds and covariance, and each datum beside its model."""
    import xarray as xr

    names = list(program.names)
    named = dict(zip(names, map(float, values), strict=True))
    one: dict[str, Any] = {"units": "1"}  # the parameters have different units
    variables: dict[str, Any] = {
        "value": ("parameter", values, one | {"long_name": "estimate"}),
        "lower": ("parameter", program.lower, one | {"long_name": "lower bound"}),
        "upper": ("parameter", program.upper, one | {"long_name": "upper bound"}),
        "half_width": (
            "parameter",
            program.intervals(values),
            one | {"long_name": "half-width of the 99 % interval"},
        ),
        "covariance": (
            ("parameter", "other_parameter"),
            program.covariance(values),
            one | {"long_name": "covariance"},
        ),
    }
    for datum in program.data:
        label = "_".join(datum.name.split())
        if isinstance(datum, MeasuredResponse):
            data, axis = datum.response, f"{label}_frequency"
            dims: tuple[str, ...] = (axis, f"{label}_output", f"{label}_input")[: data.ndim]
            unit = {"units": "Hz", "long_name": "frequency"}
            variables[axis] = (axis, datum.frequency, unit)
        elif isinstance(datum, MeasuredRecord):
            data, dims = datum.y, (f"{label}_output", f"{label}_sample")
        else:  # data of a caller's own kind
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
