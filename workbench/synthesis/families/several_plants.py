"""One controller for several plants: checks that they fit together, and their loops as one
system.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

from scipy.linalg import block_diag

from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.structure import Structure
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.hidden_states import visible
from workbench.systems.realisation import matrices_of, realisation


def further(plants: Any, plant: GeneralisedPlant) -> tuple[GeneralisedPlant, ...]:
    """The further plants for the controller of ``plant``, without hidden states.

    Raises InputError if they are no plants, or have other controls, measurements or sampling times.
    """
    what = "further_plants must be a tuple of GeneralisedPlants"
    if isinstance(plants, GeneralisedPlant):
        raise InputError(f"{what}: write (plant,) for one")
    if isinstance(plants, str) or not isinstance(plants, Sequence):
        raise InputError(f"{what}, not {type(plants).__name__}")
    for number, each in enumerate(plants, start=1):
        name = f"further plant {number}"
        if not isinstance(each, GeneralisedPlant):
            raise InputError(f"{what}; {name} is a {type(each).__name__}")
        has, needed = (
            (one.measurements, one.controls, float(one.system.dt or 0.0)) for one in (each, plant)
        )
        if has != needed:
            raise InputError(
                f"{name} has {has[0]} measurements, {has[1]} controls and dt = {has[2]} s; the "
                f"plant has {needed[0]}, {needed[1]} and {needed[2]} s, and one controller must "
                "fit all"
            )
        if not (each.exogenous and each.performance):
            raise InputError(
                f"{name} has {each.exogenous} exogenous inputs and {each.performance} performance "
                "outputs; one of each is needed at least"
            )
    return tuple(visible(each) for each in plants)


def closed_side_by_side(plants: Sequence[GeneralisedPlant], K: StateSpace) -> StateSpace:
    """The closed loops of all plants as one block diagonal system; K controls each plant.

    Its norm, or its peak of mu for `joint_structure`, is the largest over the plants.
    """
    loops = [plant.close(K) for plant in plants]
    if len(loops) == 1:
        return loops[0]
    parts = (block_diag(*part) for part in zip(*map(matrices_of, loops), strict=True))
    A, B, C, D = parts
    return realisation((A, B, C, D), float(loops[0].dt or 0.0))


def joint_structure(plants: Sequence[GeneralisedPlant]) -> Structure:
    """The perturbation and performance blocks of all plants, in the order of their loops."""
    if len(plants) == 1:
        return plants[0].performance_structure
    blocks: list[Any] = [
        replace(cast(Any, block), name=f"{block.name} of plant {number}".strip())
        for number, plant in enumerate(plants, start=1)
        for block in plant.performance_structure.blocks
    ]
    return Structure(blocks)
