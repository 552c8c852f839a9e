"""What the functions of this room are given, looked at before anything is done with it."""

from __future__ import annotations

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
