"""Checks for functions that need a stable system, with the message for any other."""

from __future__ import annotations

from typing import Any

from workbench._core.heavy_types import StateSpace
from workbench.certify.realisations.lyapunov import stability_proof
from workbench.certify.stability import is_proven_unstable
from workbench.errors import InputError
from workbench.systems.conversion import as_system
from workbench.systems.realisation import worst_pole


def stable_states(system: Any, what: str) -> StateSpace:
    """A system in state space, proven to be stable; ``what`` is named in the message otherwise.

    Raises
    ------
    InputError
        As `as_system`, and for a pole that is not proven to be stable.
    """
    found = as_system(system, "system")
    if stability_proof(found).holds:
        return found
    pole = worst_pole(found)[0]
    place = f"z = {pole:.9g}" if found.dt else f"{pole:.6g} rad/s"
    boundary = "unit circle" if found.dt else "imaginary axis"
    if is_proven_unstable(found.A, bool(found.dt)):
        said = f"is unstable: it has the pole {place}"
    else:
        said = f"has the pole {place} on the {boundary}, or within rounding of it"
    raise InputError(
        f"the system {said}; {what} belong to stable systems: ask those of its stable part, "
        "stable_part(system).stable"
    )
