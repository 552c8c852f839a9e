"""Benchmarks of mu synthesis, each solved by one method or by a chain of two."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import Field

from workbench import Run, problem, ref
from workbench.errors import InputError
from workbench.synthesis import MuSynthesis, approximate
from workbench.systems import restored_system
from workbench.types import StateSpace
from workbench.uncertainty import GeneralisedPlant

from ..mass_spring.plant import two_mass_plant
from .distillation import distillation_column
from .first_order import unstable_first_order

PLANTS: dict[str, Callable[[], GeneralisedPlant]] = {
    "mass-spring": two_mass_plant,
    "distillation": distillation_column,
    "unstable-first-order": unstable_first_order,
}
MASS_SPRING_UNITS = {"d": "1", "n": "1", "u": "N", "y": "m"}
"""Units of the signals of the two masses. The weights scale d and n, which have no unit."""
After = Literal["", "dk", "mu-dk", "dgk"]


def earlier(plant: str, after: After = "", **_: Any) -> dict[str, Any]:
    """Reference to the controller from which a chain starts; empty without ``after``."""
    return {"start": ref(f"{plant}/controller", method=after)} if after else {}


@problem(
    "{plant}/controller",
    plant=("mass-spring", "distillation", "unstable-first-order"),
    needs=earlier,
    method="dgk",
)
def controller(
    plant: Literal["mass-spring", "distillation", "unstable-first-order"],
    start: Run | None = None,
    after: After = "",
    order: Annotated[int, Field(ge=0)] | None = None,
) -> MuSynthesis:
    """The controller with the least certified peak of mixed mu, by any method or chain of two.

    The plants are two masses with an uncertain spring, the ill-conditioned distillation column, and
    an unstable plant of first order. Method "fixed" starts from the controller of an earlier
    method.

    after: method whose controller is the start. order: number of states to which that controller is
    reduced first; None keeps all.
    """
    chosen = PLANTS[plant]()
    unitless = dict.fromkeys((*chosen.system.input_labels, *chosen.system.output_labels), "1")
    units = MASS_SPRING_UNITS if plant == "mass-spring" else unitless
    return MuSynthesis(chosen, start=_starting_controller(chosen, start, order), units=units)


def _starting_controller(
    plant: GeneralisedPlant, start: Run | None, order: int | None
) -> StateSpace | None:
    if start is None:
        if order is not None:
            raise InputError(
                f"order = {order} reduces the controller of an earlier method: name it by after"
            )
        return None
    K = restored_system(start.data, "controller")
    needless = order is None or K.nstates <= order
    return K if needless else approximate(K, order, plant=plant)
