"""Stadiums of the smallest area by differential evolution.

For a given angle, axis and radius the shortest stadium has a closed form: its ends are determined
by the first and the last of the points' chords. Three numbers remain, in which the area has many
local minima; a population of stadiums explores all of them (R. Storn, K. Price, Differential
evolution, J. Global Optimization 11 (1997) 341-359).

It is an independent answer beside the search, compared only if it is named: on the CD drives, with
10 s for each cell, it has no certificate (docs/study.md).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.executor import Context
from workbench.geometry.area.program import SmallestAreaStadium, each_hull
from workbench.program import Claim, method

MEMBERS = 15
"""Number of members of the population for each number sought."""
MOST_GENERATIONS = 400
"""Largest number of generations of a population."""
SETTLED = 1e-10
"""A population has settled if the relative spread of its areas is below this."""
RADIUS_POWER = 3
"""Radii are drawn as this power of a uniform number, so that they are dense near the least one."""


class ShapeFamily(NamedTuple):
    """The shortest stadiums around corners (M,), including a circle of radius ``largest``.

    ``centred``: all have the centre 0. ``angle`` [rad]: all have this direction; None: it is free.
    """

    corners: ComplexArray
    largest: float
    centred: bool
    angle: float | None

    @property
    def bounds(self) -> list[tuple[float, float]]:
        """Bounds of the three numbers that define a member: radius, axis, angle [rad]."""
        axis = [] if self.centred else [(0.0, 1.0)]
        return [(0.0, 1.0), *axis, *([] if self.angle is not None else [(0.0, np.pi)])]

    def members(self, numbers: RealArray) -> tuple[RealArray, ComplexArray, RealArray, RealArray]:
        """Radius, centre, half-length and angle [rad], each (S,), of numbers (N, S)."""
        angle = np.full(numbers.shape[1], self.angle) if self.angle is not None else numbers[-1]
        turned = self.corners[:, None] * np.exp(-1j * angle)
        t, h = turned.real, turned.imag
        low, high = h.min(axis=0), h.max(axis=0)
        least = np.maximum(high, -low) if self.centred else (high - low) / 2
        radius = least + np.maximum(self.largest - least, 0.0) * numbers[0] ** RADIUS_POWER
        axis: RealArray = np.zeros_like(angle)
        if not self.centred:
            axis = high - radius + numbers[1] * (low - high + 2 * radius)
        room = np.sqrt(np.maximum(radius**2 - (h - axis) ** 2, 0.0))
        if self.centred:
            middle, half = np.zeros_like(angle), (np.abs(t) - room).max(axis=0)
        else:
            start, end = (t + room).min(axis=0), (t - room).max(axis=0)
            middle, half = (start + end) / 2, (end - start) / 2
        center = (middle + 1j * axis) * np.exp(1j * angle)
        return radius, center, np.maximum(half, 0.0), angle

    def areas(self, numbers: RealArray) -> RealArray:
        """Areas (S,) of the members of numbers (N, S)."""
        radius, _, half, _ = self.members(numbers)
        return np.pi * radius**2 + 4 * radius * half


@method(SmallestAreaStadium, "evolution", optimal=False, accuracy=ANY_ACCURACY_ALIKE, by_name=True)
def _evolution(program: SmallestAreaStadium, context: Context) -> Claim:
    """Differential evolution over angle, axis and radius, whose shortest stadium is in closed form.

    It draws random numbers; another seed gives another search.
    """
    from scipy.optimize import differential_evolution

    def stadium(
        corners: ComplexArray, largest: float, centred: bool, angle: float | None
    ) -> tuple[complex, float, float]:
        family = ShapeFamily(corners, largest, centred, angle)
        found = differential_evolution(
            family.areas,
            family.bounds,
            popsize=MEMBERS,
            maxiter=MOST_GENERATIONS,
            tol=SETTLED,
            rng=context.rng,
            polish=False,
            updating="deferred",
            vectorized=True,
        )
        _, about, half, direction = family.members(found.x[:, None])
        return complex(about[0]), float(half[0]), float(direction[0])

    return each_hull(program, context, stadium)
