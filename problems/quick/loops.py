"""Closed loops of the literature whose mu is bounded."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from workbench.structure import Structure
from workbench.types import StateSpace
from workbench.uncertainty import GeneralisedPlant

from ..mass_spring.plant import simple_controller
from ..textbook.controller import PLANTS
from ..textbook.distillation import GAINS, TIME_CONSTANT

RANGES = {"mass-spring": (1e-2, 1e2), "distillation": (1e-3, 1e2)}
"""First and last frequency, in rad/s and for the column in rad/min: from below the bandwidth of the
loop to above it.
"""
INVERSE_GAIN = 0.7
"""Bandwidth of the inverse-based controller of the column [rad/min]."""


def inverse_based() -> StateSpace:
    """The column's controller 0.7 (75 s + 1) / s G(0)^-1.

    S. Skogestad, M. Morari, J. Doyle, IEEE Trans. Automatic Control 33 (1988) 1092-1105. Its loop
    is perfect for the nominal column and far from robust.
    """
    import control

    inverse = INVERSE_GAIN * np.linalg.inv(GAINS)
    return control.ss(np.zeros((2, 2)), np.eye(2), inverse, TIME_CONSTANT * inverse)


CONTROLLERS: dict[str, Callable[[], StateSpace]] = {
    "mass-spring": simple_controller,
    "distillation": inverse_based,
}


def closed_loop(plant: str) -> GeneralisedPlant:
    """Closed loop of a plant with its controller: (perturbation, exogenous) -> (perturbation,
    performance).
    """
    whole = PLANTS[plant]()
    return GeneralisedPlant(whole.close(CONTROLLERS[plant]()), whole.structure, 0, 0)


Loop = Literal["mass-spring", "distillation"]
Few = Annotated[int, Field(ge=2, le=1000)]


def loop_matrices(plant: str, frequencies: int) -> tuple[Any, Structure]:
    """Labelled N(j omega) (frequency, outputs, inputs), and the structure for robust
    performance.
    """
    import xarray as xr

    loop = closed_loop(plant)
    omega = np.geomspace(*RANGES[plant], frequencies)
    labelled = xr.DataArray(
        loop.response(omega),
        dims=("frequency", "output", "input"),
        coords={"frequency": ("frequency", omega, {"units": "rad/s"})},
    )
    return labelled, loop.performance_structure
