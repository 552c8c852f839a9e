"""What the functions of this room are given, looked at before anything is done with it."""

from __future__ import annotations

import math
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.errors import InputError
from workbench.uncertainty.generalised import GeneralisedPlant

if TYPE_CHECKING:
    from control import StateSpace


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


def need_positive(value: Any, name: str, or_none: bool = False) -> None:
    """Raise InputError for what is no number, positive and finite (or None, where that may be)."""
    if or_none and value is None:
        return
    if not (is_real(value) and 0.0 < value < math.inf):
        end = ", or None" if or_none else ""
        raise InputError(f"{name} is {value!r}; it must be a number, positive and finite{end}")


def need_whole(value: Any, name: str) -> None:
    """Raise InputError for what is no whole number."""
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise InputError(f"{name} is {value!r}; it must be a whole number")


def is_real(value: Any) -> bool:
    """Whether it is a real number, truth values left out."""
    return isinstance(value, Real) and not isinstance(value, bool)
