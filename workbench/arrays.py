"""Kinds of NumPy arrays, for annotations, the spacing of their numbers, and single precision."""

from __future__ import annotations

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


def outward_single(bounds: Any) -> NDArray[np.float32]:
    """Lower and upper bounds (..., 2, F) in single precision, as safe: each rounded outward."""
    exact = np.asarray(bounds, float)
    with np.errstate(over="ignore"):  # what is too large for single precision is infinite there
        rounded = exact.astype(np.float32)
    lower = np.array([[True], [False]])
    inward = np.where(lower, rounded > exact, rounded < exact)
    outward = np.where(lower, np.float32(-np.inf), np.float32(np.inf))
    return np.where(inward, np.nextafter(rounded, outward), rounded)
