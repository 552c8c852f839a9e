"""An irreducible set of conflicting demands, and how far each one would have to be loosened."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.synthesis.demands.conflict_proof import conflict_proof
from workbench.synthesis.demands.demands import SLOW, Demands, DemandWeight, rational_of
from workbench.synthesis.demands.nominal_reach import Reach, nominal_reach
from workbench.synthesis.demands.weighted_loop import lateness
from workbench.synthesis.limits.dual_bound import DualCertificate

GREATEST_GAIN = 1e4
"""Largest |K S| of the controllers considered, relative to 1 / |G| at the crossover. With a larger
gain the noise of any sensor would drive any actuator from end to end.
"""
LEAST_MARGIN = 0.01
"""Least distance of L from -1 for the controllers considered, which is 1 / max |S|."""
MOST_LOOSENED, LOOSENED_TOLERANCE = 100.0, 1.02
"""Largest factor by which a demand is loosened, and the ratio of the bounds at which the search for
the least factor ends.
"""
SEARCHED_FROM = 1.05
"""Least level at which the search for a proof starts."""


@dataclass(frozen=True)
class NominalDemands:
    """Demands on a nominal plant with the delays of hold and computer."""

    nominal: Rational
    demands: Demands
    dt: float
    delay_samples: float

    @cached_property
    def plant(self) -> Rational:
        """The plant with its delays."""
        G, late = self.nominal, lateness(self.dt, self.delay_samples)
        return rational_of([*G.zeros, *late.zeros], [*G.poles, *late.poles], G.gain * late.gain)

    @property
    def speed(self) -> float:
        """An estimate of the crossover frequency of the loop [rad/s]."""
        return self.demands.crossover or float(np.abs(self.nominal.poles).max())

    @cached_property
    def bounded_gain(self) -> DemandWeight:
        """The weight of K S that limits the gain of all controllers considered."""
        gain = float(np.abs(self.plant.response(np.array([self.speed]))[0])) / GREATEST_GAIN
        return DemandWeight("bounded gain", "KS", rational_of([], [], gain), "gain", gain)

    def weights(self, names: Sequence[str], **loosened: float) -> list[DemandWeight]:
        """The weights of some demands, with demands loosened by factors, and the weights of margin
        and gain.
        """
        some = self.demands.only(names)
        for name, factor in loosened.items():
            some = some.loosened(name, factor)
        own = some.weights(self.nominal, self.dt, beside=self.demands)
        margin = DemandWeight(
            "margin", "S", rational_of([], [], LEAST_MARGIN), "margin", LEAST_MARGIN
        )
        return [*own, margin, self.bounded_gain]

    def reach(self, names: Sequence[str], **loosened: float) -> Reach:
        """Search for a controller that satisfies the weights of some demands."""
        return nominal_reach(self.plant, self.weights(names, **loosened), SLOW * self.speed)


@dataclass(frozen=True)
class Conflict:
    """A set of demands: no controller was found for all of it, but for all but one there is one.

    ``names`` is empty if all demands can be met together. ``controllers`` are named by the demand
    that is left out ("" if none is). ``factors`` says by how much each demand would have to be
    loosened so that all can be met; infinite if that is more than `MOST_LOOSENED`. ``proof`` shows
    that no controller meets them all; None if no proof was found.
    """

    names: tuple[str, ...]
    controllers: dict[str, StateSpace]
    factors: dict[str, float]
    proof: DualCertificate | None


def find_conflict(task: NominalDemands, context: Context) -> Conflict:
    """Find the conflict by a deletion filter: demands without which it remains are left out.

    Source: J. W. Chinneck, E. W. Dravnieks, Locating minimal infeasible constraint sets in linear
    programs, ORSA Journal on Computing 3 (1991) 157-168.
    """
    names = task.demands.asked
    whole = task.reach(names)
    if whole.K is not None:
        return Conflict((), {"": whole.K}, {}, None)
    kept, controllers = list(names), {}
    for name in context.track(list(names), "demands left out"):
        rest = [one for one in kept if one != name]
        if not rest:
            break
        without = task.reach(rest)
        if without.K is None:
            kept, whole = rest, without
        else:
            controllers[name] = without.K
    proof = conflict_proof(task.plant, task.weights(kept), max(whole.bound, SEARCHED_FROM), context)
    factors = {name: _least_loosening(task, kept, name) for name in kept}
    held = {name: K for name, K in controllers.items() if name in kept}
    return Conflict(tuple(kept), held, factors, proof)


def _least_loosening(task: NominalDemands, names: Sequence[str], name: str) -> float:
    """The least factor found on one demand with which a controller meets all demands."""
    if task.reach(names, **{name: MOST_LOOSENED}).K is None:
        return math.inf
    low, high = 1.0, MOST_LOOSENED
    while high > LOOSENED_TOLERANCE * low:
        middle = math.sqrt(low * high)
        if task.reach(names, **{name: middle}).K is None:
            low = middle
        else:
            high = middle
    return high
