"""The answer of a state-space fit: a model for each use, and the scores that chose them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.answer import ProgramAnswer
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.state_space.candidates import Candidates

USES = ("one_step", "free_run")
"""Uses of the predictor and of the simulator; each is also the name of a method of the model."""
MODELS = ("predictor", "simulator")
"""Name of the model for each use."""


@dataclass(frozen=True, eq=False, repr=False)
class IdentifiedModels(ProgramAnswer):
    """A model for each use, and the validation fits that chose their orders.

    Unlike a `StateSpace`, it holds one model for predictions and one for simulations.

    ``scores`` (uses, orders, ny) [%] holds one-step fits of predictors and free-run fits of
    simulators. ``dt`` [s] is the record's; ``candidates`` are those of a choice, if any.
    """

    predictor: InnovationsModel
    simulator: InnovationsModel
    scores: RealArray
    dt: float = 1.0
    candidates: Candidates | None = None

    @property
    def lti(self) -> StateSpace:
        """The simulator's system from u to y, at the record's sampling time."""
        return replace(self.simulator, dt=self.dt).system()

    def summary(self) -> str:
        models = f"predictor of order {self.predictor.order}, simulator of {self.simulator.order}"
        shown = "" if math.isnan(self.value) else f"\n  free-run fit of y1 {self.value:.4g} %"
        return f"IdentifiedModels: {models}{shown}"
