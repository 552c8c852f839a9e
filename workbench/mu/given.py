"""What the functions of this room are given, looked at before anything is done with it."""

from __future__ import annotations

from numbers import Integral, Real
from typing import Any

from workbench.errors import InputError
from workbench.structure import Structure


def need_structure(structure: Any) -> None:
    """Raise InputError where something else is given in a Structure's place."""
    if not isinstance(structure, Structure):
        raise InputError(
            f"structure must be a Structure, not {type(structure).__name__}; "
            "Structure.from_pairs takes rows of two integers"
        )


def need_tolerance(tolerance: Any) -> None:
    """Raise InputError for what is no number between 0 and 1."""
    if not (isinstance(tolerance, Real) and 0.0 < float(tolerance) < 1.0):
        raise InputError(f"tolerance is {tolerance!r}; it must be a number between 0 and 1")


def need_count(name: str, value: Any) -> None:
    """Raise InputError for what is no integer of at least 1."""
    if isinstance(value, bool) or not isinstance(value, Integral) or value < 1:
        raise InputError(f"{name} is {value!r}; it must be an integer of at least 1")
