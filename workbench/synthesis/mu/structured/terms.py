"""Norms of loops as functions of a family's parameters: terms to minimise or to limit."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.structure import Full, Structure
from workbench.synthesis.families.family import Family
from workbench.synthesis.mu.structured.energy import EnergyProblem
from workbench.synthesis.mu.structured.problem import PeakProblem
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.norms import norm_and_place
from workbench.systems.realisation import matrices_of, realisation

Curve = tuple[RealArray, RealArray]
"""Places (F,), such as frequencies [rad/s], and values (F,) at these places."""


class Term(ABC):
    """The largest of several values, which is minimised or kept below a ``limit``."""

    limit: float | None

    @abstractmethod
    def curve(self, x: RealArray) -> Curve | None:
        """Values at places that determine the largest one; None if the loop is unstable or K does
        not meet the demands.
        """

    @abstractmethod
    def linear(self, x: RealArray, places: RealArray) -> tuple[RealArray, RealArray]:
        """Values (F,) at places, and their gradients (F, k) by the parameters."""

    @abstractmethod
    def in_family(self, family: Family) -> Term:
        """The same term as a function of another family's parameters."""

    def direct(self, x: RealArray) -> tuple[RealArray, RealArray]:
        """Quantities (r,) that must be zero for a finite term, and their gradients (r, k)."""
        return np.zeros(0), np.zeros((0, len(x)))


@dataclass(frozen=True, eq=False)
class PeakTerm(Term):
    """The peak of mu, or the H-infinity norm, of a loop."""

    problem: PeakProblem
    limit: float | None = None

    def curve(self, x: RealArray) -> Curve | None:
        loop = self.problem.loop(x)
        if loop is None:
            return None
        places, values = self.problem.curve(loop)
        if len(self.problem.structure.blocks) > 1 or self.limit is None:
            return places, values
        # the frequencies resolve a limited norm only to 1e-3
        size, omega = norm_and_place(matrices_of(loop))
        if not 0.0 < omega < math.inf:
            return places, values
        place = int(np.searchsorted(places, omega))
        return np.insert(places, place, omega), np.insert(values, place, size)

    def linear(self, x: RealArray, places: RealArray) -> tuple[RealArray, RealArray]:
        return self.problem.linear(x, places)

    def in_family(self, family: Family) -> PeakTerm:
        return replace(self, problem=replace(self.problem, family=family))


@dataclass(frozen=True, eq=False)
class EnergyTerm(Term):
    """The H2 norm of a loop."""

    problem: EnergyProblem
    limit: float | None = None

    def curve(self, x: RealArray) -> Curve | None:
        energy = self.problem.value(x)
        return (np.zeros(1), np.array([math.sqrt(energy)])) if math.isfinite(energy) else None

    def linear(self, x: RealArray, places: RealArray) -> tuple[RealArray, RealArray]:
        size = math.sqrt(self.problem.value(x))
        return np.array([size]), self.problem.slopes(x)[None] / (2.0 * size)

    def in_family(self, family: Family) -> EnergyTerm:
        return replace(self, problem=replace(self.problem, family=family))

    def direct(self, x: RealArray) -> tuple[RealArray, RealArray]:
        return self.problem.direct(x)


def gain_term(family: Family, inputs: int, outputs: int, limit: float) -> PeakTerm:
    """Term for the controller's own largest gain: the norm of a loop with w = y and z = u."""
    n = inputs + outputs
    D = np.zeros((n, n))
    D[:outputs, inputs:], D[outputs:, :inputs] = np.eye(outputs), np.eye(inputs)
    bare: StateSpace = realisation((np.zeros((0, 0)), np.zeros((0, n)), np.zeros((n, 0)), D), 0.0)
    plant = GeneralisedPlant(bare, None, outputs, inputs)
    problem = PeakProblem(plant, Structure([Full(inputs, outputs)]), family)
    return PeakTerm(problem, limit)
