"""Time instants given by labels of samples: those of pandas and of labelled arrays."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.files.clocks import as_seconds
from workbench.identification.files.names import split_name
from workbench.identification.files.units import converted, plain_unit

UNEVEN = 0.1
"""Largest deviation of a sampling interval from the mean one, and largest distance between the
first instants of u and y, in sampling intervals: instants are rounded.
"""

ROWS = "numbers of rows"
"""The kind of labels that give an order but no time."""


@dataclass(frozen=True, eq=False)
class Instants:
    """Instants [s] of samples; dates are counted from the first one.

    ``origin`` is the meaning of the first instant: a date, a text, or None if the seconds are plain
    numbers. ``kind`` describes the labels; instants of the same kind can be compared.
    """

    seconds: RealArray
    kind: str
    origin: Any = None


def of_index(index: Any, name: str) -> Instants | None:
    """The instants given by a pandas index, or row numbers.

    Raises
    ------
    InputError
        Its labels are not instants; the message says what to do.
    """
    kind = type(index).__name__
    if len(index) < 2:
        return None
    if kind == "RangeIndex":
        return Instants(np.asarray(index, dtype=float), ROWS)
    if kind == "MultiIndex":
        raise InputError(
            f"{name} has an index of {index.nlevels} levels; instants are needed, or "
            "reset_index(drop=True) and dt="
        )
    if kind == "PeriodIndex":
        index = index.to_timestamp()
    if index.dtype == object and hasattr(index[0], "isoformat"):
        import pandas

        # different time zones remain objects, which are refused
        with suppress(ValueError, TypeError):
            index = pandas.DatetimeIndex(index)
    if getattr(index, "tz", None) is not None:
        labels = index.tz_convert("UTC").tz_localize(None).to_numpy()
        return _dates(labels, "dates with a time zone")
    unit = split_name(str(index.name), "time")[1] if index.name is not None else None
    return of_labels(index.to_numpy(), unit or "s", name)


def of_labels(labels: np.ndarray, unit: str, name: str) -> Instants | None:
    """The instants given by an array of labels; numbers are in a unit of time.

    Raises InputError as `of_index`.
    """
    if len(labels) < 2:
        return None
    if labels.dtype.kind == "M":
        return _dates(labels, "dates without a time zone")
    if labels.dtype.kind == "m":
        return Instants(labels / np.timedelta64(1, "ns") * 1e-9, "times")
    if labels.dtype.kind in "iuf":
        try:
            seconds = converted(labels.astype(float), plain_unit(unit), "s")
        except InputError as error:
            raise InputError(f"the instants of {name}: {error}") from None
        return Instants(seconds, "numbers")
    if all(isinstance(label, str) for label in labels):
        return _texts([str(label) for label in labels], name)
    raise InputError(
        f"the samples of {name} are labelled by {type(labels[0]).__name__}, such as {labels[0]!r}; "
        "instants are needed: numbers [s], dates, or no labels and dt="
    )


def _dates(labels: np.ndarray, kind: str) -> Instants:
    """Instants from dates, counted from the first."""
    seconds = (labels - labels[0]) / np.timedelta64(1, "ns") * 1e-9
    return Instants(np.asarray(seconds, dtype=float), kind, labels[0])


def _texts(labels: list[str], name: str) -> Instants:
    """Instants from dates written as text, counted from the first."""
    try:
        found = as_seconds(labels)
    except InputError as error:
        raise InputError(f"the instants of {name}: {error}") from None
    if isinstance(found, int):
        raise InputError(
            f"the samples of {name} are labelled by texts, and {labels[found]!r} of sample {found} "
            "is no date or clock: give instants, or no labels and dt="
        )
    return Instants(found[0], "texts", labels[0])


def step_of(instants: Instants, name: str) -> float:
    """Sampling time [s] of instants; raises `InputError` unless they are equidistant."""
    steps = np.diff(instants.seconds)
    mean = float(steps.mean())
    apart = ~(np.abs(steps - mean) <= UNEVEN * abs(mean))
    if not mean > 0 or apart.any():
        raise InputError(
            f"the instants of {name} ({instants.kind}) are not equidistant and rising at sample "
            f"{int(np.argmax(apart)) + 1}: sort the rows, resample the record or cut it there"
        )
    return mean


def need_same_start(u: Instants, y: Instants, step: float) -> None:
    """Raise `InputError` if y begins at another instant, or another row, than u."""
    if u.kind != y.kind:
        if ROWS in (u.kind, y.kind):
            return
        raise InputError(
            f"the instants of u are {u.kind} and those of y {y.kind}; give both the same ones"
        )
    if isinstance(u.origin, str):
        both = as_seconds([u.origin, y.origin])
        later = float("nan") if isinstance(both, int) else float(both[0][1])
    elif u.origin is not None:
        later = float((y.origin - u.origin) / np.timedelta64(1, "ns") * 1e-9)
    else:
        later = float(y.seconds[0] - u.seconds[0])
    if not abs(later) <= UNEVEN * step:
        unit = "rows" if u.kind == ROWS else "s"
        raise InputError(
            f"y begins {later:.6g} {unit} after u; cut both to the instants that they share, "
            "or resample one of them there"
        )
