"""Which proof says that no controller of the kind that is asked for stabilises a plant."""

from __future__ import annotations

from workbench._core.heavy_types import StateSpace
from workbench.program import Task
from workbench.synthesis.no_controller.interlacing import NoStableController, violated
from workbench.synthesis.no_controller.no_gain import NoStabilisingGain


def no_controller(plant: StateSpace, stable: bool) -> Task | None:
    """The proof that no controller of the kind that is asked for stabilises the plant, if known.

    ``stable``: whether the controller itself is asked to be stable; else a gain is asked for.
    """
    if stable and violated(plant) is not None:
        return NoStableController(plant)
    return NoStabilisingGain(plant) if (plant.ninputs, plant.noutputs) == (1, 1) else None
