"""H-infinity synthesis for plants of the literature."""

from __future__ import annotations

from typing import Literal

from workbench import problem
from workbench.synthesis import HinfSynthesis

from ..textbook.controller import PLANTS


@problem("quick/{plant}/hinf", plant=("mass-spring", "distillation", "unstable-first-order"))
def hinf(plant: Literal["mass-spring", "distillation", "unstable-first-order"]) -> HinfSynthesis:
    """The controller with the least H-infinity norm of the weighted plant.

    Perturbation channels count as exogenous inputs and performance outputs, so that the norm bounds
    mu. The plants are two masses with a spring, the ill-conditioned distillation column, and an
    unstable plant.
    """
    return HinfSynthesis(PLANTS[plant]())
