"""Kinds of NumPy arrays, for annotations, and the spacing of their numbers."""

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
