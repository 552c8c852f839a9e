"""Frequencies that the poles of a system ask for."""

from __future__ import annotations

import numpy as np

from workbench.arrays import Array, RealArray
from workbench.heavy_types import StateSpace


def frequencies_of(loop: StateSpace) -> np.ndarray:
    """Frequencies [rad/s] that a stable loop's poles ask for, 0 and infinity left out.

    Some of a static loop, which is the same at all of them.
    """
    omega = starting_grid(loop.poles())
    inside: np.ndarray = omega[(omega > 0) & np.isfinite(omega)]
    return inside if inside.size else np.array([0.1, 1.0, 10.0])


PER_DECADE = 8

BEYOND = 100.0
"""How far the grid reaches beyond the slowest and the fastest pole, as a factor."""

LIGHT = 0.3
"""Damping ratio below which a pole has frequencies of its own."""

WIDTHS = np.array([0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0])
"""Where those are, in half-widths of its resonance on either side."""


def starting_grid(poles: Array) -> RealArray:
    """Frequencies [rad/s] that a system's poles (n,) ask for, with 0 and infinity."""
    natural = np.abs(poles)
    if not len(natural):
        return np.array([0.0, np.inf])
    low, high = natural.min() / BEYOND, natural.max() * BEYOND
    count = int(np.ceil(PER_DECADE * np.log10(high / low))) + 1
    light = poles[(poles.imag > 0) & (-poles.real < LIGHT * natural)]
    near = light.imag[:, None] - light.real[:, None] * np.concatenate([WIDTHS, -WIDTHS])
    parts = [[0.0, np.inf], np.geomspace(low, high, count), natural, near.ravel()]
    grid: RealArray = np.unique(np.concatenate(parts))
    return grid[grid >= 0.0]
