"""What is given in the place of a system, as a system."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from workbench.errors import InputError
from workbench.heavy_types import StateSpace
from workbench.input_checks import is_real
from workbench.systems.generalised_plant import GeneralisedPlant


def as_system(system: Any, name: str) -> StateSpace:
    """A StateSpace or TransferFunction as a StateSpace with names of its own.

    Raises InputError for another type, an improper system, one without inputs or outputs, and one
    with entries that are not finite.
    """
    import control

    if not isinstance(system, control.StateSpace | control.TransferFunction):
        raise InputError(
            f"{name} must be a StateSpace or TransferFunction, not {type(system).__name__}"
        )
    if not (system.ninputs and system.noutputs):
        raise InputError(
            f"{name} has {system.ninputs} inputs and {system.noutputs} outputs; it needs one each"
        )
    try:
        found = control.ss(system)
    except ValueError as error:
        raise InputError(
            f"{name} has no realisation: {error}; an improper one needs fast poles"
        ) from None
    for part in "ABCD":
        if not np.isfinite(getattr(found, part)).all():
            raise InputError(f"{part} of {name} has entries that are not finite")
    return found


def as_weight(weight: Any, size: int, name: str) -> StateSpace:
    """A weight with `size` inputs: a system, or a number or single channel for each of them.

    Raises InputError as `as_system`, and for another size.
    """
    import control

    if is_real(weight):
        if not math.isfinite(weight):
            raise InputError(f"{name} is {weight}; it must be finite")
        return control.ss([], [], [], float(weight) * np.eye(size))
    system = as_system(weight, name)
    if (system.ninputs, system.noutputs) == (1, 1) and size > 1:
        return control.append(*[system] * size)
    if system.ninputs != size:
        raise InputError(f"{name} has {system.ninputs} inputs; it must have {size}, or 1 and 1")
    return system


def need_plant(plant: Any) -> None:
    """Raise InputError where something else is given in a GeneralisedPlant's place."""
    if not isinstance(plant, GeneralisedPlant):
        raise InputError(
            f"plant must be a GeneralisedPlant, not {type(plant).__name__}; it says which of a "
            "system's inputs and outputs are perturbation, performance and control"
        )
