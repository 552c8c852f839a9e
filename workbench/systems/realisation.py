"""Realisations: their matrices, and python-control's StateSpace made of them."""

from __future__ import annotations

from typing import Any

from workbench.arrays import RealArray
from workbench.heavy_types import StateSpace

Matrices = tuple[RealArray, RealArray, RealArray, RealArray]
"""A, B, C and D of a realisation."""


def realisation(matrices: Matrices, dt: float, **labels: Any) -> StateSpace:
    """A StateSpace of the matrices, with every state kept; `labels` name its signals."""
    import control

    return control.StateSpace(*matrices, dt, remove_useless_states=False, **labels)
