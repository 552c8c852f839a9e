"""What the methods for a least norm share: the norm over parameters, starts, and the claim."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError, SolverError, TimeLimitError
from workbench.executor import Context
from workbench.executor.clock import time_is_up
from workbench.synthesis.families.family import Family
from workbench.synthesis.families.free import FreeMatrices
from workbench.synthesis.families.modal import Modal
from workbench.synthesis.mu.program import MuSynthesis
from workbench.synthesis.mu.structured.fixed import (
    DRAWS_PER_START,
    SHORTEST,
    START_SPREAD,
)
from workbench.synthesis.mu.structured.minimax_step import known_units
from workbench.synthesis.mu.structured.nonsmooth.bfgs import Valued
from workbench.synthesis.mu.structured.norm.drawn import stable_draws
from workbench.synthesis.mu.structured.norm.loop_norm import LoopNorm
from workbench.synthesis.mu.structured.starts.found import NoStabilisingGainError, found_starts
from workbench.systems.standard_plant import standard_plant

DRAWN = 8
"""Random starts of a search over all controllers of an order."""
STARTING_SHARE = 0.3
"""Share of the time left that other starts than random ones may take."""


@dataclass(frozen=True, eq=False)
class NormPoint:
    """Parameters x (k,) of a controller in a family, and the norm of its loop."""

    norm: LoopNorm
    x: RealArray
    value: float

    @property
    def controller(self) -> StateSpace:
        return self.norm.family.system(self.x)

    @cached_property
    def units(self) -> RealArray:
        """Units of steps (k,) about the point."""
        slope = self.norm.valued(self.x)[1]
        return known_units(self.norm.family.units(self.x), slope[None], self.value)

    @property
    def scaled(self) -> Valued:
        """The logarithm of the norm over steps from here in units, and its slopes.

        A logarithm falls at the same rate however small the norm has become.
        """

        def valued(y: RealArray) -> tuple[float, RealArray]:
            value, slope = self.norm.valued(self.x + self.units * y)
            if not (math.isfinite(value) and value > 0.0):
                return (value, slope) if value else (-math.inf, slope)
            return math.log(value), self.units * slope / value

        return valued

    def moved(self, y: RealArray) -> NormPoint:
        """The point after a step in units."""
        return self.at(self.x + self.units * y)

    def at(self, x: RealArray) -> NormPoint:
        return NormPoint(self.norm, x, self.norm.value(x))


@dataclass(frozen=True, eq=False)
class NormSearch:
    """A search for the least norm of a continuous plant over controllers of an order or a family.

    ``mu`` states it as a problem of mu without perturbation.
    """

    mu: MuSynthesis
    context: Context

    def about(self, K: StateSpace) -> NormPoint | None:
        """A controller as a point; None where it is no member, or its loop unstable."""
        family = self.mu.family
        try:
            own: Family
            if family is None or isinstance(family, Modal):
                own = FreeMatrices(K.nstates, self.mu.plant.measurements, self.mu.plant.controls)
                x = own.parameters(K)
            else:
                own, x = family.about(K)
        except InputError:
            return None
        norm = LoopNorm(standard_plant(self.mu.plant), own, self.mu.demands)
        value = norm.value(x)
        return NormPoint(norm, x, value) if math.isfinite(value) else None

    def starts(self) -> list[NormPoint]:
        """Stabilising members to start from, that of the least norm first.

        Raises NoStabilisingGainError or SolverError where there is none.
        """
        if self.mu.start is not None:
            given = self.about(self.mu.start)
            if given is None:
                raise SolverError("rounding hides whether the loop of the start is stable")
            return [given, *self._members(given)]
        found = self._drawn()
        why: Exception = SolverError("no stabilising controller was found")
        try:
            for one in found_starts(self.mu, self._share()):
                point = self.about(one.K)
                found += [] if point is None else [point]
        except NoStabilisingGainError:
            raise
        except (SolverError, InputError, TimeLimitError) as error:
            why = error
        if not found:
            raise why
        found.sort(key=lambda one: one.value)
        return [*found, *self._members(found[0])]

    def _share(self) -> Context:
        """A context with a part of the time left, for starts of other kinds than random ones."""
        left, options = self.context.left, self.context.options
        limit = None if math.isinf(left) else max(STARTING_SHARE * left, SHORTEST)
        return Context(options=replace(options, time_limit=limit), progress=self.context.progress)

    def _drawn(self) -> list[NormPoint]:
        """Points of random controllers of an order."""
        family, plant = self.mu.family, self.mu.plant
        if not (family is None or isinstance(family, Modal)):
            return []
        order = self.mu.order if family is None else family.order
        assert order is not None
        own = FreeMatrices(order, plant.measurements, plant.controls)
        norm = LoopNorm(standard_plant(plant), own, self.mu.demands)
        found = []
        self.context.progress("random starts", 0, DRAWN)
        for number, x in enumerate(stable_draws(norm, own, self.context.rng, DRAWN), start=1):
            found.append(NormPoint(norm, x, norm.value(x)))
            self.context.progress("random starts", number, DRAWN)
            if time_is_up("random starts"):
                break
        return found

    def _members(self, first: NormPoint) -> list[NormPoint]:
        """Random members about a point whose loops are stable, as many as are asked for."""
        found: list[NormPoint] = []
        for _ in range(DRAWS_PER_START * self.mu.random):
            step = START_SPREAD * self.context.rng.normal(size=first.x.size)
            member = first.moved(step)
            if len(found) < self.mu.random and math.isfinite(member.value):
                found.append(member)
        return found
