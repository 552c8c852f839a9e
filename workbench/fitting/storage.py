"""Rational functions as labelled arrays, and back."""

from __future__ import annotations

from typing import Any

from workbench._core.heavy_types import Dataset
from workbench.fitting.rational import Rational


def rational_variables(function: Rational, of: str, *, prefix: str = "") -> dict[str, Any]:
    """Dataset variables ``zeros``, ``poles`` and ``gain`` of a function, each with a prefix.

    ``of`` names the function in the long names. `restored_rational` reads them back.

    Examples
    --------
    >>> import xarray as xr
    >>> from workbench.fitting import Rational, rational_variables
    >>> data = xr.Dataset(rational_variables(Rational([], [-1.0], 2.0), "the weight", prefix="W_"))
    >>> sorted(data), data["W_gain"].attrs["long_name"]
    (['W_gain', 'W_poles', 'W_zeros'], 'gain of the weight over the products of s - root')
    """
    variables: dict[str, Any] = {
        f"{prefix}{name}": (
            f"{prefix}{name[:-1]}",
            getattr(function, name),
            {"units": "rad/s", "long_name": f"{name} of {of}"},
        )
        for name in ("zeros", "poles")
    }
    about = {"units": "1", "long_name": f"gain of {of} over the products of s - root"}
    return variables | {f"{prefix}gain": ((), function.gain, about)}


def restored_rational(data: Dataset, *, prefix: str = "") -> Rational:
    """The function that a dataset holds in variables with that prefix.

    Examples
    --------
    >>> import xarray as xr
    >>> from workbench.fitting import Rational, rational_variables, restored_rational
    >>> data = xr.Dataset(rational_variables(Rational([], [-1.0], 2.0), "the weight", prefix="W_"))
    >>> restored_rational(data, prefix="W_").gain
    2.0
    """
    zeros, poles = (data[f"{prefix}{name}"].values for name in ("zeros", "poles"))
    return Rational(zeros, poles, float(data[f"{prefix}gain"]))
