"""Realisations: their matrices, and python-control's StateSpace made of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench.arrays import RealArray
from workbench.heavy_types import StateSpace

Matrices = tuple[RealArray, RealArray, RealArray, RealArray]
"""A, B, C and D of a realisation."""


def in_words(system: StateSpace) -> str:
    """Order of a system, whether it is stable itself, and its fastest pole, for people."""
    poles = system.poles()
    size = np.abs(poles)
    if system.dt:
        stable = bool((size < 1.0).all())
        used = poles[size > 0].astype(complex)
        size = np.abs(np.log(used)) / (1.0 if system.dt is True else system.dt)
    else:
        stable = bool((poles.real < 0).all())
    fastest = f", fastest pole {size.max():.4g} rad/s" if size.size else ""
    return f"order {system.nstates}, {'stable' if stable else 'UNSTABLE'} itself{fastest}"


def realisation(matrices: Matrices, dt: float, **labels: Any) -> StateSpace:
    """A StateSpace of the matrices, with every state kept; `labels` name its signals."""
    import control

    return control.StateSpace(*matrices, dt, remove_useless_states=False, **labels)
