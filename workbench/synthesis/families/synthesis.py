"""Base of syntheses that may demand a form of the controller: order, family, stable or slow
poles.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field

from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.executor import Context
from workbench.program import Claim, Program, Task, find_method
from workbench.solvers import Outcome
from workbench.synthesis.families.demands import Shippable
from workbench.synthesis.families.family import (
    Family,
    asked_of,
    family_for,
    need_continuous_plant,
    need_draws,
    need_form_for_all,
    started,
)
from workbench.synthesis.families.several_plants import closed_side_by_side, further
from workbench.synthesis.no_controller.claim import no_controller
from workbench.synthesis.no_controller.interlacing import violated, words
from workbench.systems.bilinear import in_continuous_plane
from workbench.systems.generalised_plant import GeneralisedPlant


@dataclass(frozen=True, eq=False)
class ControllerSynthesis(Program):
    """Synthesis of a controller for a plant, of any form or with demands on its form.

    Method "fixed" searches controllers of an order or a family. If another method finds a
    controller that does not meet the demands, method "fixed" is run instead. Parameters are as in
    `workbench.synthesis.HinfSynthesis`.
    """

    plant: GeneralisedPlant
    order: int | None = field(default=None, kw_only=True)
    family: Family | None = field(default=None, kw_only=True)
    stable: bool = field(default=False, kw_only=True)
    fastest_pole: float | None = field(default=None, kw_only=True)
    start: StateSpace | None = field(default=None, kw_only=True)
    random: int = field(default=0, kw_only=True)
    largest_gain: float | None = field(default=None, kw_only=True)
    further_plants: Sequence[GeneralisedPlant] = field(default=(), kw_only=True)

    @property
    @abstractmethod
    def closed_plant(self) -> GeneralisedPlant:
        """The plant that the controller closes."""

    def _set_form(self) -> None:
        """Read the demands on the controller; raises InputError for demands that are not valid."""
        _ = self.demands  # raises InputError for a value that is not valid
        need_draws(self.random)
        need_continuous_plant(self)
        object.__setattr__(self, "further_plants", further(self.further_plants, self.closed_plant))
        need_form_for_all(self)
        if self.family is not None:
            object.__setattr__(self, "family", family_for(self.family, self.closed_plant))
        if self.start is not None:
            start = started(self.family, self.start, self.plants)
            object.__setattr__(self, "start", start)
        if any(each is not None for each in (self.family, self.order, self.start)):
            object.__setattr__(self, "default_method", "fixed")

    @property
    def demands(self) -> Shippable:
        """The demands on the controller itself."""
        return Shippable(self.order, self.stable, self.fastest_pole, gain=self.largest_gain)

    @property
    def plants(self) -> tuple[GeneralisedPlant, ...]:
        """The plants that the controller closes."""
        return (self.closed_plant, *self.further_plants)

    def loop(self, controller: StateSpace) -> StateSpace:
        """The closed loops of all plants, as one block diagonal system."""
        return closed_side_by_side(self.plants, controller)

    def claim_task(self, claim: Outcome) -> Task | None:
        if claim is not Outcome.INFEASIBLE or not asked_of(self) or self.plant.system.dt:
            return None
        return no_controller(self.closed_plant.controlled(), self.demands.stable)

    def respond(self, method: str | None, context: Context) -> Claim:
        controlled = self.closed_plant.controlled()
        stable = self.demands.stable
        zeros = violated(controlled) if stable and not controlled.dt else None
        if zeros is not None:
            find_method(self, method)  # raises an error for an unknown method
            return None, Outcome.INFEASIBLE, words(controlled, *zeros)
        claim = super().respond(method, context)
        answer, _, said = claim
        if (method or self.default_method) == "fixed" or answer is None or self.suits(answer.K):
            return claim
        fixed = super().respond("fixed", context)
        return *fixed[:2], f"{said}; it does not meet the demands, handed over to fixed: {fixed[2]}"

    def suits(self, controller: StateSpace) -> bool:
        """Whether a controller meets the demands and belongs to the family."""
        if self.family is not None:
            try:
                self.family.about(in_continuous_plane(controller))
            except InputError:
                return False
        return self.demands.admits(controller)

    @property
    def problem_size(self) -> float:
        """Number of states of the plant."""
        return float(self.plant.system.nstates)
