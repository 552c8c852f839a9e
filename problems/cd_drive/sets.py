"""First sets of chapter 5: circles and stadiums around the responses of the twelve drives."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field

from workbench import problem
from workbench.errors import InputError
from workbench.geometry import NarrowestStadium, SmallestCircle

from .actuator import Real
from .drives import responses
from .tables import Axis, Values, drives

if TYPE_CHECKING:
    import xarray as xr

Gain = Literal["own", "equal", "agc"]
Frequencies = Annotated[int, Field(ge=2, le=1_000_000)]
Frequency = Annotated[float, Field(gt=0, allow_inf_nan=False)]

TABLES = ("data/drives.csv", "data/corrections.csv", "data/nominal.csv")

WINDOWS = {
    "focus": {"first resonance": (25.0, 37.0), "parasitic resonance": (450.0, 590.0)},
    "radial": {"first resonance": (42.0, 58.0), "parasitic resonance": (800.0, 1020.0)},
}
"""Frequency ranges [Hz] around both resonances of all drives, shown enlarged."""


@problem("cd/{axis}/circles", axis=("focus", "radial"), data=TABLES)
def circles(
    axis: Axis,
    frequencies: Frequencies = 400,
    lowest: Frequency = 5.0,
    highest: Frequency = 5000.0,
    gain: Gain = "own",
    values: Values = "printed",
) -> SmallestCircle:
    """Smallest circles around the Nyquist points of twelve drives (section 5.3.1, figure 5.6).

    At each frequency the twelve responses from control voltage to normalised error are a set of
    points; the smallest circle around them is the first set of the complex uncertainty model.

    frequencies: how many, logarithmically spaced from lowest to highest [Hz].
    gain: "own" optical gain of each drive, "equal" for all, or equalised at crossover as the
    automatic gain control does ("agc"). values: tables "printed" or "corrected".
    """
    points = nyquist_points(axis, frequencies, lowest, highest, gain, values)
    return SmallestCircle(points, windows=WINDOWS[axis])


@problem("cd/{axis}/stadiums", axis=("focus", "radial"), data=TABLES)
def stadiums(
    axis: Axis,
    frequencies: Frequencies = 400,
    lowest: Frequency = 5.0,
    highest: Frequency = 5000.0,
    gain: Gain = "own",
    values: Values = "printed",
    angle: float | None = None,
) -> NarrowestStadium:
    """Narrowest stadiums around the Nyquist points of twelve drives (section 5.4.1, figure 5.8).

    At each frequency the twelve responses from control voltage to normalised error are a set of
    points; the narrowest stadium around them is the first set of the mixed uncertainty model.

    frequencies, gain, values: as in cd/<axis>/circles. angle [rad]: one direction for all
    stadiums, which makes the problem convex; free by default.
    """
    points = nyquist_points(axis, frequencies, lowest, highest, gain, values)
    given = None if angle is None else np.asarray(angle)
    return NarrowestStadium(points, None, given, windows=WINDOWS[axis])


def nyquist_points(
    axis: Axis, frequencies: int, lowest: float, highest: float, gain: Gain, values: Values
) -> xr.DataArray:
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


def grid(frequencies: int, lowest: float, highest: float) -> Real:
    """So many frequencies [Hz], logarithmically spaced from lowest to highest."""
    if not lowest < highest:
        raise InputError(f"lowest={lowest} Hz must lie below highest={highest} Hz")
    return np.geomspace(lowest, highest, frequencies)
