"""Data files, types of parameters and frequencies that several problems of the drives share."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from workbench.errors import InputError
from workbench.types import DataArray, RealArray

Frequencies = Annotated[int, Field(ge=2, le=1_000_000)]
Frequency = Annotated[float, Field(gt=0, allow_inf_nan=False)]

TABLES = ("data/drives.csv", "data/corrections.csv", "data/nominal.csv")
"""Tables A.1-A.3 and 5.2, in the plant's folder."""

WINDOWS = {
    "focus": {"first resonance": (25.0, 37.0), "parasitic resonance": (450.0, 590.0)},
    "radial": {"first resonance": (42.0, 58.0), "parasitic resonance": (800.0, 1020.0)},
}
"""Frequency ranges [Hz] around both resonances of all drives, shown enlarged."""


def grid(frequencies: int, lowest: float, highest: float) -> RealArray:
    """This many frequencies [Hz], logarithmically spaced from lowest to highest [Hz]."""
    if not lowest < highest:
        raise InputError(f"lowest={lowest} Hz must be below highest={highest} Hz")
    return np.geomspace(lowest, highest, frequencies)


def spread(values: DataArray) -> DataArray:
    """Half the range of the values over the drives, relative to the middle of the range."""
    low, high = values.min("drive"), values.max("drive")
    return (high - low) / (high + low)
