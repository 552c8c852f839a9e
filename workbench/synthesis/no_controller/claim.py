"""Choice of the proof that no controller of the requested kind stabilises a plant."""

from __future__ import annotations

from workbench._core.heavy_types import StateSpace
from workbench.program import Task
from workbench.synthesis.no_controller.interlacing import NoStableController, violated
from workbench.synthesis.no_controller.no_gain import NoStabilisingGain


def no_controller(plant: StateSpace, stable: bool) -> Task | None:
    """The proof that no controller of the requested kind stabilises the plant, if one is known.

    With ``stable`` the controller must itself be stable; otherwise it must be a constant gain.
    """
    if stable and violated(plant) is not None:
        return NoStableController(plant)
    return NoStabilisingGain(plant) if (plant.ninputs, plant.noutputs) == (1, 1) else None
