"""Common parts of the methods for a least norm: the norm at a point, and the starts."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError, SolverError, TimeLimitError
from workbench.executor import Context
from workbench.executor.clock import clocked_by, time_is_up
from workbench.synthesis.families.family import Family
from workbench.synthesis.families.free import FreeMatrices
from workbench.synthesis.families.modal import Modal
from workbench.synthesis.mu.program import MuSynthesis
from workbench.synthesis.mu.structured.minimax_step import known_units
from workbench.synthesis.mu.structured.nonsmooth.bfgs import Valued
from workbench.synthesis.mu.structured.norm.drawn import sizes_of, stable_draws
from workbench.synthesis.mu.structured.norm.loop_norm import LoopNorm
from workbench.synthesis.mu.structured.starts.found import NoStabilisingGainError, found_starts
from workbench.synthesis.mu.structured.starts.search import (
    DRAWS_PER_START,
    SHORTEST,
    START_SPREAD,
)
from workbench.systems.standard_plant import standard_plant

DRAWN = 8
"""Random starts of a search over all controllers of an order."""
DRAWN_SHARE, STARTING_SHARE = 0.15, 0.3
"""Shares of the time left that random starts, and other ones, may take."""


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
        """Units of steps (k,) from the point."""
        slope = self.norm.valued(self.x)[1]
        return known_units(self.norm.family.units(self.x), slope[None], self.value)

    @property
    def scaled(self) -> Valued:
        """The logarithm of the norm as a function of a step in units from this point, with its
        gradient.

        The logarithm decreases at the same rate, no matter how small the norm is.
        """

        def valued(y: RealArray) -> tuple[float, RealArray]:
            value, slope = self.norm.valued(self.x + self.units * y)
            if not (math.isfinite(value) and value > 0.0):
                return (value, slope) if value else (-math.inf, slope)
            return math.log(value), self.units * slope / value

        return valued

    def size(self, y: RealArray) -> float:
        """The logarithm of the norm after a step in units."""
        value = self.norm.value(self.x + self.units * y)
        return math.log(value) if value > 0.0 else -math.inf

    def grown(self, order: int, rng: np.random.Generator) -> NormPoint:
        """The same controller of all of an order with more states, which nothing shows yet.

        They are stable and the measurements drive them, so that the outputs can make use of them.
        """
        P, (A, B, C, D) = self.norm.plant, self.norm.family.matrices(self.x)
        more = order - len(A)
        speed, gains = sizes_of(P)
        rates = np.minimum(speed * np.exp(rng.normal(size=more)), self._allowed)
        driven = rates[:, None] * rng.normal(size=(more, P.measurements))
        driven *= gains.mean(axis=0) / gains.mean()
        whole = [
            [block_diag(A, -np.diag(rates)), np.vstack([B, driven])],
            [np.hstack([C, np.zeros((P.controls, more))]), D],
        ]
        own = FreeMatrices(order, P.measurements, P.controls)
        return NormPoint(replace(self.norm, family=own), np.block(whole).ravel(), self.value)

    @property
    def _allowed(self) -> float:
        """Largest pole of a new state [rad/s], within what is asked of the controller's poles."""
        fastest = self.norm.demands.fastest
        return math.inf if fastest is None else fastest / 2

    def moved(self, y: RealArray) -> NormPoint:
        """The point after a step in units."""
        return self.at(self.x + self.units * y)

    def at(self, x: RealArray) -> NormPoint:
        return NormPoint(self.norm, x, self.norm.value(x))


@dataclass(frozen=True, eq=False)
class NormSearch:
    """A search for the least norm of a continuous plant over controllers of an order or a family.

    ``mu`` is the same problem as a mu synthesis without perturbation.
    """

    mu: MuSynthesis
    context: Context

    @property
    def order(self) -> int | None:
        """The order of which all controllers are searched; None: there is another family."""
        family = self.mu.family
        if isinstance(family, Modal):
            return family.order
        return self.mu.order if family is None else None

    def about(self, K: StateSpace) -> NormPoint | None:
        """A controller as a point; None if it is no member of the family, or its loop is
        unstable.
        """
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
        """Stabilising members to start from, by increasing norm.

        Raises NoStabilisingGainError or SolverError if there is none.
        """
        if self.mu.start is not None:
            given = self.about(self.mu.start)
            if given is None:
                raise SolverError("rounding hides whether the loop of the start is stable")
            more = self.order is not None and self.order > self.mu.start.nstates
            first = given.grown(self.order or 0, self.context.rng) if more else given
            return [first, *self._random_members(first)]
        found = []
        if self.order is not None:
            with clocked_by(self.share_of_time(DRAWN_SHARE)):
                found = self.drawn(self.order, DRAWN)
        why: Exception = SolverError("no stabilising controller was found")
        try:
            for one in found_starts(self.mu, self.share_of_time(STARTING_SHARE)):
                point = self.about(one.K)
                found += [] if point is None else [point]
        except NoStabilisingGainError:
            raise
        except (SolverError, InputError, TimeLimitError) as error:
            why = error
        if not found:
            raise why
        found.sort(key=lambda one: one.value)
        return [*found, *self._random_members(found[0])]

    def share_of_time(self, share: float) -> Context:
        """A context with a part of the time left, for starts of one kind."""
        left, options = self.context.remaining, self.context.options
        limit = None if math.isinf(left) else max(share * left, SHORTEST)
        return Context(options=replace(options, time_limit=limit), progress=self.context.progress)

    def drawn(self, order: int, count: int) -> list[NormPoint]:
        """Points of random controllers of an order; fewer than `count` where few stabilise."""
        plant = self.mu.plant
        own = FreeMatrices(order, plant.measurements, plant.controls)
        norm = LoopNorm(standard_plant(plant), own, self.mu.demands)
        found = []
        self.context.progress("random starts", 0, count)
        for number, x in enumerate(stable_draws(norm, own, self.context.rng, count), start=1):
            found.append(NormPoint(norm, x, norm.value(x)))
            self.context.progress("random starts", number, count)
            if time_is_up("random starts"):
                break
        return found

    def _random_members(self, first: NormPoint) -> list[NormPoint]:
        """Random members around a point with stable loops, as many as the program asks for."""
        found: list[NormPoint] = []
        for _ in range(DRAWS_PER_START * self.mu.random):
            step = START_SPREAD * self.context.rng.normal(size=first.x.size)
            member = first.moved(step)
            if len(found) < self.mu.random and math.isfinite(member.value):
                found.append(member)
        return found
