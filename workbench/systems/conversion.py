"""Conversion of users' systems and weights to StateSpace, with checks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import is_real
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.joints import system_of
from workbench.systems.realisation import with_all_poles


def as_system(system: Any, name: str) -> StateSpace:
    """Convert anything that `system_of` takes to a new StateSpace with the names of its signals.

    Raises InputError as `system_of` does, and for an improper system, a system without inputs or
    outputs, or entries that are not finite. `name` is the name of the system in messages.
    """

    system = system_of(system, name)
    if not (system.ninputs and system.noutputs):
        raise InputError(
            f"{name} has {system.ninputs} inputs and {system.noutputs} outputs; it "
            "needs at least one of each: choose channels that it has"
        )
    found = as_states(system, name)
    for part in "ABCD":
        if not np.isfinite(getattr(found, part)).all():
            raise InputError(f"{part} of {name} has entries that are not finite")
    return found


def as_loop(loop: Any) -> StateSpace:
    """A loop that is given as a StateSpace as it is, also without signals; others by `as_system`.

    Checks are asked of the same loop again and again, and of autonomous ones.
    """
    return loop if hasattr(loop, "A") else as_system(loop, "loop")


def as_states(system: Any, name: str) -> StateSpace:
    """As `with_all_poles`; if there is no realisation, InputError names the system."""
    try:
        return with_all_poles(system)
    except InputError as error:
        raise InputError(f"{name} has no realisation: {error}") from None
    except ValueError as error:  # python-control's realisation, for several inputs or outputs
        raise InputError(
            f"{name} has no realisation: {error}; an improper one needs a filter, such as "
            "1 / (T s + 1) with a short T"
        ) from None


def as_weight(weight: Any, size: int, name: str) -> StateSpace:
    """Convert a weight to a StateSpace with `size` inputs.

    A number or a system with one input and one output is repeated for each input. Raises
    InputError as `as_system` does, and for a system of another size.
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
    """Raise InputError unless `plant` is a GeneralisedPlant."""
    if not isinstance(plant, GeneralisedPlant):
        raise InputError(
            f"plant must be a GeneralisedPlant, not {type(plant).__name__}; "
            "GeneralisedPlant(system, structure, controls, measurements) says which of a "
            "system's inputs and outputs are "
            "perturbation, performance and control, and MixedSensitivity makes one of a plant and "
            "its weights"
        )
