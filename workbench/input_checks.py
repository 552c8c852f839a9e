"""Checks of arguments, made before anything is computed."""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable, Mapping
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.errors import InputError
from workbench.structure import Structure


def need_structure(structure: Any) -> None:
    """Raise InputError unless the argument is a Structure."""
    if not isinstance(structure, Structure):
        raise InputError(
            f"structure must be a Structure, not {type(structure).__name__}; "
            "Structure([Real(1), Full(2, 2)]) is one of two blocks, and Structure.from_pairs takes "
            "rows of two integers"
        )


def need_tolerance(tolerance: Any) -> None:
    """Raise InputError unless the tolerance is a number between 0 and 1."""
    if not (is_real(tolerance) and 0.0 < tolerance < 1.0):
        raise InputError(f"tolerance is {tolerance!r}; it must be a number between 0 and 1")


def need_count(name: str, value: Any, most: float = math.inf) -> None:
    """Raise InputError unless the value is an integer from 1 to ``most``."""
    whole = isinstance(value, numbers.Integral) and not isinstance(value, bool)
    if not (whole and 1 <= int(value) <= most):
        wanted = "of at least 1" if math.isinf(most) else f"from 1 to {most}"
        raise InputError(f"{name} is {value!r:.100}; it must be an integer {wanted}")


def need_positive(value: Any, name: str, or_none: bool = False) -> None:
    """Raise InputError unless the value is positive and finite (or None, if that is allowed)."""
    if or_none and value is None:
        return
    if not (is_real(value) and 0.0 < value < math.inf):
        end = ", or None" if or_none else ""
        raise InputError(f"{name} is {value!r}; it must be a number, positive and finite{end}")


def need_time_base(dt: Any) -> None:
    """Raise InputError unless dt is a sampling time [s], or python-control's 0, None or True."""
    if dt is None or dt is True:
        return
    if not (is_real(dt) and 0.0 <= dt < math.inf):
        raise InputError(
            f"dt is {dt!r}; it must be a sampling time [s], positive and finite, or 0 for "
            "continuous time, None for any, or True for an unknown one"
        )


def need_sampling_time(dt: Any, name: str) -> None:
    """Raise InputError for python-control's ``dt=True``: sampled, at a time that is not known."""
    if dt is True:
        raise InputError(
            f"{name} is sampled, but its sampling time is not given (dt=True): give it in seconds, "
            "as in control.ss(A, B, C, D, 0.01)"
        )


def common_time_base(times: Iterable[Any]) -> float | bool | None:
    """The sampling time [s] of systems together, by the rules of python-control.

    None fits every time, and True (sampled at an unknown time) every time but 0. Raises InputError
    for times that do not fit each other.
    """
    # a list, since a set holds True and 1.0 as one
    given = [True if dt is True else float(dt) for dt in times if dt is not None]
    numbers = {dt for dt in given if dt is not True}
    unknown = any(dt is True for dt in given)
    if len(numbers) > 1 or (unknown and 0.0 in numbers):
        told = ["0 (continuous)" if dt == 0.0 else f"{dt:g} s" for dt in sorted(numbers)]
        told += ["True (sampled at an unknown time)"] * unknown
        raise InputError(
            f"systems with the sampling times {' and '.join(told)} cannot be combined: give "
            "all of them one, by discretise, sampled_model or continuous_controller"
        )
    if numbers:
        return numbers.pop()
    return True if unknown else None


def need_whole(value: Any, name: str) -> None:
    """Raise InputError unless the value is a whole number."""
    if isinstance(value, bool) or not isinstance(value, numbers.Integral):
        raise InputError(f"{name} is {value!r}; it must be a whole number")


def as_list(values: Any, name: str) -> list[Any]:
    """The values as a list; raises InputError if they cannot be iterated, such as a number."""
    if isinstance(values, str | Mapping) or not isinstance(values, Iterable):
        raise InputError(f"{name} must be a list, not {values!r}")
    try:
        return list(values)
    except InputError:  # An iterator may raise an error of its own.
        raise
    except Exception as error:  # Some objects look like sequences but cannot be iterated.
        raise InputError(f"{name} must be a list, not {values!r}: {error}") from None


def need_choice(value: Any, choices: Any, name: str) -> None:
    """Raise InputError unless the value is one of the words of a Literal."""
    if not (isinstance(value, str) and value in get_args(choices)):
        raise InputError(f"{name} is {value!r}; it must be one of {', '.join(get_args(choices))}")


def need_kind(value: Any, kind: type, name: str) -> None:
    """Raise InputError unless the value is an instance of the class."""
    if not isinstance(value, kind):
        raise InputError(f"{name} must be a {kind.__name__}, not {type(value).__name__}")


def is_real(value: Any) -> bool:
    """Whether a value is a real number within the range of doubles; True and False are not."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        return False
    try:
        float(value)
    except OverflowError:  # an integer with hundreds of digits
        return False
    return True


def as_array(values: ArrayLike, name: str, *, dtype: type = float) -> NDArray[Any]:
    """Convert values to an array of numbers.

    Raises InputError for rows of different lengths, for entries that are not numbers, and for
    complex numbers if `dtype` is real.
    """
    try:
        given = np.asarray(values)
        if given.dtype.kind not in ("biufc" if dtype is complex else "biuf"):
            raise TypeError
        return given.astype(dtype)
    except Exception:  # Converting an arbitrary object may raise any error.
        kind = "" if dtype is complex else "real "
        raise InputError(
            f"{name} is {values!r}; {kind}numbers in rows of one length are needed"
        ) from None


def matrix_values(M: Any) -> NDArray[Any]:
    """M as a new complex array (..., columns, rows); python-control's FRD as (F, outputs, inputs).

    Raises InputError if M is not numeric.
    """
    if hasattr(M, "frdata"):
        M = np.moveaxis(np.asarray(M.frdata), -1, 0)
    elif hasattr(M, "ninputs"):
        raise InputError(
            f"M must be an array of numbers (..., columns, rows), not {type(M).__name__}; mu of a "
            "system is bounded by peak(system, structure), and an uncertain system has "
            "robust_stability"
        )
    try:
        return np.array(getattr(M, "values", M)).astype(complex)
    except Exception:  # Converting an arbitrary object may raise any error.
        raise InputError(
            f"M is {M!r:.100}; an array of numbers (..., columns, rows) is needed"
        ) from None


def as_matrices(M: Any, structure: Structure) -> NDArray[Any]:
    """M as a complex array (..., columns, rows) that fits the structure.

    Raises
    ------
    InputError
        M is not numeric, has the wrong shape, or an entry that is not finite.
    """
    matrices = matrix_values(M)
    need_structure(structure)
    structure.check(matrices)
    bad = np.argwhere(~np.isfinite(matrices))
    if bad.size:
        raise InputError(f"M has an entry that is not finite, at index {tuple(bad[0].tolist())}")
    return matrices


def need_numbers(**values: Any) -> None:
    """Raise InputError, with the argument's name, for the first value that is not a real number."""
    for name, value in values.items():
        if not is_real(value):
            raise InputError(f"{name} is {value!r}; it must be a real number")


def need_places(**values: Any) -> None:
    """Raise InputError, with the argument's name, for the first that is no channel number."""
    for name, value in values.items():
        need_whole(value, name)
        if value < 0:
            raise InputError(f"{name} is {value}; channels are numbered from 0 on")
