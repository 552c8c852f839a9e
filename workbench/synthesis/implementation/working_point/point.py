"""The constant signals around which a linear model holds."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from workbench.errors import InputError
from workbench.input_checks import as_array, need_kind


@dataclass(frozen=True)
class WorkingPoint:
    """Constant controls u and measurements y; a linear model holds for deviations from them.

    Parameters
    ----------
    u, y
        Controls and measurements at rest, in the user's units: a number, or one for each channel.
    u_unit, y_unit
        Their units, for figures and comments.

    Raises
    ------
    InputError
        A value is not finite.

    Examples
    --------
    >>> from workbench.synthesis import WorkingPoint
    >>> point = WorkingPoint(50.0, 71.3, u_unit="%", y_unit="degC")
    >>> point
    WorkingPoint(u = 50 %, y = 71.3 degC)
    """

    u: Any  # it is a tuple of floats after construction
    y: Any
    u_unit: str = field(default="1", kw_only=True)
    y_unit: str = field(default="1", kw_only=True)

    def __post_init__(self) -> None:
        for name in ("u", "y"):
            values = np.atleast_1d(as_array(getattr(self, name), name))
            if values.ndim != 1 or not values.size or not np.isfinite(values).all():
                raise InputError(
                    f"{name} of a working point is {getattr(self, name)!r}; finite numbers are "
                    "needed, one for each channel"
                )
            object.__setattr__(self, name, tuple(values.tolist()))
            need_kind(getattr(self, f"{name}_unit"), str, f"{name}_unit")

    def __repr__(self) -> str:
        return f"WorkingPoint(u = {told(self.u, self.u_unit)}, y = {told(self.y, self.y_unit)})"


def told(values: tuple[float, ...], unit: str) -> str:
    """Numbers with their unit, in words."""
    numbers = ", ".join(f"{value:.6g}" for value in values)
    return numbers if unit in ("", "1") else f"{numbers} {unit}"
