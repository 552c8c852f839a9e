"""Limits of an actuator: absolute limits and rates of the controls; working point, set-points."""

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
SLOWEST_FILTER = 1e5
"""Largest time constant of a set-point filter [samples]. Its steps are then still far larger than
the rounding of single precision.
"""


@dataclass(frozen=True, eq=False)
class Actuator:
    """The limits of p controls.

    ``lowest`` and ``highest`` (p,) are absolute limits, None without limits. ``step`` (p,) is the
    largest change from one sample to the next. ``point`` is the working point; the controller works
    with deviations from it. With ``sign`` the controller's input is sign (y - r). ``approach`` (m,)
    is the share of their distance from the set-points by which filtered set-points approach them in
    a sample; None without a filter.
    """

    lowest: RealArray | None = None
    highest: RealArray | None = None
    step: RealArray | None = None
    point: WorkingPoint | None = None
    sign: int = -1
    approach: RealArray | None = None

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

    def filtered(self, setpoint: RealArray, first: float) -> RealArray:
        """The filtered set-point (samples,) of a loop with one measurement, which is `first` at the
        start; without a filter the set-point itself.
        """
        if self.approach is None:
            return setpoint
        from scipy.signal import lfilter

        moves = -np.diff(setpoint, prepend=first)
        apart: RealArray = lfilter([1.0], [1.0, self.approach[0] - 1.0], moves)
        return setpoint + apart

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
    setpoint_filter: Any = None,
) -> Actuator | None:
    """The actuator for a controller with ``sizes`` (inputs, outputs); None if there is neither
    limit nor point.

    Raises InputError if the limits are in the wrong order, if the working point is outside them or
    has other sizes, if a rate is not positive, or if time constants of a set-point filter are
    shorter than a sample or extremely long, or if there is no working point for it.
    """
    approach = None
    if setpoint_filter is not None:
        approach = _approach(setpoint_filter, point, sizes[0], period)
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
    return Actuator(low, high, step, point, sign, approach)


def _approach(setpoint_filter: Any, point: Any, inputs: int, period: float) -> RealArray:
    """Shares (m,) of a filter's distance that it covers in a sample, from its time constants."""
    if point is None:
        raise InputError(
            "setpoint_filter needs a working_point: only then does the code take set-points"
        )
    times = np.atleast_1d(as_array(setpoint_filter, "setpoint_filter"))
    if (
        times.shape not in ((1,), (inputs,))
        or not ((times >= period) & (times <= SLOWEST_FILTER * period)).all()
    ):
        raise InputError(
            f"setpoint_filter is {setpoint_filter!r}; it must be the time constant [s] of all "
            f"set-points, or one of each of {inputs}, from {period:g}, the sampling time, to "
            f"{SLOWEST_FILTER * period:g}"
        )
    found: RealArray = np.broadcast_to(-np.expm1(-period / times), (inputs,)).astype(float)
    return found


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
