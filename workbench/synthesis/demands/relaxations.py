"""The largest bandwidth that any controller could have, and what it would be without each limit.

Robust performance of the stack of demands a and of the uncertainty b is |a| + |b| < 1 at every
frequency; then |a|^2 + |b|^2 < 1. So no controller has a bandwidth at which the norm of the stack
of both cannot be below 1. With one part of the statement left out the bandwidth grows; the part
with which it grows most is what limits it.
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
from workbench.synthesis.h_infinity.riccati import central
from workbench.uncertainty import UncertaintyModel

LARGEST_CHANGE = 64.0
"""The bandwidth is looked for up to this factor above and below the one demanded."""
BANDWIDTH_TOLERANCE = 1.03
"""How far the interval of the largest bandwidth is narrowed, as a factor."""
NORM_TOLERANCE = 1e-2
"""Relative width of the interval of a norm."""
MORE_CONTROL = 10.0
"""Factor of the control that counts as free."""
OF_CONTROL = ("effort", "control_range")
"""Demands that limit the control."""


@dataclass(frozen=True)
class LimitedBandwidth:
    """A plant, its uncertainty and demands, of which parts may be left out."""

    model: UncertaintyModel
    demands: Demands
    dt: float
    delay_samples: float
    late: bool = True
    spread: bool = True
    free_control: bool = False

    def largest(self) -> float:
        """Largest bandwidth [rad/s] at which the norm of the stack can be below 1; 0: none."""
        asked = self.demands.bandwidth
        assert asked is not None
        low, high = asked / LARGEST_CHANGE, asked * LARGEST_CHANGE
        if not self._possible(low):
            return 0.0
        if self._possible(high):
            return high
        while high > BANDWIDTH_TOLERANCE * low:
            middle = float(np.sqrt(low * high))
            low, high = (middle, high) if self._possible(middle) else (low, middle)
        return low

    @cached_property
    def _task(self) -> NominalDemands:
        return NominalDemands(self.model.nominal, self.demands, self.dt, self.delay_samples)

    def _possible(self, bandwidth: float) -> bool:
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
            found = central(system.A, system.B, system.C, system.D, 1, 1, NORM_TOLERANCE)
        except WorkbenchError:
            return False
        return found.lower < 1


def relaxations(
    whole: LimitedBandwidth, noise_free: UncertaintyModel | None
) -> dict[str, Callable[[], LimitedBandwidth]]:
    """The statement without each of what may limit the bandwidth, by the words for it."""
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
    """The plant with its zeros right of the axis mirrored: the same gain at every frequency."""
    zeros = nominal.zeros
    right = zeros.real > 0
    odd = -1.0 if int(right.sum()) % 2 else 1.0
    return replace(nominal, zeros=np.where(right, -zeros.conj(), zeros), gain=odd * nominal.gain)
