"""What the functions of this room are given, as the arrays and numbers that they work with."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.errors import InputError
from workbench.synthesis.given import is_real, need_whole


def as_array(values: ArrayLike, name: str, *, dtype: type = float) -> NDArray[Any]:
    """As an array of numbers.

    Raises InputError for rows of different lengths, for what is no number, and for complex numbers
    where `dtype` is real.
    """
    try:
        given = np.asarray(values)
        if given.dtype.kind not in ("biufc" if dtype is complex else "biuf"):
            raise TypeError
        return given.astype(dtype)
    except (TypeError, ValueError):
        kind = "" if dtype is complex else "real "
        raise InputError(
            f"{name} is {values!r}; {kind}numbers in rows of one length are needed"
        ) from None


def need_numbers(**values: Any) -> None:
    """Raise InputError, by its name, for the first that is no real number."""
    for name, value in values.items():
        if not is_real(value):
            raise InputError(f"{name} is {value!r}; it must be a real number")


def need_places(**values: Any) -> None:
    """Raise InputError, by its name, for the first that numbers no measurement."""
    for name, value in values.items():
        need_whole(value, name)
        if value < 0:
            raise InputError(f"{name} is {value}; measurements are numbered from 0 on")
