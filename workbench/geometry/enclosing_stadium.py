"""Stadiums, and the base of programs for stadiums of a free or given centre and direction.

A stadium is the set of points within ``radius`` of a segment.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Any, ClassVar

import numpy as np

from workbench._core.arrays import EPS
from workbench._core.heavy_types import Dataset
from workbench.answer import ProgramAnswer
from workbench.certificate import Check, worst_value
from workbench.errors import InputError
from workbench.geometry.enclosing_shape import EnclosingShape, relative
from workbench.geometry.points import canonical_angle

CENTRE_TOLERANCE = 4 * EPS
"""Largest distance of the answer's centre from a given one, relative to |centre|: rounding only."""
ANGLE_TOLERANCE = 1e-12
"""Largest difference [rad], modulo pi, of the answer's angle from a given one: rounding only."""


@dataclass(frozen=True, repr=False)
class Stadium(ProgramAnswer):
    """Stadiums, one for each set: arrays of ``center``, ``radius``, ``half_length`` and ``angle``.

    The centre is complex; the angle [rad] is in [0, pi).
    """

    center: np.ndarray
    radius: np.ndarray
    half_length: np.ndarray
    angle: np.ndarray

    @property
    def area(self) -> np.ndarray:
        """Area (...) of each stadium: a disc in two halves and a rectangle between them."""
        return np.asarray(np.pi * self.radius**2 + 4 * self.radius * self.half_length)


@dataclass(frozen=True, eq=False)
class EnclosingStadium(EnclosingShape):
    """Base of the programs for a best stadium that contains every point of a set.

    Parameters
    ----------
    points
        Complex, shape (..., N).
    center
        Complex, broadcast against the sets; None: free.
    angle
        Direction of the segment [rad], modulo pi, broadcast against the sets; None: free.

    Examples
    --------
    >>> from workbench.geometry import EnclosingStadium, NarrowestStadium
    >>> issubclass(NarrowestStadium, EnclosingStadium)
    True
    """

    _: KW_ONLY
    center: Any = None  # an ndarray after construction, if given
    angle: Any = None

    answer_names: ClassVar[dict[str, str]] = {
        "center": "centre of the stadium",
        "radius": "radius of the stadium, half its width",
        "half_length": "half the length of its segment",
        "angle": "direction of its segment",
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, kinds in (("center", "iufc"), ("angle", "iuf")):
            given = getattr(self, name)
            if given is not None:
                object.__setattr__(self, name, self._broadcast(name, given, kinds))
        if self.angle is not None:
            object.__setattr__(self, "angle", canonical_angle(self.angle))

    def _broadcast(self, name: str, given: Any, kinds: str) -> np.ndarray:
        """A given centre or angle, repeated for each set, or an `InputError`."""
        try:
            value = np.asarray(given)
            if value.dtype.kind not in kinds:
                raise InputError(f"{name} must be a number, it has type {value.dtype}")
            value = np.broadcast_to(value, self.batch)
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            raise InputError(
                f"{name} of shape {np.shape(given)} does not fit sets of shape {self.batch}"
            ) from None
        if not np.all(np.isfinite(value)):
            raise InputError(f"{name} must be finite")
        return value

    def checks(self, answer: Stadium, tolerance: float) -> list[Check]:
        checks = list(super().checks(answer, tolerance))
        if self.center is not None:
            away = relative(np.abs(answer.center - self.center), np.abs(self.center))
            value, where = worst_value(away, self.place)
            statement = "distance from the centre asked for, relative to its size"
            checks.append(Check("centre given", statement, value, CENTRE_TOLERANCE, where=where))
        if self.angle is not None:
            turn = np.mod(answer.angle - self.angle + np.pi / 2, np.pi) - np.pi / 2
            value, where = worst_value(np.abs(turn), self.place)
            statement = "distance from the angle asked for [rad]"
            checks.append(Check("angle given", statement, value, ANGLE_TOLERANCE, where=where))
        return checks

    @property
    def rounding(self) -> np.ndarray:
        """Rounding error (...) allowed in a radius: 24 eps of the largest |p| or |centre|."""
        given = 0.0 if self.center is None else np.abs(self.center.astype(np.clongdouble))
        return 24 * EPS * np.maximum(self.reach, given)

    def objective_rounding(self, answer: Stadium) -> float:
        """Sum over the sets of the rounding error allowed in a radius."""
        return float(np.sum(self.rounding))

    @property
    def size(self) -> int:
        """Number of points N of each set."""
        return self.points.shape[-1]

    def from_dataset(self, data: Dataset) -> Stadium:
        return Stadium(*(data[name].values for name in self.answer_names))
