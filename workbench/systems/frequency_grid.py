"""Grids of frequencies chosen from the poles of a system."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError


def frequencies_of(loop: StateSpace) -> np.ndarray:
    """Grid of frequencies [rad/s] chosen from a stable loop's poles, without 0 and infinity.

    A static loop, whose response is the same at every frequency, gets three frequencies.
    """
    omega = starting_grid(loop.poles())
    inside: np.ndarray = omega[(omega > 0) & np.isfinite(omega)]
    return inside if inside.size else np.array([0.1, 1.0, 10.0])


POINTS_PER_DECADE = 8
"""Frequencies per decade of the even part of the grid."""

GRID_REACH = 100.0
"""Factor by which the grid extends below the slowest and above the fastest pole."""

LIGHT_DAMPING = 0.3
"""Damping ratio below which a pole gets additional frequencies around its resonance."""

RESONANCE_OFFSETS = np.array([0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0])
"""Distances of these additional frequencies from the resonance, in half-widths, on either side."""

AT_ZERO = 1e-15
"""A pole counts as 0 up to this size, relative to the largest one."""


def starting_grid(poles: Array) -> RealArray:
    """Grid of frequencies [rad/s] chosen from a system's poles (n,), with 0 and infinity.

    Poles at 0, up to rounding, add no frequencies.
    """
    size = np.abs(poles)
    poles = poles[size > AT_ZERO * size.max(initial=0.0)]
    natural = np.abs(poles)
    if not len(natural):
        return np.array([0.0, np.inf])
    with np.errstate(over="ignore"):
        low, high = natural.min() / GRID_REACH, natural.max() * GRID_REACH
    if not (low > 0.0 and np.isfinite(high)):
        raise InputError(
            f"poles from {natural.min():.3g} to {natural.max():.3g} rad/s leave the range of "
            "doubles; measure time in another unit"
        )
    count = int(np.ceil(POINTS_PER_DECADE * np.log10(high / low))) + 1
    light = poles[(poles.imag > 0) & (-poles.real < LIGHT_DAMPING * natural)]
    near = light.imag[:, None] - light.real[:, None] * np.concatenate(
        [RESONANCE_OFFSETS, -RESONANCE_OFFSETS]
    )
    parts = [[0.0, np.inf], np.geomspace(low, high, count), natural, near.ravel()]
    grid: RealArray = np.unique(np.concatenate(parts))
    return grid[grid >= 0.0]
