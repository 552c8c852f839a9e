"""Input checks of sampled responses; an error names the first entry that is wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import InputError


def as_frequencies(omega: ArrayLike) -> RealArray:
    """Angular frequencies [rad/s] (F,), F >= 1, positive, finite and rising, or an `InputError`."""
    values = _as_array("omega", omega, "iuf").astype(float)
    if values.ndim != 1 or values.size == 0:
        raise InputError(f"omega must have shape (F,), F >= 1, not {values.shape}")
    _refuse(
        "omega must be positive and finite [rad/s]", ~((values > 0) & (values < np.inf)), values
    )
    falling = np.append(False, np.diff(values) <= 0)
    _refuse("omega must rise: sort it and merge what repeats", falling, values)
    return values


def as_responses(response: ArrayLike, omega: RealArray) -> ComplexArray:
    """Finite complex responses (F,), one for each frequency, or an `InputError`."""
    values = _as_array("response", response, "iufc").astype(complex)
    if values.shape != omega.shape:
        raise InputError(f"response has shape {values.shape}, omega {omega.shape}: give one each")
    _refuse("response must be finite", ~np.isfinite(values), values, omega)
    return values


def as_weights(weight: ArrayLike | None, response: ComplexArray, omega: RealArray) -> RealArray:
    """Weights (F,), some positive, none negative, 1 / |response| for None; or an `InputError`."""
    if weight is None:
        _refuse(
            "the relative error, which the default weight asks for, needs responses other than "
            "zero: give weights, all ones for the absolute error",
            response == 0, response, omega,
        )  # fmt: skip
        return 1 / np.abs(response)
    values = _as_array("weight", weight, "iuf").astype(float)
    if values.shape != omega.shape:
        raise InputError(f"weight has shape {values.shape}, omega {omega.shape}: give one each")
    _refuse("weight must be finite and not negative", ~((values >= 0) & (values < np.inf)),
            values, omega)  # fmt: skip
    if not values.any():
        raise InputError("every weight is zero: at least one response must count")
    return values


def as_positive(name: str, given: ArrayLike, omega: RealArray) -> RealArray:
    """Finite positive numbers (F,), one for each frequency, or an `InputError` that names them."""
    values = _as_array(name, given, "iuf").astype(float)
    if values.shape != omega.shape:
        raise InputError(f"{name} has shape {values.shape}, omega {omega.shape}: give one each")
    _refuse(f"{name} must be positive and finite", ~((values > 0) & (values < np.inf)),
            values, omega)  # fmt: skip
    return values


def _as_array(name: str, given: ArrayLike, kinds: str) -> np.ndarray:
    """An array whose type is one of the given kinds of NumPy, or an `InputError`."""
    try:
        values = np.asarray(given)
    except Exception as error:  # an object that is not an array may fail with any error
        raise InputError(f"{name} is no array of numbers: {error}") from None
    if values.dtype.kind not in kinds:
        needed = "numbers" if "c" in kinds else "real numbers"
        raise InputError(f"{name} must hold {needed}, not {values.dtype}")
    return values


def as_count(name: str, value: Any) -> int:
    """A whole number, 0 or more, or an `InputError` that names it."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 0:
        raise InputError(f"{name} must be a whole number, 0 or more, not {value!r}")
    return int(value)


def _refuse(needed: str, bad: Any, values: Any, omega: RealArray | None = None) -> None:
    """Raise `InputError` if an entry is bad; it says what is needed and names the first one."""
    if bad.any():
        i = int(np.argmax(bad))
        where = "" if omega is None else f" (at {omega[i]:.6g} rad/s)"
        raise InputError(f"{needed}; entry {i} is {values[i]}{where}")
