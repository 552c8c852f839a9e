"""An irreducible set of demands that cannot be had together, and what each would have to give."""

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
"""Largest |K S| of controllers that count, over 1 / |G| at the crossover: any sensor's noise would
drive any actuator from end to end."""
LEAST_MARGIN = 0.01
"""Least distance of L from -1 of controllers that count: the inverse of the largest |S|."""
MOST_LOOSENED, LOOSENED_TOLERANCE = 100.0, 1.02
"""Largest factor by which a demand is loosened, and how far the least factor is narrowed."""
SEARCHED_FROM = 1.05
"""Least level from which on a proof is looked for."""


@dataclass(frozen=True)
class NominalDemands:
    """Demands on a nominal plant behind hold and computer."""

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
        """A frequency [rad/s] at which the loop may cross over."""
        return self.demands.crossover or float(np.abs(self.nominal.poles).max())

    @cached_property
    def bounded_gain(self) -> DemandWeight:
        """The weight of K S that every controller which counts keeps."""
        gain = float(np.abs(self.plant.response(np.array([self.speed]))[0])) / GREATEST_GAIN
        return DemandWeight("bounded gain", "KS", rational_of([], [], gain), "gain", gain)

    def weights(self, names: Sequence[str], **loosened: float) -> list[DemandWeight]:
        """The weights of some demands, with one of them loosened by a factor, and what is usual."""
        some = self.demands.only(names)
        for name, factor in loosened.items():
            some = some.loosened(name, factor)
        own = some.weights(self.nominal, self.dt, beside=self.demands)
        margin = DemandWeight(
            "margin", "S", rational_of([], [], LEAST_MARGIN), "margin", LEAST_MARGIN
        )
        return [*own, margin, self.bounded_gain]

    def reach(self, names: Sequence[str], **loosened: float) -> Reach:
        """Whether a controller keeps the weights of some demands."""
        return nominal_reach(self.plant, self.weights(names, **loosened), SLOW * self.speed)


@dataclass(frozen=True)
class Conflict:
    """Demands of which no controller was found that keeps all, and any others together.

    ``names`` is empty where all can be had together. ``controllers``: by the demand that is left
    out ("" for all). ``factors``: by how much each would have to be loosened for the rest to hold;
    infinite where that is more than `MOST_LOOSENED`. ``proof``: that no controller keeps them.
    """

    names: tuple[str, ...]
    controllers: dict[str, StateSpace]
    factors: dict[str, float]
    proof: DualCertificate | None


def find_conflict(task: NominalDemands, context: Context) -> Conflict:
    """The conflict of demands by a deletion filter: what is not needed for it is left out.

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
    factors = {name: _least_factor(task, kept, name) for name in kept}
    held = {name: K for name, K in controllers.items() if name in kept}
    return Conflict(tuple(kept), held, factors, proof)


def _least_factor(task: NominalDemands, names: Sequence[str], name: str) -> float:
    """The least factor found by which one demand is loosened so that a controller keeps all."""
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
