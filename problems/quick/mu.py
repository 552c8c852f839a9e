"""Bounds of mu of robust performance, at a few frequencies."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from workbench import problem
from workbench.mu import MuLowerBound, MuUpperBound
from workbench.structure import Structure

from .loops import RANGES, closed_loop

Loop = Literal["mass-spring", "distillation"]
LOOPS = ("mass-spring", "distillation")
Few = Annotated[int, Field(ge=2, le=1000)]


def loop_matrices(plant: str, frequencies: int) -> tuple[Any, Structure]:
    """N(j omega) (frequency, outputs, inputs), labelled, and the structure of performance."""
    import xarray as xr

    loop = closed_loop(plant)
    omega = np.geomspace(*RANGES[plant], frequencies)
    labelled = xr.DataArray(
        loop.response(omega),
        dims=("frequency", "output", "input"),
        coords={"frequency": ("frequency", omega, {"units": "rad/s"})},
    )
    return labelled, loop.performance_structure


@problem("quick/{plant}/mu-upper", plant=LOOPS)
def mu_upper(plant: Loop, frequencies: Few = 12) -> MuUpperBound:
    """Upper bound of mixed mu of a loop: a D/G linear matrix inequality at each frequency.

    The two masses with a simple controller have a real and a complex scalar beside the performance,
    the distillation column with the inverse of its gains two complex scalars.

    frequencies: how many.
    """
    return MuUpperBound(*loop_matrices(plant, frequencies))


@problem("quick/{plant}/mu-lower", plant=LOOPS)
def mu_lower(plant: Loop, frequencies: Few = 12) -> MuLowerBound:
    """Lower bound of mixed mu of a loop: the smallest perturbation found at each frequency.

    The loops of quick/{plant}/mu-upper.

    frequencies: how many.
    """
    return MuLowerBound(*loop_matrices(plant, frequencies))
