"""Responses of the drives against the printed equations of the two models.

Equation and table numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import fields
from itertools import product

import numpy as np

from workbench.types import DataArray

from .actuator import SERIES_RESISTANCE, transfer_coefficients
from .plants import ANTIALIASING
from .tables import ActuatorParameters


def off_table_3_2(response: DataArray, parameters: DataArray) -> DataArray:
    """Largest relative distance of responses from the polynomials of Table 3.2."""
    printed = _from_table_3_2(parameters, response["frequency"])
    shape, wanted = (one / one.isel(frequency=0) for one in (response, printed))
    return abs(shape / wanted - 1).max()


def off_equation_3_10(general: DataArray, parameters: DataArray) -> DataArray:
    """Largest relative distance of the general model from equation 3.10 with R + r in
    place of R.
    """
    s = 2j * np.pi * general["frequency"]
    L, k, b, Bl, m1, m2, R = (
        parameters.sel(parameter=name, drop=True) for name in ("L", "k", "b", "Bl", "m1", "m2", "R")
    )
    m, R = m1 + m2, R + SERIES_RESISTANCE
    electrical = L / R * s * (s**2 + b / m * s + k / m)
    mechanical = s**2 + (Bl**2 / (m * R) + b / m) * s + k / m
    return abs(general / (Bl / (m * R) / (electrical + mechanical)) - 1).max()


def _from_table_3_2(parameters: DataArray, frequency: DataArray) -> DataArray:
    """Responses (axis, drive, frequency) from the polynomials of Table 3.2, without
    optical gain.
    """
    s, result = 2j * np.pi * frequency.values, frequency * parameters.isel(parameter=0) * 0j
    names = [field.name for field in fields(ActuatorParameters)]
    for place in product(parameters["axis"].values, parameters["drive"].values):
        row = parameters.loc[place].sel(parameter=names).values
        num, den = transfer_coefficients(ActuatorParameters(**dict(zip(names, row, strict=True))))
        values = np.polyval(num, s) / np.polyval(den, s) * ANTIALIASING / (s + ANTIALIASING)
        result.loc[:, *place] = values
    return result
