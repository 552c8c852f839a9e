"""Arrays of positive data, checked."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench.errors import InputError
from workbench.fitting.rational import Real


def positive(name: str, given: Any, omega: Real | None = None) -> Real:
    """A one-dimensional array of finite positive numbers, as long as ``omega``."""
    try:
        values = np.array(given)
        if values.dtype.kind not in "iuf":
            raise TypeError
    except (TypeError, ValueError):
        raise InputError(f"{name} must be an array of real numbers") from None
    if values.ndim != 1 or values.size == 0 or (omega is not None and values.size != omega.size):
        needed = "(F,), F >= 1" if omega is None else f"({omega.size},), one value a frequency"
        raise InputError(f"{name} must have shape {needed}, it has {values.shape}")
    values = values.astype(float)
    bad = np.flatnonzero(~(np.isfinite(values) & (values > 0)))
    if bad.size:
        i = int(bad[0])
        where = f" ({omega[i]:.6g} rad/s)" if omega is not None else ""
        raise InputError(
            f"{name} must be positive and finite, but {bad.size} of {values.size} values are not: "
            f"the first is {values[i]} at index {i}{where}"
        )
    return values
