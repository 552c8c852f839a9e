"""A synthesis that may ask for the form of its controller: order, family, stable or slow poles."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field

from workbench.errors import InputError
from workbench.executor import Context
from workbench.heavy_types import StateSpace
from workbench.program import Claim, Program, Task, find_method
from workbench.solvers import Outcome
from workbench.synthesis.families.demands import Shippable
from workbench.synthesis.families.family import (
    Family,
    asked_of,
    family_for,
    need_continuous_plant,
    need_draws,
    started,
)
from workbench.synthesis.no_controller.claim import no_controller
from workbench.synthesis.no_controller.interlacing import violated, words
from workbench.systems.generalised_plant import GeneralisedPlant


@dataclass(frozen=True, eq=False)
class ControllerSynthesis(Program):
    """The synthesis of a controller for a plant, of any form or of one that is asked for.

    Method "fixed" searches controllers of an order or a family. Another method whose controller is
    not what is asked hands over to it. Parameters as of `workbench.synthesis.HinfSynthesis`.
    """

    plant: GeneralisedPlant
    order: int | None = field(default=None, kw_only=True)
    family: Family | None = field(default=None, kw_only=True)
    stable: bool = field(default=False, kw_only=True)
    fastest_pole: float | None = field(default=None, kw_only=True)
    start: StateSpace | None = field(default=None, kw_only=True)
    random: int = field(default=0, kw_only=True)

    @property
    @abstractmethod
    def closed_plant(self) -> GeneralisedPlant:
        """The plant that the controller closes."""

    def _set_form(self) -> None:
        """Take what is asked of the controller; raises InputError for what cannot be asked."""
        _ = self.demands  # raises for what is none
        need_draws(self.random)
        need_continuous_plant(self)
        if self.family is not None:
            object.__setattr__(self, "family", family_for(self.family, self.closed_plant))
        if self.start is not None:
            start = started(self.family, self.start, self.closed_plant)
            object.__setattr__(self, "start", start)
        if any(each is not None for each in (self.family, self.order, self.start)):
            object.__setattr__(self, "default_method", "fixed")

    @property
    def demands(self) -> Shippable:
        """What the controller must be besides."""
        return Shippable(self.order, self.stable, self.fastest_pole)

    def claim_task(self, claim: Outcome) -> Task | None:
        if claim is not Outcome.INFEASIBLE or not asked_of(self) or self.plant.system.dt:
            return None
        return no_controller(self.closed_plant.controlled(), self.stable)

    def respond(self, method: str | None, context: Context) -> Claim:
        controlled = self.closed_plant.controlled()
        zeros = violated(controlled) if self.stable and not controlled.dt else None
        if zeros is not None:
            find_method(self, method)  # raises for an unknown one
            return None, Outcome.INFEASIBLE, words(controlled, *zeros)
        claim = super().respond(method, context)
        answer, _, said = claim
        if (method or self.default_method) == "fixed" or answer is None or self.suits(answer.K):
            return claim
        fixed = super().respond("fixed", context)
        return *fixed[:2], f"{said}; not what is asked, handed over to fixed: {fixed[2]}"

    def suits(self, controller: StateSpace) -> bool:
        """Whether a controller meets the demands and is of the family."""
        if self.family is not None:
            try:
                self.family.about(controller)
            except InputError:
                return False
        return self.demands.admits(controller)

    @property
    def problem_size(self) -> float:
        """Number of states of the plant."""
        return float(self.plant.system.nstates)
