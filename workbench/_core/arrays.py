"""Types of NumPy arrays, machine epsilon, outward rounding to single precision, and hashes."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
RealArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
BoolArray = NDArray[np.bool_]
IntegerArray = NDArray[np.int64]

EPS = float(np.finfo(np.float64).eps)
"""Machine epsilon: the relative spacing of double-precision numbers near 1."""


def single_precision_bounds(bounds: Any) -> NDArray[np.float32]:
    """Lower and upper bounds (..., 2, F) in single precision, each rounded away from the other.

    A study stores long curves of bounds in this form. The rounding is outward, so the bounds still
    enclose the same values.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.study import single_precision_bounds
    >>> lower, upper = single_precision_bounds([[0.1], [0.1]])
    >>> float(lower[0]) < 0.1 < float(upper[0]), lower.dtype.name
    (True, 'float32')
    """
    exact = np.asarray(bounds, float)
    with np.errstate(over="ignore"):  # Numbers too large for single precision become infinite.
        rounded = exact.astype(np.float32)
    lower = np.array([[True], [False]])
    inward = np.where(lower, rounded > exact, rounded < exact)
    outward = np.where(lower, np.float32(-np.inf), np.float32(np.inf))
    return np.where(inward, np.nextafter(rounded, outward), rounded)


def read_only(array: np.ndarray) -> np.ndarray:
    """A view of an array that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


def content_hash(value: Any) -> str:
    """Hash of all numbers in arrays, systems, datasets, dataclasses, sequences and mappings.

    It covers numbers only: values that differ in anything else may have the same hash.
    """
    found = hashlib.blake2b(digest_size=16)
    _feed(found, value, set())
    return found.hexdigest()


def _feed(found: Any, value: Any, seen: set[int]) -> None:
    """Add everything that a value contains to a hash, each object once."""
    if isinstance(value, np.ndarray):
        if value.dtype.hasobject:
            _feed(found, value.tolist(), seen)
        else:
            found.update(f"{value.dtype}{value.shape}".encode())
            found.update(np.ascontiguousarray(value).reshape(-1).view(np.uint8).data)
    elif isinstance(value, str | bytes | int | float | complex | np.generic):
        found.update(repr(value).encode())
    elif id(value) not in seen:
        seen.add(id(value))
        for name, part in _parts(value):
            found.update(name.encode())
            _feed(found, part, seen)


def _parts(value: Any) -> list[tuple[str, Any]]:
    """The contents of an object, by name."""
    if is_dataclass(value) and not isinstance(value, type):
        return [(field.name, getattr(value, field.name)) for field in fields(value)]
    if isinstance(value, Mapping):
        return [(str(name), part) for name, part in value.items()]
    if isinstance(value, list | tuple):
        return [(str(number), part) for number, part in enumerate(value)]
    if all(hasattr(value, name) for name in "ABCD"):
        return [(name, np.asarray(getattr(value, name))) for name in "ABCD"]
    if hasattr(value, "tocoo"):  # a sparse array
        sparse = value.tocoo()
        return [("data", sparse.data), ("row", sparse.row), ("column", sparse.col)]
    if hasattr(value, "num_array") and hasattr(value, "den_array"):
        return [("num", value.num_array), ("den", value.den_array)]
    if hasattr(value, "data_vars"):  # a Dataset
        return [(str(name), np.asarray(value[name])) for name in value.data_vars]
    return [("values", np.asarray(value))] if hasattr(value, "dims") else []  # a DataArray
