"""Limits of an actuator: absolute limits and rates of the controls, and the working point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.input_checks import as_array, as_list
from workbench.synthesis.implementation.working_point.point import WorkingPoint, told

Limits = tuple[ArrayLike, ArrayLike]
"""Lowest and highest value of each output; two numbers for a single output."""


@dataclass(frozen=True, eq=False)
class Actuator:
    """The limits of p controls.

    ``lowest`` and ``highest`` (p,) are absolute limits, None without limits. ``step`` (p,) is the
    largest change from one sample to the next. ``point`` is the working point; the controller works
    with deviations from it. With ``sign`` the controller's input is sign (y - r).
    """

    lowest: RealArray | None = None
    highest: RealArray | None = None
    step: RealArray | None = None
    point: WorkingPoint | None = None
    sign: int = -1

    @property
    def bounded(self) -> bool:
        """Whether limits can make a control differ from the value that the controller wants."""
        return self.lowest is not None or self.step is not None

    @property
    def deviations(self) -> tuple[RealArray, RealArray] | None:
        """Limits of the deviations of the controls from the working point."""
        if self.lowest is None or self.highest is None:
            return None
        rest = np.zeros_like(self.lowest) if self.point is None else np.array(self.point.u)
        return self.lowest - rest, self.highest - rest

    def within(self, wanted: RealArray, before: RealArray) -> RealArray:
        """The limited controls, from the wanted ones and those of the sample before."""
        if self.step is not None:
            wanted = np.clip(wanted, before - self.step, before + self.step)
        return wanted if self.lowest is None else np.clip(wanted, self.lowest, self.highest)


def actuator(
    limits: Limits | None,
    rate_limit: Any,
    point: WorkingPoint | None,
    sizes: tuple[int, int],
    period: float,
    sign: int = -1,
) -> Actuator | None:
    """The actuator for a controller with ``sizes`` (inputs, outputs); None if there is neither
    limit nor point.

    Raises InputError if the limits are in the wrong order, if the working point is outside them or
    has other sizes, or if a rate is not positive.
    """
    if limits is None and rate_limit is None and point is None:
        return None
    inputs, outputs = sizes
    low, high = (None, None) if limits is None else limits_of(limits, outputs)
    step = None
    if rate_limit is not None:
        step = np.atleast_1d(as_array(rate_limit, "rate_limit")) * period
        if step.shape != (outputs,) or not (np.isfinite(step).all() and (step > 0).all()):
            raise InputError(
                f"rate_limit is {rate_limit!r}; it must be the largest change in a second, "
                f"positive and finite, of {outputs} controls"
            )
    if point is not None:
        if not isinstance(point, WorkingPoint):
            raise InputError(f"working_point is {point!r}; a WorkingPoint(u, y) is needed")
        if (len(point.y), len(point.u)) != (inputs, outputs):
            raise InputError(
                f"the working point has {len(point.u)} controls and {len(point.y)} measurements; "
                f"the controller has {outputs} and {inputs}"
            )
        if low is not None and high is not None and not ((low < point.u) & (point.u < high)).all():
            raise InputError(
                f"the working point u = {told(point.u, point.u_unit)} is not between the limits "
                f"{told(tuple(low), point.u_unit)} and {told(tuple(high), point.u_unit)}: limits "
                "are absolute, in the units of u, not deviations from the working point"
            )
    return Actuator(low, high, step, point, sign)


def limits_of(limits: Limits, outputs: int) -> tuple[RealArray, RealArray]:
    """Lowest and highest values (p,) as arrays; raises InputError for wrong limits."""
    pair = as_list(limits, "limits")
    if len(pair) != 2:
        raise InputError(f"limits are {limits!r}; lowest and highest values are needed")
    low, high = (np.atleast_1d(as_array(limit, "limits")) for limit in pair)
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        raise InputError(f"limits are {limits}; they must be finite")
    if low.shape != (outputs,) or high.shape != (outputs,) or not (low < high).all():
        raise InputError(
            f"limits are {limits}; they must be the lowest and the highest values of {outputs} "
            "outputs, each lowest below its highest"
        )
    return low, high
