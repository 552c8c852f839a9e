"""The largest bandwidth that any controller could have, with all limits and without each of them.

Let a be the stack of the weighted demands, and b the weighted uncertainty. Robust performance means
|a| + |b| < 1 at every frequency, and then |a|^2 + |b|^2 < 1. So a bandwidth is impossible if no
controller makes the norm of the stack of both less than 1. If one part of the problem is left out,
the largest bandwidth grows. The part whose omission gives the largest growth limits the bandwidth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from workbench.errors import WorkbenchError
from workbench.fitting.rational import Rational
from workbench.synthesis.demands.conflict import NominalDemands
from workbench.synthesis.demands.demands import KINDS, SLOW, Demands, DemandWeight, strictest
from workbench.synthesis.demands.nominal_reach import poles_off_axis
from workbench.synthesis.demands.weighted_loop import weighted_loop
from workbench.synthesis.h_infinity.riccati import central_controller
from workbench.uncertainty import UncertaintyModel

LARGEST_CHANGE = 64.0
"""The search covers bandwidths up to this factor above and below the demanded one."""
BANDWIDTH_TOLERANCE = 1.03
"""Ratio of the bounds on the largest bandwidth at which the search ends."""
NORM_TOLERANCE = 1e-2
"""Relative width of the interval that contains a norm."""
MORE_CONTROL = 10.0
"""Factor by which control demands are loosened when the control counts as free."""
OF_CONTROL = ("effort", "control_range")
"""Demands that limit the control."""


@dataclass(frozen=True)
class LimitedBandwidth:
    """A plant, its uncertainty and the demands; parts of these may be left out."""

    model: UncertaintyModel
    demands: Demands
    dt: float
    delay_samples: float
    late: bool = True
    spread: bool = True
    free_control: bool = False

    def largest(self) -> float:
        """Largest bandwidth [rad/s] for which the norm of the stack can be below 1; 0 for none."""
        asked = self.demands.bandwidth
        assert asked is not None
        low, high = asked / LARGEST_CHANGE, asked * LARGEST_CHANGE
        if not self._can_be_below_one(low):
            return 0.0
        if self._can_be_below_one(high):
            return high
        while high > BANDWIDTH_TOLERANCE * low:
            middle = float(np.sqrt(low * high))
            low, high = (middle, high) if self._can_be_below_one(middle) else (low, middle)
        return low

    @cached_property
    def _task(self) -> NominalDemands:
        return NominalDemands(self.model.nominal, self.demands, self.dt, self.delay_samples)

    def _can_be_below_one(self, bandwidth: float) -> bool:
        plant = self._task.plant if self.late else self.model.nominal
        demands = replace(self.demands, bandwidth=bandwidth)
        rows = strictest(demands.weights(self.model.nominal, self.dt))
        if self.free_control:
            rows = [
                one._replace(W=replace(one.W, gain=one.W.gain / MORE_CONTROL))
                if one.name in OF_CONTROL
                else one
                for one in rows
            ]
        if self.spread:
            rows += [
                DemandWeight(name, "T", W, name, 1.0)
                for name, W in (("circular", self.model.W_c), ("real", self.model.W_r))
                if W is not None
            ]
        near = poles_off_axis(plant, SLOW * bandwidth).state_space()
        system = weighted_loop(near, None, [*rows, self._task.bounded_gain]).system
        try:
            found = central_controller(system.A, system.B, system.C, system.D, 1, 1, NORM_TOLERANCE)
        except WorkbenchError:
            return False
        return found.lower < 1


def relaxations(
    whole: LimitedBandwidth, noise_free: UncertaintyModel | None
) -> dict[str, Callable[[], LimitedBandwidth]]:
    """The problem without each possible limit of the bandwidth, by the words for this limit."""
    demands, nominal = whole.demands, whole.model.nominal
    found: dict[str, Callable[[], LimitedBandwidth]] = {
        "the delay of hold and computer": lambda: replace(whole, late=False),
        "the spread of the plants": lambda: replace(whole, spread=False),
    }
    if noise_free is not None or demands.control_rms is not None:
        less = replace(demands, control_rms=None)
        model = noise_free or whole.model
        found["noise"] = lambda: replace(whole, model=model, demands=less)
    if set(OF_CONTROL) & set(demands.asked):
        found["the control that is allowed"] = lambda: replace(whole, free_control=True)
    if (nominal.zeros.real > 0).any():
        found["a zero right of the axis"] = lambda: replace(
            whole, model=replace(whole.model, nominal=_mirrored(nominal))
        )
    for name in ("settling_time", "overshoot", "recovery_time"):
        if name in demands.asked:
            without = demands.only([one for one in demands.asked if one != name])
            words = f"the demand on the {KINDS[name].words}"
            found[words] = partial(replace, whole, demands=without)
    return found


def _mirrored(nominal: Rational) -> Rational:
    """The plant with its zeros right of the axis mirrored to the left: its gain stays the same."""
    zeros = nominal.zeros
    right = zeros.real > 0
    odd = -1.0 if int(right.sum()) % 2 else 1.0
    return replace(nominal, zeros=np.where(right, -zeros.conj(), zeros), gain=odd * nominal.gain)
